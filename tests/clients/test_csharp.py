"""Tests of the exchange between programs in C# and Python."""

from __future__ import annotations

import base64
import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zmq

import nep
from nep.masters.master import Master
from nep.masters.process import view
from tests.clients.mono_programs import BUILD, CSHARP, HAS_MONO, ROOT, WITHOUT, MonoProgram, program, running
from tests.nep import programs
from tests.nep.backends.test_unheard_publishers import UnreachablePublisher
from tests.nep.masters.test_attacks import attacker_at
from tests.nep.programs import eventually

pytestmark = pytest.mark.skipif(not HAS_MONO, reason=WITHOUT)
Node = Any
LONG_S = 60.0
RULES = (
    "first-message",
    "closed-is-heard",
    "lost-bye",
    "lost-new",
    "batches-to-readers",
    "malformed",
    "service-malformed",
)
PICTURE = bytes.fromhex(  # a red PNG of 3 x 2 pixels
    "89504e470d0a1a0a0000000d49484452000000030000000208020000001216f14d000000104944415478da63f8"
    "cfc000410c70160041d205fb6ff116c70000000049454e44ae426082"
)


def example(name: str) -> Path:
    return program(f"{name}.exe", CSHARP / "examples" / f"{name}.cs")


def peer(name: str) -> Path:
    return program(f"{name}.exe", CSHARP / "tests" / "peer" / f"{name}.cs")


class Adapter:
    """Client of the C# conformance adapter."""

    def __init__(self, started: MonoProgram) -> None:
        self.program = started
        self.events: list[dict[str, Any]] = []
        self._asked = 0

    def ask(self, what: str, **members: object) -> dict[str, Any]:
        self._asked += 1
        self.program.say(json.dumps({"id": self._asked, "do": what, **members}))
        while (said := json.loads(self.program.line())).get("re") != self._asked:
            self.events.append(said)
        assert "error" not in said, said
        return said

    def refused(self, what: str, **members: object) -> str:
        """Send a request that fails, and return its error message."""
        self._asked += 1
        self.program.say(json.dumps({"id": self._asked, "do": what, **members}))
        return str(json.loads(self.program.line())["error"])

    def heard(self, count: int) -> list[dict[str, Any]]:
        """Wait for ``count`` messages and return them."""
        while len(self.events) < count:
            self.events.append(json.loads(self.program.line()))
        return self.events


@pytest.fixture
def adapter(master: Master) -> Iterator[Adapter]:
    with running(program("Adapter.exe", CSHARP / "conformance" / "Adapter.cs")) as started:
        made = Adapter(started)
        made.ask("node", name="csharp")
        yield made


@pytest.fixture
def node(master: Master, patient: None) -> Iterator[Node]:
    with nep.node("python") as made:
        yield made


def listen(subscriber: Any) -> Any:
    is_there, payload = subscriber.listen(timeout_s=LONG_S)
    assert is_there
    return payload


def test_first_example_of_the_readme_prints_its_own_message(master: Master) -> None:
    text = (CSHARP / "README.md").read_text("utf-8")
    source = BUILD / "ReadmeExample.cs"
    source.parent.mkdir(exist_ok=True)
    source.write_text(text.split("```csharp\n")[1].split("```")[0], "utf-8")
    with running(program("ReadmeExample.exe", source)) as hello:
        assert hello.line() == '{"message":"hello"}'
        assert hello.end() == 0


def test_listing_9_delivers_its_message_and_exits(node: Node) -> None:
    subscriber = node.new_sub("test", "json")
    with running(example("Listing9")) as sender:
        assert listen(subscriber) == {"message": "hello"}
        assert sender.process.wait(LONG_S) == 0


def test_listing_10_prints_published_messages(node: Node) -> None:
    with running(example("Listing10")) as receiver:
        publisher = node.new_pub("test", "json")
        eventually(lambda: publisher.subscribers > 0)
        publisher.publish({"message": "hello"})
        assert json.loads(receiver.line()) == {"message": "hello"}


def test_class_and_method_names_of_version_0_0_0_5_still_work(node: Node) -> None:
    subscriber = node.new_sub("answer", "json")
    ask = node.new_pub("ask", "json")
    called = node.new_pub("called", "json")
    with running(peer("OldNames")) as old:
        assert old.line() == "ready"
        called.publish({"a": "b c"})
        assert listen(subscriber) == {"a": "b c"}
        ask.publish({"say": "the end"})
        assert json.loads(listen(subscriber)["heard"]) == {"say": "the end"}
        still = {"x": 0, "y": 0, "z": 0}
        assert listen(subscriber) == {"linear": {**still, "x": 0.5}, "angular": still}
        seen = listen(subscriber)
        assert seen.pop("header") == {"seq": 0, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": "front"}
        assert seen == {"radiation_type": 0, "field_of_view": 0, "min_range": 0, "max_range": 4, "range": 0}
        assert old.process.wait(LONG_S) == 0


def test_direct_connections_and_the_client_of_version_0_0_0_5_work_without_a_master() -> None:
    context = zmq.Context.instance()
    with (
        context.socket(zmq.REP) as server,
        context.socket(zmq.SUB) as subscriber,
        context.socket(zmq.PUB) as publisher,
    ):
        with context.socket(zmq.PUB) as freed:
            free = freed.bind_to_random_port("tcp://127.0.0.1")
        ports = (
            free,
            publisher.bind_to_random_port("tcp://127.0.0.1"),
            server.bind_to_random_port("tcp://127.0.0.1"),
        )
        with running(peer("DirectNames"), *map(str, ports)) as direct:
            assert direct.line() == "ready"
            subscriber.connect(f"tcp://127.0.0.1:{free}")
            subscriber.subscribe("out")
            direct.say("again")

            def heard_by_csharp() -> bool:
                publisher.send_string("into nothing")  # another topic that starts with the subscribed name
                publisher.send_string('in {"a":"b c"}')
                return not direct.is_silent()

            eventually(heard_by_csharp)

            def heard_from_csharp() -> bool:
                direct.say("again")
                return bool(subscriber.poll(10))

            eventually(heard_from_csharp)
            assert subscriber.recv_string() == 'out {"a":"b c"}'
            direct.say("go on")
            for number in (1, 2):
                assert server.recv_json() == {"n": number}
                server.send_json({"twice": 2 * number})
            while (line := direct.line()) == "sent":
                pass
            assert [json.loads(line), json.loads(direct.line())] == [{"twice": 2}, {"twice": 4}]
            assert direct.line() == "refused"
            assert direct.end() == 0


@pytest.mark.parametrize(
    ("codec", "member", "sent", "received"),
    [
        ("json", "value", {"text": "grüß 🤖", "list": [1, 2.5, None, True]}, None),
        ("string", "text", "grüß\n🤖", None),
        ("bytes", "bytes", "AAEC/w==", b"\0\1\2\xff"),
        ("msgpack", "value", {"big": 2**62, "deep": [[{"a": -1}]]}, None),
    ],
)
def test_payloads_of_every_type_arrive_in_both_directions(
    adapter: Adapter, node: Node, codec: str, member: str, sent: Any, received: Any
) -> None:
    payload = sent if received is None else received
    subscriber = node.new_sub("there", codec)
    pub = adapter.ask("publisher", topic="there", type=codec)["pub"]
    adapter.ask("publish", pub=pub, **{member: sent})
    assert listen(subscriber) == payload
    adapter.ask("subscriber", topic="back", type=codec)
    node.new_pub("back", codec).publish(payload)
    (event,) = adapter.heard(1)
    assert event["codec"] == codec
    assert event.get("value", event["payload"]) == sent


def test_burst_to_csharp_and_large_messages_from_csharp_arrive_and_excess_counts_as_lost(
    adapter: Adapter, node: Node
) -> None:
    sub = adapter.ask("subscriber", topic="burst", type="json")["sub"]
    publisher = node.new_pub("burst", "json")
    for number in range(2000):
        publisher.publish({"n": number})
    assert [each["value"]["n"] for each in adapter.heard(2000)] == list(range(2000))
    assert adapter.ask("counts", sub=sub)["lost"] == "0"
    subscriber = node.new_sub("large", "string")
    pub = adapter.ask("publisher", topic="large", type="string")["pub"]
    text = "x" * 6_000_000
    adapter.ask("publish", pub=pub, text=text, count=20)
    assert all(listen(subscriber) == text for _ in range(20))
    assert subscriber.lost == 0
    adapter.ask("publish", pub=pub, text=text, count=50)  # exceeds the in-flight limit of a subscriber
    deadline, received = time.monotonic() + LONG_S, 0
    while received + subscriber.lost < 50 and time.monotonic() < deadline:
        received += subscriber.listen(timeout_s=0.1)[0]
    assert received + subscriber.lost == 50
    assert received >= 32  # 192 MB


def test_late_subscriber_receives_latched_message_and_history(adapter: Adapter, node: Node) -> None:
    latched = adapter.ask("publisher", topic="state", type="json", latched=True)["pub"]
    history = adapter.ask("publisher", topic="log", type="json", latched=True, history=3)["pub"]
    adapter.ask("publish", pub=latched, value={}, count=5)
    adapter.ask("publish", pub=history, value={}, count=5)
    assert listen(node.new_sub("state", "json")) == {"n": 5}
    late = node.new_sub("log", "json")
    assert [listen(late)["n"] for _ in range(3)] == [3, 4, 5]
    node.new_pub("theirs", "json", latched=True, history=2).publish({"n": 1})
    adapter.ask("subscriber", topic="theirs", type="json")
    assert adapter.heard(1)[0]["value"] == {"n": 1}


@pytest.mark.usefixtures("patient")
def test_master_restart_under_traffic_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    with Master("127.0.0.1:0", learn_s=0.0) as first:
        address = first.address
        monkeypatch.setenv("NEP_MASTER", address)
        with (
            nep.node("python") as node,
            running(program("Adapter.exe", CSHARP / "conformance" / "Adapter.cs")) as started,
        ):
            adapter = Adapter(started)
            adapter.ask("node", name="csharp")
            sub = adapter.ask("subscriber", topic="in", type="json")["sub"]
            pub = adapter.ask("publisher", topic="out", type="json")["pub"]
            subscriber, publisher = node.new_sub("out", "json"), node.new_pub("in", "json")

            def exchange() -> None:
                publisher.publish({})
                adapter.ask("publish", pub=pub, value={})
                listen(subscriber)

            exchange()
            first.close()
            exchange()
            with Master(address, learn_s=0.0):
                eventually(lambda: exchange() or {"python", "csharp"} <= names(node))
                counts = adapter.ask("counts", sub=sub)
                assert (counts["lost"], subscriber.lost) == ("0", 0)
                eventually(lambda: adapter.ask("counts", sub=sub)["received"] == str(publisher.count))


def test_foreign_program_at_master_address_is_named_and_master_is_found_later(tmp_path: Path) -> None:
    """The exception names the program each time; the log names it once until a master has replied."""
    with Master("127.0.0.1:0") as free:
        address = free.address
    adapter_program = program("Adapter.exe", CSHARP / "conformance" / "Adapter.cs")
    log = tmp_path / "log"
    with (
        log.open("w+") as stderr,
        running(
            adapter_program, stderr=stderr, NEP_MASTER=address, MONO_TRACE_LISTENER="Console.Error"
        ) as started,
    ):
        adapter = Adapter(started)
        adapter.ask("node", name="csharp")
        with foreign_socket(zmq.PULL, address):
            assert "(it is a PULL socket)" in adapter.refused("publisher", topic="t", type="json")
        with foreign_socket(zmq.REP, address):
            assert "did not answer" in adapter.refused("publisher", topic="t", type="json")
        with Master(address, learn_s=0.0) as master:
            adapter.ask("publisher", topic="t", type="json")
            eventually(lambda: [each.name for each in view(master.address).nodes.values()] == ["csharp"])
        with foreign_socket(zmq.PUB, address):
            eventually(lambda: "(it is a PUB socket)" in log.read_text())
        with Master(address, learn_s=0.0) as master:
            eventually(lambda: "csharp" in {each.name for each in view(master.address).nodes.values()})
    assert len(log.read_text().splitlines()) == 2


def test_foreign_program_at_publisher_address_is_an_alert_in_the_graph(
    adapter: Adapter, master: Master, node: Node
) -> None:
    adapter.ask("subscriber", topic="t", type="json")
    with attacker_at(master) as connection, socket.create_server(("127.0.0.1", 0)) as free:
        address = f"127.0.0.1:{free.getsockname()[1]}"
        free.close()
        with foreign_socket(zmq.REP, address):
            UnreachablePublisher(connection, f"tcp://{address}").register()
            eventually(lambda: any("(it is a REP socket)" in each.sentence for each in node.graph().alerts))


@contextmanager
def foreign_socket(kind: int, address: str) -> Iterator[None]:
    """Bind a socket of another program at an address."""
    with zmq.Context() as context, context.socket(kind) as made:
        made.linger = 0
        made.bind(f"tcp://{address}")
        yield


def names(node: Node) -> set[str]:
    """Return the names of all nodes in the graph."""
    return {each.name for each in node.graph().nodes.values()}


def test_killed_program_leaves_the_graph_and_can_be_restarted(master: Master, node: Node) -> None:
    subscriber = node.new_sub("test", "json")
    adapter_program = program("Adapter.exe", CSHARP / "conformance" / "Adapter.cs")
    for is_last in (False, True):
        with running(adapter_program) as started:
            adapter = Adapter(started)
            adapter.ask("node", name="victim")
            pub = adapter.ask("publisher", topic="test", type="json")["pub"]
            adapter.ask("publish", pub=pub, value={"a": 1})
            assert listen(subscriber) == {"a": 1}
            eventually(lambda: "victim" in names(node))
            started.process.kill()
            started.process.wait()
            if not is_last:
                eventually(lambda: "victim" not in names(node))
    assert subscriber.lost == 0


def test_slow_subscriber_counts_its_losses_exactly(node: Node) -> None:
    with running(peer("SlowReader")) as slow:
        assert slow.line() == "ready"
        publisher = node.new_pub("fast", "json")
        for number in range(3000):
            publisher.publish({"n": number})

        seen: list[str] = []

        def all_counted() -> bool:
            seen.append(slow.ask("counts"))
            received, lost = map(int, seen[-1].split())
            return received + lost == 3000 and lost > 0

        try:
            eventually(all_counted)
        except AssertionError:
            raise AssertionError(seen[-3:]) from None
        assert slow.end() == 0


def test_messages_of_unreachable_new_publishers_are_counted_as_lost(adapter: Adapter, master: Master) -> None:
    topics = (("t", False), ("*", True))
    subs = [
        adapter.ask("subscriber", topic=name, type="json", pattern=is_pattern)["sub"]
        for name, is_pattern in topics
    ]
    with socket.socket() as closed, attacker_at(master) as connection:
        closed.bind(("127.0.0.1", 0))
        publisher = UnreachablePublisher(connection, f"tcp://127.0.0.1:{closed.getsockname()[1]}")
        publisher.register()

        def is_lost(sub: int) -> bool:
            publisher.renew(100)  # its lease must not expire
            return bool(adapter.ask("counts", sub=sub)["lost"] == "100")

        for sub in subs:
            eventually(lambda sub=sub: is_lost(sub))
            assert adapter.ask("counts", sub=sub)["received"] == "0"


def test_rejected_payload_is_an_alert_in_the_graph_until_the_next_message(
    adapter: Adapter, node: Node
) -> None:
    def problems() -> list[str]:
        return [alert.sentence for alert in node.graph().alerts if "“blob”" in alert.sentence]

    pub = adapter.ask("publisher", topic="blob", type="bytes")["pub"]
    adapter.refused("publish", pub=pub, text="not bytes")
    eventually(lambda: bool(problems()))
    adapter.ask("publish", pub=pub, bytes="AAEC")
    eventually(lambda: not problems())


FAR_MASTER = """
    import select, sys, time
    real_ns = time.time_ns
    time.time_ns = lambda: real_ns() - 86_400 * 10**9
    from nep.system import computer
    computer.system_identifier = lambda: "another computer"
    import nep
    from nep.masters.master import Master
    with Master("127.0.0.1:0", learn_s=0.0) as master, nep.node("far", master=master.address) as node:
        pub = node.new_pub("far")
        print(master.address)
        while not select.select([sys.stdin], [], [], 0.05)[0]:
            pub.publish({})
"""


def test_latency_is_corrected_for_the_clock_of_another_computer() -> None:
    """The master and the publisher run with a clock that is a day late, as on another computer."""
    adapter_program = program("Adapter.exe", CSHARP / "conformance" / "Adapter.cs")
    with programs.running(FAR_MASTER) as far, running(adapter_program, NEP_MASTER=far.line()) as started:
        adapter = Adapter(started)
        adapter.ask("node", name="csharp")
        adapter.ask("subscriber", topic="far", type="json")
        while adapter.heard(1)[-1]["latency_uncertainty_s"] is None:
            assert adapter.events.pop()["latency_s"] == pytest.approx(86_400, abs=LONG_S)
        message = adapter.events[-1]
        assert 0 < message["latency_uncertainty_s"] < LONG_S
        assert -message["latency_uncertainty_s"] <= message["latency_s"] < LONG_S


def test_latency_within_one_computer_has_zero_uncertainty(adapter: Adapter, node: Node) -> None:
    adapter.ask("subscriber", topic="near", type="json")
    node.new_pub("near").publish({})
    (message,) = adapter.heard(1)
    assert message["latency_uncertainty_s"] == 0
    assert 0 <= message["latency_s"] < LONG_S


def test_services_are_called_in_both_directions(adapter: Adapter, node: Node) -> None:
    adapter.ask("serve", service="/echo")
    client = node.new_client("/echo", timeout_s=LONG_S)
    assert client.call({"a": [1, "grüß"]}) == {"a": [1, "grüß"]}
    assert client.call([1] * 100_000) == [1] * 100_000
    node.new_server("/double", lambda request: {"twice": 2 * request["n"]}, threads=1)
    asked = {"service": "/double", "timeout_s": LONG_S}
    assert adapter.ask("call", value={"n": 21}, **asked)["value"] == {"twice": 42}


def test_failed_calls_raise_the_matching_exception(adapter: Adapter, node: Node) -> None:
    def fail(request: object) -> object:
        raise ValueError("too hot")

    node.new_server("/fail", fail, threads=1)
    assert "too hot" in adapter.refused("call", service="/fail", value={}, timeout_s=LONG_S)
    assert "No server" in adapter.refused("call", service="/none", value={}, timeout_s=0.05)
    adapter.ask("serve", service="/gone")
    client = node.new_client("/gone", timeout_s=LONG_S)
    assert client.call({}) == {}
    adapter.ask("close")
    with pytest.raises(nep.NoServerError):
        node.new_client("/gone", timeout_s=0.05).call({})


def test_subscriber_with_wildcards_receives_all_matching_topics(adapter: Adapter, node: Node) -> None:
    early = node.new_pub("robots/one/state", "json")
    adapter.ask("subscriber", topic="robots/*/state", type="json", pattern=True)
    late = node.new_pub("robots/two/state", "json")
    other = node.new_pub("robots/two/camera", "json")
    for number, publisher in enumerate((early, other, late)):
        publisher.publish({"n": number})
    heard = {(each["topic"], each["value"]["n"]) for each in adapter.heard(2)}
    assert heard == {("robots/one/state", 0), ("robots/two/state", 2)}


def test_image_files_are_received_as_images(adapter: Adapter, node: Node) -> None:
    subscriber = node.new_sub("camera", "image")
    pub = adapter.ask("publisher", topic="camera", type="image")["pub"]
    adapter.ask("publish", pub=pub, bytes=base64.b64encode(PICTURE).decode())
    picture = listen(subscriber)
    assert picture.shape[:2] == (2, 3)
    assert "JPEG nor a PNG" in adapter.refused("publish", pub=pub, bytes="AAEC")


def test_public_calls_behave_as_documented(master: Master) -> None:
    with running(peer("Api")) as api:
        assert api.line() == "ok"
        assert api.end() == 0


@pytest.mark.skipif(
    not (ROOT / "nep" / "programs" / "conformance").exists(), reason="nep wire check is not there yet"
)
def test_client_passes_the_selected_conformance_rules() -> None:
    adapter = program("Adapter.exe", CSHARP / "conformance" / "Adapter.cs")
    chosen = [word for rule in RULES for word in ("--rule", rule)]  # all rules together take half a minute
    done = subprocess.run(
        [Path(sys.executable).parent / "nep", "wire", "check", *chosen, "--", "mono", adapter],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "NO_COLOR": "1"},
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_example_talker_and_listener_exchange_messages(master: Master) -> None:
    with running(example("Talker")) as talker, running(example("Listener")) as listener:
        assert listener.line().startswith("Press Enter")
        assert [listener.line().split(": ")[1].lstrip("-").isdigit() for _ in range(2)] == [True, True]
        listener.say("")
        while " received, " not in (last := listener.line()):
            pass
        assert last.endswith(" 0 lost")
        assert talker.end() == 0
