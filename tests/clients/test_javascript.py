"""Tests of nep-js: its own tests, the listings of the paper, and the exchange with Python.

The exchange is tested under failures, too.
"""

from __future__ import annotations

import base64
import json
import os
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Iterator

import pytest

import nep
from app.robots.description.description import parse
from nep.masters.master import Master
from nep.messages.image_codec import raw_image
from tests.clients.node_programs import (
    ADAPTER,
    LONG_S,
    NEEDS_NODE,
    PACKAGE,
    Adapter,
    build_package,
    node,
    prepared,
    run_script,
    running_script,
)
from tests.nep.programs import eventually, running

pytestmark = NEEDS_NODE

PUBLISHER = """\
const zmq = require("zeromq");
const nep = require("nep-js");

var node = new nep.{node}("publisher_sample");
var publisher = node.new_pub("test", "json");
var message = {{ message: "hello world" }};
publisher.publish(message);
"""
SUBSCRIBER = """\
const zmq = require("zeromq");
const nep = require("nep-js");

var node = new nep.{node}("subscriber_sample");
var callback = function (message) {{
  console.log(JSON.stringify(message));
  node.close();
}};
var subscriber = node.new_callback("test", "json", callback);
"""
SLOW_RULES = {
    "again", "bye-again", "closed-is-left", "lost-last-seq", "lost-late", "lost-unreachable",
    "malformed-named", "next-s", "other-socket-at-publisher", "renew", "renewed-topics",
    "restart", "statistics", "unknown-answers",
}  # fmt: skip
"""Conformance rules that wait for renewals; run only by `nep wire check` without ``--rule``."""
ALL_TYPES = """\
const { Robot } = require("nep-js/robot");

const speed = { type: "number", minimum: 0, maximum: 1, unit: "m/s", step: 0.1 };
const side = { type: "string", choices: ["left", "right"] };
const parameters = {
  number: { ...speed, default: 0.5 },
  integer: { type: "integer", step: 2, optional: true },
  colour: { type: "colour", default: "#ffffff" },
  image: { type: "image" },
  list: { type: "list", items: speed, minLength: 1, maxLength: 3, default: [0.1] },
  object: { type: "object", fields: { x: speed, y: { type: "boolean" } } },
  choice: { ...side, default: "left" },
  named: { type: "string", choices: { l: "to the left", r: "to the right" }, suggested: "l" },
  boolean: { type: "boolean", default: false, advanced: true },
  text: { type: "string", minLength: 1, maxLength: 5, suggested: "hi" },
};
const robot = new Robot({
  model: "all", title: "All", virtual: true, kinds: ["mobile"], description: "Has everything.",
  actions: {
    go: {
      text: "go %number", says: "goes", category: "Movement", icon: "move", parameters, uses: ["wheels"],
      onBusy: "reject", timeoutS: 3, risk: "locomotes", cancellable: false, repeatS: 1,
      output: { moved: speed }, feedback: { moved: speed }, run() {},
    },
  },
  sensors: {
    camera: { type: "camera", width: 6, height: 4, hfovDeg: 60, rateHz: 10 },
    pose: { type: "object", fields: { x: speed }, text: "pose" },
  },
  events: {
    bumped: {
      text: "when %robot bumps into something on the %side", icon: "zap", fields: { side }, choose: ["side"],
    },
  },
  stop: { run() {} },
});
console.log(JSON.stringify(robot.describe("My robot")));
"""
MORTAL_SERVER = """
import os, signal, threading, nep
node = nep.node("mortal")
node.new_server("/die", lambda request: os.kill(os.getpid(), signal.SIGKILL), threads=1)
print("ready", flush=True)
threading.Event().wait()
"""
LARGE_BYTES = 6 * 2**20
LARGE_COUNT = 50


@pytest.fixture(scope="module", autouse=True)
def _package() -> None:
    build_package()


@pytest.fixture
def program(master: Master) -> Iterator[Adapter]:
    """JavaScript program that executes requests with a node named `js`."""
    running = Adapter(master.address)
    running.do("node", name="js")
    yield running
    running.end()


@pytest.fixture
def python(master: Master, patient: None) -> Iterator[nep.node]:
    with nep.node("python") as own:
        yield own


def nep_command(*arguments: str) -> str:
    command = [sys.executable, "-m", "nep", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=240, check=False).stdout


def free_port() -> int:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        return bound.getsockname()[1]


def test_javascript_package_passes_its_own_tests(master):
    tests = sorted(str(each) for each in (PACKAGE / "test").glob("*.test.mjs"))
    done = subprocess.run(
        [str(node), "--test", *tests],
        cwd=PACKAGE,
        env={**os.environ, "NEP_MASTER": master.address},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_lock_file_contains_no_resolved_registry_urls():
    lock = json.loads((PACKAGE / "package-lock.json").read_text())
    assert not [name for name, each in lock["packages"].items() if "resolved" in each]


@pytest.mark.parametrize("name", ["Node", "node"])
def test_published_message_arrives_and_the_program_exits(python, master, tmp_path, name):
    subscriber = python.new_sub("test", "json")
    done = run_script(PUBLISHER.format(node=name), tmp_path, NEP_MASTER=master.address)
    assert (done.returncode, done.stderr) == (0, "")
    assert subscriber.listen(True) == (True, {"message": "hello world"})
    assert subscriber.lost == 0


def test_callback_of_the_listing_receives_the_message(python, master, tmp_path):
    publisher = python.new_pub("test", "json", latched=True)
    publisher.publish({"message": "hello world"})
    done = run_script(SUBSCRIBER.format(node="Node"), tmp_path, NEP_MASTER=master.address)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout) == {"message": "hello world"}


@pytest.mark.parametrize(
    ("msg_type", "payload"),
    [
        ("json", {"text": "grüß", "list": [1, 2.5, None, True]}),
        ("string", "grüß dich"),
        ("bytes", b"\x00\xff"),
        ("msgpack", {"a": [1, -2.5, "ü", None]}),
        ("robot/description", {"name": "Pepper"}),
    ],
)
def test_payloads_are_received_unchanged_in_both_directions(program, python, msg_type, payload):
    received = program.do("subscriber", topic="to_js", type=msg_type)["sub"]
    python.new_pub("to_js", msg_type).publish(payload)
    assert program.wait(lambda messages: len(messages) == 1)
    (message,) = program.messages
    assert message["sub"] == received
    assert message["seq"] == "1"
    if msg_type == "bytes":
        assert base64.b64decode(message["payload"]) == payload
    else:
        assert message["value"] == payload
    subscriber = python.new_sub("to_py", msg_type)
    published = program.do("publisher", topic="to_py", type=msg_type)
    assert published["missing"] == []
    given = {"bytes": base64.b64encode(payload).decode()} if msg_type == "bytes" else {"value": payload}
    program.do("publish", pub=published["pub"], **given)
    assert subscriber.listen(True) == (True, payload)


def test_images_are_exchanged_in_both_directions(program, python):
    numpy, cv2 = pytest.importorskip("numpy"), pytest.importorskip("cv2")
    picture = numpy.arange(48, dtype="uint8").reshape(4, 4, 3)
    program.do("subscriber", topic="to_js", type="image")
    python.new_pub("to_js", "image").publish(raw_image(picture))
    assert program.wait(lambda messages: len(messages) == 1)
    assert base64.b64decode(program.messages[0]["payload"]) == picture.tobytes()
    subscriber = python.new_sub("to_py", "image")
    pub = program.do("publisher", topic="to_py", type="image")["pub"]
    png = cv2.imencode(".png", picture)[1].tobytes()
    program.do("publish", pub=pub, bytes=base64.b64encode(png).decode())
    is_there, received = subscriber.listen(True)
    assert is_there
    assert numpy.array_equal(received, picture)


def test_bursts_are_received_in_order_in_both_directions(program, python):
    program.do("subscriber", topic="to_js", type="json")
    publisher = python.new_pub("to_js", "json")
    for n in range(5000):
        publisher.publish({"n": n})
    assert program.wait(lambda messages: len(messages) == 5000)
    assert [each["value"]["n"] for each in program.messages] == list(range(5000))
    subscriber = python.new_sub("to_py", "json")
    pub = program.do("publisher", topic="to_py", type="json")["pub"]
    program.do("publish", pub=pub, value={}, count=5000)
    assert [subscriber.listen(True)[1]["n"] for _ in range(5000)] == list(range(1, 5001))
    assert subscriber.lost == 0


def test_late_subscribers_receive_latched_messages_and_history(program, python):
    latched = program.do("publisher", topic="state", type="json", latched=True)["pub"]
    history = program.do("publisher", topic="log", type="json", history=3)["pub"]
    program.do("publish", pub=latched, value={}, count=5)
    program.do("publish", pub=history, value={}, count=5)
    assert python.new_sub("state", "json").listen(True) == (True, {"n": 5})
    subscriber = python.new_sub("log", "json")
    assert [subscriber.listen(True)[1]["n"] for _ in range(3)] == [3, 4, 5]
    publisher = python.new_pub("kept", "json", history=2)
    for n in range(4):
        publisher.publish(n)
    program.do("subscriber", topic="kept", type="json")
    assert program.wait(lambda messages: len(messages) == 2)
    assert [each["value"] for each in program.messages] == [2, 3]


def test_pattern_subscriber_receives_topics_published_later(program, python):
    sub = program.do("subscriber", topic="/*/camera", type="json")["sub"]
    for name in ("left", "right"):
        python.new_pub(f"/{name}/camera", "json").publish(name)
    assert program.wait(lambda messages: len(messages) == 2)
    assert {each["topic"] for each in program.messages} == {"/left/camera", "/right/camera"}
    assert program.do("counts", sub=sub) | {"re": 0} == {
        "re": 0, "received": "2", "lost": "0", "refused": "0",
    }  # fmt: skip


def test_services_are_called_in_both_directions(program, python):
    program.do("serve", service="/echo")
    assert python.new_client("/echo", timeout_s=LONG_S).call({"a": [1, 2]}) == {"a": [1, 2]}

    def fail(_request: object) -> None:
        raise LookupError("no such joint")

    python.new_server("/double", lambda request: 2 * request, threads=1)
    python.new_server("/fail", fail, threads=1)
    assert program.do("call", service="/double", value=21, timeout_s=LONG_S)["value"] == 42
    failed = program.reply(program.begin("call", service="/fail", value=1, timeout_s=LONG_S))
    assert failed["error"] == "LookupError: no such joint"
    nobody = program.reply(program.begin("call", service="/nobody", value=1, timeout_s=0.05))
    assert "/nobody" in nobody["error"]


def test_call_ends_when_its_server_is_killed(program):
    with running(MORTAL_SERVER) as server:
        assert server.line() == "ready"
        ended = program.reply(program.begin("call", service="/die", value=1, timeout_s=LONG_S))
    assert "exited" in ended["error"]


def test_programs_of_the_readme_exchange_messages(python, tmp_path):
    readme = (PACKAGE / "README.md").read_text(encoding="utf-8")
    programs = dict(re.findall(r"```js\n// (\w+\.mjs)\n(.*?)```", readme, re.DOTALL))
    commands = {name: prepared(text, tmp_path, name) for name, text in programs.items()}
    subscriber = subprocess.Popen(commands["subscriber.mjs"], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    try:
        with python.new_pub("temperature", "json") as publisher:
            eventually(lambda: publisher.subscribers == 1)
        subprocess.run(commands["publisher.mjs"], cwd=tmp_path, timeout=LONG_S, check=True)
        assert subscriber.stdout.readline() == "{ celsius: 21.5 }\n"
    finally:
        subscriber.kill()
        subscriber.communicate()


@pytest.mark.usefixtures("patient")
def test_master_restart_under_traffic_loses_nothing(monkeypatch):
    with Master("127.0.0.1:0", learn_s=0.5) as first:
        address = first.address
        monkeypatch.setenv("NEP_MASTER", address)
        program = Adapter(address)
        program.do("node", name="js")
        own = nep.node("python")
        subscriber = own.new_sub("to_py", "json")
        publisher = own.new_pub("to_js", "json")
        sub = program.do("subscriber", topic="to_js", type="json")["sub"]
        pub = program.do("publisher", topic="to_py", type="json")["pub"]
        publisher.publish(0)
        program.do("publish", pub=pub, value=0)
    publisher.publish(1)  # while no master is running
    program.do("publish", pub=pub, value=1)
    with Master(address, learn_s=0.5):
        later = own.new_sub("new", "json")  # blocks until the nodes have joined again
        new = program.do("publisher", topic="new", type="json")
        program.do("publish", pub=new["pub"], value=3)
        assert later.listen(True) == (True, 3)
        publisher.publish(2)
        program.do("publish", pub=pub, value=2)
        assert [subscriber.listen(True)[1] for _ in range(3)] == [0, 1, 2]
        assert program.wait(lambda messages: [each["value"] for each in messages] == [0, 1, 2])
        late = own.new_pub("to_js", "json")  # the new master knows the subscriber in JavaScript
        assert late.subscribers >= 1
        assert (subscriber.lost, program.do("counts", sub=sub)["lost"]) == (0, "0")
        own.close()
        program.end()


def test_killed_program_is_removed_from_the_subscribers_of_a_publisher(program, python):
    program.do("subscriber", topic="test", type="json")
    publisher = python.new_pub("test", "json")
    assert publisher.subscribers == 1
    program.process.kill()
    eventually(lambda: publisher.subscribers == 0)
    publisher.publish(1)


def test_blocked_subscriber_counts_its_losses(program, python):
    sub = program.do("subscriber", topic="large", type="bytes", latest=True)["sub"]
    publisher = python.new_pub("large", "bytes")
    hang = program.begin("hang", seconds=0.5)
    for _ in range(LARGE_COUNT):
        publisher.publish(bytes(LARGE_BYTES))
    program.reply(hang)

    def is_complete() -> bool:
        counts = program.do("counts", sub=sub)
        return int(counts["received"]) + int(counts["lost"]) == LARGE_COUNT

    eventually(is_complete)


def test_messages_beyond_the_in_flight_limit_of_a_slow_subscriber_are_counted_as_lost(program, python):
    subscriber = python.new_sub("large", "bytes")
    pub = program.do("publisher", topic="large", type="bytes")["pub"]
    payload = base64.b64encode(bytes(LARGE_BYTES)).decode()
    program.do("publish", pub=pub, bytes=payload, count=LARGE_COUNT)
    program.do("close_publisher", pub=pub)
    received = 0

    def is_complete() -> bool:
        nonlocal received
        while subscriber.listen(timeout_s=0.3)[0]:
            received += 1
        return received + subscriber.lost == LARGE_COUNT

    eventually(is_complete)
    assert received >= 24 * 2**20 // LARGE_BYTES


DIRECT = """\
const nep = require("nep-js");

const node = new nep.Node("direct_sample");
const [toJs, toPython] = process.argv.slice(2).map((port) => Number(port));
const options = JSON.parse(process.env.DIRECT_OPTIONS);
const mode = (name) => (options.generation === "A" ? undefined : name); // nep-js 0.1.1 has no modes
const answers = node.direct("127.0.0.1", toPython, mode("many2one"), options);
const publisher = node.new_pub("answers", "json", answers);
const asked = node.direct("127.0.0.1", toJs, mode("one2many"), options);
node.new_sub("questions", "json", (message) => publisher.publish(message), asked);
"""


@pytest.mark.parametrize("options", [{"generation": "A"}, {"generation": "B"}, {"wire": "native"}])
def test_direct_connections_need_no_master(tmp_path, options):
    to_js, to_python = free_port(), free_port()
    with (
        nep.node("python") as python,
        running_script(DIRECT, tmp_path, str(to_js), str(to_python), DIRECT_OPTIONS=json.dumps(options)),
    ):
        answers = python.new_sub(
            "answers", "json", python.direct("127.0.0.1", to_python, "many2one", **options)
        )
        questions = python.new_pub(
            "questions", "json", python.direct("127.0.0.1", to_js, "one2many", **options)
        )
        eventually(lambda: questions.subscribers > 0 and answered(questions, answers))


def answered(questions: nep.Publisher, answers: nep.Subscriber) -> bool:
    questions.publish({"topic": "questions", "text": "grüß dich"})
    is_there, payload = answers.listen(timeout_s=0.05)
    assert not is_there or payload == {"topic": "questions", "text": "grüß dich"}
    return is_there


def test_robot_declared_in_javascript_is_parsed_with_its_types_in_python(tmp_path):
    robot = parse(json.loads(run_script(ALL_TYPES, tmp_path).stdout))
    (go, _stop) = robot.actions
    assert [each.kind for each in go.parameters] == [
        "number", "integer", "colour", "image", "list", "object", "choice", "choice", "boolean", "text",
    ]  # fmt: skip
    assert [each.name for each in go.parameters if each.is_required] == ["image", "object", "named", "text"]
    assert [(each.kind, each.topic) for each in robot.sensors] == [
        ("image", "/My_robot/camera"), ("object", "/My_robot/pose"),
    ]  # fmt: skip
    assert (go.on_busy, go.timeout_s, go.risk, go.repeat_s) == ("reject", 3, "locomotes", 1)
    assert robot.events[0].filters == ("side",)


def test_robot_passes_driver_contract(tmp_path):
    example = (PACKAGE / "examples" / "turntable.mjs").read_text(encoding="utf-8")
    command, program = prepared(example, tmp_path, "turntable.mjs")
    contract = [sys.executable, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider"]
    contract += ["tests/robots/driver/test_contract.py", "--driver-command"]
    done = subprocess.run(
        [*contract, shlex.join([command, str(tmp_path / program)])],
        cwd=PACKAGE.parents[1],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert "skipped" not in done.stdout


def test_library_passes_every_conformance_rule_except_the_slow_ones():
    listed = nep_command("wire", "check", "--list", "--json")
    rules = [each["id"] for each in json.loads(listed) if each["id"] not in SLOW_RULES]
    chosen = [word for rule in rules for word in ("--rule", rule)]
    outcomes = json.loads(nep_command("wire", "check", "--json", *chosen, "--", str(node), str(ADAPTER)))
    assert {each["id"]: each["status"] for each in outcomes} == dict.fromkeys(rules, "passed")
