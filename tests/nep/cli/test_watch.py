"""Tests of `nep watch`, which reports alarms in a terminal."""

from __future__ import annotations

import json
import signal
import sys
import threading

import pytest

import nep
from nep.cli import screen
from nep.cli.recordings.ring import KEEP_SERVICE, has_flight_recorder
from nep.masters.master import Master
from nep.programs.alarms.rule_file import EXAMPLE
from tests.nep.programs import eventually, running


@pytest.fixture
def file(tmp_path):
    """Function that writes alarms to a file and returns its path."""

    def write(*alarms: object) -> str:
        path = tmp_path / "alarms.json"
        path.write_text(json.dumps({"alarms": list(alarms)}), encoding="utf-8")
        return str(path)

    return write


BELOW = {"topic": "/distance", "value": "range", "is": "below", "than": 0.4}


class Talker:
    """Publisher that repeats a payload until it is closed."""

    def __init__(self, master: str, topic: str, payload: object) -> None:
        self._node = nep.node("talker", master=master)
        self._end = threading.Event()
        publisher = self._node.new_pub(topic, "json")

        def talk() -> None:
            while not self._end.wait(0.02):
                publisher.publish(payload)

        self._thread = threading.Thread(target=talk)
        self._thread.start()

    def __enter__(self) -> nep.Node:
        return self._node

    def __exit__(self, *_exc: object) -> None:
        self._end.set()
        self._thread.join()
        self._node.close()


def test_alarm_is_printed_and_calls_a_service(master, type_in, file) -> None:
    asked = []
    name = file({"id": "near", "when": BELOW, "do": ["banner", "sound", {"call": "brake", "with": {"n": 1}}]})
    with Talker(master.address, "/distance", {"range": 0.3}) as node:
        node.new_server("brake", lambda request: asked.append(request) or "ok", threads=1)
        done = type_in("watch", name, "-n", "1", "--master", master.address)
    assert done.returncode == 0
    lines = [line.split("  ", 1)[1] for line in done.stdout.splitlines()]
    assert lines == ["range of /distance is 0.3, below 0.4", "  brake replied"]
    assert asked == [{"n": 1}]
    assert "When range of /distance is below 0.4" in done.stderr
    assert "\a" not in done.stderr  # stderr is not a terminal


def test_alarms_are_printed_as_json_and_actions_only_studio_supports_are_reported(
    master, type_in, file
) -> None:
    name = file({"id": "near", "when": BELOW, "do": ["stop"]})
    with Talker(master.address, "/distance", {"range": 0.3}):
        done = type_in("watch", name, "-n", "1", "--master", master.address, "--json")
        plain = type_in("watch", name, "-n", "1", "--master", master.address)
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(each["event"], each["alarm"]) for each in records] == [("on", "near"), ("did", "near")]
    assert records[0]["seen"] == 0.3
    assert records[1]["what"] == "this action needs Studio: stop all robots"
    assert "need Studio and are skipped: stop all robots" in plain.stderr


def test_alarm_saves_the_last_seconds_through_a_flight_recorder_if_one_is_running(
    master, type_in, file
) -> None:
    asked = []

    def keep(request: object) -> object:
        asked.append(request)
        return {"path": "there/kept-1.mcap"}

    name = file({"id": "near", "when": BELOW, "do": [{"keep_s": 30}]})
    with Talker(master.address, "/distance", {"range": 0.3}) as node:
        with node.new_server(KEEP_SERVICE, keep, threads=1):
            done = type_in("watch", name, "-n", "1", "--master", master.address)
        eventually(lambda: not has_flight_recorder(node.graph()))
        refused = type_in("watch", name, "-n", "1", "--master", master.address, "--json")
    assert done.stdout.splitlines()[1].split("  ", 1)[1].strip() == "saved there/kept-1.mcap"
    assert asked == [{"seconds": 30, "note": "range of /distance is 0.3, below 0.4"}]
    assert "need Studio" not in done.stderr
    told = [json.loads(line)["what"] for line in refused.stdout.splitlines()]
    assert told[1] == "nothing saved: 'nep recording ring' isn't running"


@pytest.mark.usefixtures("patient")
def test_message_is_published_and_a_misspelt_topic_reported(master, type_in, file) -> None:
    name = file(
        {"when": BELOW, "do": [{"send": "/say", "message": {"say": "near"}}]},
        {"when": {"topic": "/distanse", "is": "silent"}},
    )
    with Talker(master.address, "/distance", {"range": 0.3}) as node, node.new_sub("/say", "json") as heard:
        done = type_in("watch", name, "-n", "1", "--master", master.address)
        assert heard.listen(timeout_s=30.0) == (True, {"say": "near"})
    assert "'/distanse' doesn't exist yet; did you mean '/distance'?" in done.stderr
    assert "sent to /say" in done.stdout


def describe(robot: nep.Node, command: str) -> list[object]:
    """Publish a robot's description with a command topic; return the list that receives its messages."""
    description = {"title": "Rover", "rb:topics": {"command": command}}
    robot.new_pub("/Rover/description", "robot/description", latched=True).publish(description)
    told: list[object] = []
    robot.new_sub(command, sink=lambda messages: told.extend(each.payload for each in messages))
    return told


def test_alarm_moves_no_robot_that_was_not_allowed(master, type_in, file, monkeypatch) -> None:
    monkeypatch.setattr("nep.cli.programs.watch._ROBOT_DISCOVERY_S", 60.0)
    name = file({"when": BELOW, "do": [{"send": "/orders", "message": {"op": "invoke"}}]})
    words = ("watch", name, "-n", "1", "--master", master.address)
    with nep.node("rover", master=master.address) as robot, Talker(master.address, "/distance", {"range": 0}):
        told = describe(robot, "/orders")
        refused = type_in(*words)
        assert refused.returncode == 2
        said = " ".join(refused.stderr.replace("│", " ").split())
        assert "'/orders' moves Rover; make sure that nobody is in the way" in said
        assert "add --allow-moving Rover" in said
        assert told == []
        assert type_in(*words, "--allow-moving", "Rover").returncode == 0
        eventually(lambda: told == [{"op": "invoke"}])


def test_alarm_does_not_move_a_robot_that_connected_later(master, type_in, file) -> None:
    name = file({"when": BELOW, "do": [{"send": "/orders", "message": {"op": "invoke"}}]})
    told: list[list[object]] = []

    def come(robot: nep.Node) -> None:
        near = robot.new_pub("/distance")
        eventually(lambda: near.subscribers > 0)
        told.append(describe(robot, "/orders"))
        near.publish({"range": 0})

    with nep.node("rover", master=master.address) as robot:
        thread = threading.Thread(target=come, args=(robot,))
        thread.start()
        done = type_in("watch", name, "-n", "1", "--master", master.address)
        thread.join()
    assert "not sent: '/orders' moves Rover; make sure that nobody is in the way" in done.stdout
    assert "add --allow-moving Rover" in done.stdout
    assert told == [[]]


def test_watch_command_waits_for_a_master_that_starts_later(type_in, file, monkeypatch) -> None:
    with Master("127.0.0.1:0") as first:
        address = first.address
    name = file({"when": {"node": "lidar", "is": "comes"}}, {"when": BELOW})
    waits, ended = threading.Event(), threading.Event()

    def say(sentence: str) -> None:
        screen.print_status(sentence)
        if sentence.endswith("; waiting"):
            waits.set()

    monkeypatch.setattr("nep.cli.programs.watch.print_status", say)

    def come_later() -> None:
        if waits.wait(30):
            with Master(address) as late, Talker(late.address, "/distance", {"range": 0.3}):
                ended.wait(30)

    thread = threading.Thread(target=come_later)
    thread.start()
    try:
        done = type_in("watch", name, "-n", "1", "--master", address)
    finally:
        waits.set()
        ended.set()
        thread.join()
    assert "; waiting" in done.stderr
    assert "connected to the master" in done.stderr
    assert "range of /distance is 0.3" in done.stdout


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ((), 1, "specify an alarm file"),
        (("none.json",), 1, "'none.json' can't be read"),
        (("FILE", "--check"), 0, "the file is valid"),
        (("OFF",), 1, "are switched off"),
        (("BAD",), 1, "line 1 of"),
    ],
)
def test_alarm_file_is_validated_before_connecting(type_in, file, words, code: int, said: str) -> None:
    made = {
        "FILE": lambda: file({"when": BELOW}),
        "OFF": lambda: file({"on": False, "when": BELOW}),
        "BAD": lambda: file({"when": {"topic": "/t", "is": "sielnt"}}),
    }
    done = type_in("watch", *(made[word]() if word in made else word for word in words))
    assert done.returncode == code
    assert said in done.stderr


def test_example_alarm_file_is_printed(type_in) -> None:
    assert type_in("watch", "--example").stdout == EXAMPLE


@pytest.mark.skipif(sys.platform == "win32", reason="a program of Windows cannot be sent Ctrl+C alone")
def test_ctrl_c_ends_the_command_quietly(master, file) -> None:
    begin = "import sys\nfrom nep.cli import main\nsys.argv[1:1] = ['watch']\nmain()"
    with nep.node("talker") as node:
        publisher = node.new_pub("/distance", "json")
        with running(begin, file({"when": BELOW}), NEP_MASTER=master.address) as program:
            eventually(lambda: publisher.subscribers == 1)
            program.signal(signal.SIGINT)
            _out, said = program.end()
            assert program.process.returncode == 130, said
            assert "Traceback" not in said
        eventually(lambda: publisher.subscribers == 0)
