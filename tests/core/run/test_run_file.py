"""Tests of ``python -m app run FILE`` with a robot on a real network and with a virtual robot process."""

from __future__ import annotations

import errno
import io
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

import nep
from app import resources
from app.robots import simulated, turtle
from app.robots.description.description import thing_description
from app.robots.driver.driver import Driver
from app.run import FAILED, INTERRUPTED, MAY_NOT_MOVE, OK, ROBOT_MISSING, UNUSABLE, run_file
from nep.masters.master import Master
from tests.blocks.fakes import until
from tests.blocks.samples import block, number, robot, say, started, text, workspace, write
from tests.blocks.wire_robot import RizeRobot, WireRobot, usual_time_limits

pytestmark = pytest.mark.usefixtures("patient", "patient_robots")
LONG_S = 120.0  # of processes; matters only if something is broken


@pytest.fixture
def pepper(master):
    made = WireRobot(master.address)
    yield made
    made.close()


@pytest.fixture
def saved(tmp_path):
    def write_file(content, name="Test"):
        path = tmp_path / "test.nepb"
        robots = {"Pepper": dict(robot().source)}
        path.write_text(
            json.dumps(
                {
                    "format": "nep-behaviour",
                    "version": 1,
                    "name": name,
                    "workspace": content,
                    "robots": robots,
                }
            )
        )
        return path

    return write_file


REAL = replace(turtle.ROBOT, virtual=False)


def run(path, **more) -> tuple[int, str]:
    out = io.StringIO()
    return run_file(path, out=out, **more), out.getvalue()


def test_file_runs_to_end_and_robot_is_stopped(pepper, saved):
    code, out = run(saved(workspace(started(say("Hi"), write(text("done"))))))
    assert code == OK
    assert "Running “Test”" in out
    assert "done" in out.splitlines()
    assert "Pepper stopped (" in out
    told = [command["op"] for command in pepper.commands]
    assert [op for op in told if op != "alive"][-1] == "stop"  # a heartbeat may arrive in between


def test_failing_block_is_reported(pepper, saved):
    pepper.refuses = {"say": "no voice"}
    code, out = run(saved(workspace(started(say("Hi")))))
    assert code == FAILED
    assert "Pepper: no voice." in out
    assert "Pepper stopped (" in out


def test_interrupt_stops_the_run_with_a_confirmed_stop(pepper, saved):
    pepper.slow = {"say"}
    interrupted = threading.Event()
    found: list[tuple[int, str]] = []
    path = saved(workspace(started(say("Hi"))))
    thread = threading.Thread(target=lambda: found.append(run(path, interrupted=interrupted)))
    thread.start()
    until(lambda: bool(pepper.heard("invoke")))
    interrupted.set()
    thread.join(LONG_S)
    assert found[0][0] == INTERRUPTED
    assert "Pepper stopped (" in found[0][1]


@pytest.mark.skipif(os.name != "posix", reason="sends signals")
@pytest.mark.parametrize("how", ["a file of Studio", "a program file"])
def test_second_ctrl_c_does_not_interrupt_the_stop(pepper, saved, master, tmp_path, how):
    """The second Ctrl+C arrives while the run waits for the replies of the robots."""
    pepper.silent, pepper.slow = {"stop"}, {"say"}
    path = saved(workspace(started(say("Hi"))))
    command = [sys.executable, "-m", "app", "run", str(path)]
    if how == "a program file":
        path = tmp_path / "greeting.py"
        path.write_text(SAYS, encoding="utf-8")
        command = [sys.executable, str(path)]
    root = str(Path(__file__).resolve().parents[3])
    environ = {**os.environ, "PYTHONPATH": root, "NEP_MASTER": master.address}
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environ, text=True
    )
    until(lambda: bool(pepper.heard("invoke")))
    process.send_signal(signal.SIGINT)
    until(lambda: bool(pepper.heard("stop")))
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=LONG_S)
    assert "Pepper didn't reply. Switch it off by hand." in out
    assert "Traceback" not in out
    assert process.returncode == (FAILED if how == "a file of Studio" else 0)


def test_robot_that_does_not_reply_to_stop_is_named(pepper, saved):
    pepper.silent = {"stop"}
    with usual_time_limits():
        code, out = run(saved(workspace(started(say("Hi")))))
    assert code == FAILED
    assert "Pepper didn't reply. Switch it off by hand." in out


def test_missing_robot_is_reported(master, saved):
    code, out = run(saved(workspace(started(say("Hi")))), robot_wait_s=0.2)
    assert code == ROBOT_MISSING
    assert "Not found: Pepper." in out


def test_missing_robot_without_a_description_in_the_file_is_reported(master, saved):
    path = saved(workspace(started(say("Hi"))))
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"robots": {}}))
    code, out = run(path, robot_wait_s=0.2)
    assert code == ROBOT_MISSING
    assert "Not found: Pepper" in out


def test_file_that_cannot_be_run_and_missing_master_are_reported_as_unusable(master, saved, tmp_path):
    code, out = run(saved(workspace(started(block("control_wait")))))
    assert (code, "error: wait needs a number." in out) == (UNUSABLE, True)
    assert run(saved(workspace()))[0] == UNUSABLE
    assert run(tmp_path / "missing.nepb")[0] == UNUSABLE
    (tmp_path / "x.nepb").write_text("{")
    assert run(tmp_path / "x.nepb")[0] == UNUSABLE
    code, out = run(saved(workspace(started(say("Hi")))), master="127.0.0.1:1")
    assert (code, "no master" in out) == (UNUSABLE, True)
    assert run(saved(workspace(started(write(number(1))))), master="127.0.0.1:1")[0] == OK  # needs no robot


def test_rize_robot_receives_its_action_and_cannot_confirm_stop(master, tmp_path):
    rosie = RizeRobot(master.address)
    try:
        hello = block("robot_rize_do_say", ROBOT="Rosie", TEXT=text("hello"))
        robots = {"Rosie": dict(rosie.described.source)}
        content = {"format": "nep-behaviour", "version": 1, "name": "RIZE", "robots": robots}
        path = tmp_path / "rize.nepb"
        path.write_text(json.dumps(content | {"workspace": workspace(started(hello))}))
        code, out = run(path)
        assert code == OK, out
        assert "Rosie: Stop sent; this robot can't confirm" in out
        first = rosie.commands[0]
        assert (first["robots"], first["primitives"]["primitive"], first["primitives"]["input"]) == (
            "Rosie", "say", "hello",
        )  # fmt: skip
    finally:
        rosie.close()


def test_real_robot_moves_only_with_permission(master, tmp_path):
    rosie = RizeRobot(master.address)
    try:
        walk = block("robot_rize_do_walk", ROBOT="Rosie", DIRECTION="forwards", METERS=number(0.5))
        robots = {"Rosie": dict(rosie.described.source)}
        content = {"format": "nep-behaviour", "version": 1, "name": "RIZE", "robots": robots}
        path = tmp_path / "rize.nepb"
        path.write_text(json.dumps(content | {"workspace": workspace(started(walk))}))
        code, out = run(path)
        assert code == MAY_NOT_MOVE, out
        assert "Rosie would move (“walk”). To allow this, add --allow-moving." in out
        assert rosie.commands == []
        code, out = run(path, allow_moving=True)
        assert code == OK, out
        assert rosie.commands[0]["primitives"]["primitive"] == "walk"
    finally:
        rosie.close()


def test_publishing_on_a_robot_topic_needs_permission(master, tmp_path):
    with nep.node("rover", master=master.address) as node, Driver(REAL, "Rover", node):
        publish = block("messages_publish", TOPIC="/Rover/command", VALUE=text("drive"))
        content = {"format": "nep-behaviour", "version": 1, "name": "Sly", "robots": {}}
        path = tmp_path / "sly.nepb"
        path.write_text(json.dumps(content | {"workspace": workspace(started(publish))}))
        code, out = run(path)
        assert code == MAY_NOT_MOVE, out
        assert "Rover would move (" in out
        code, out = run(path, allow_moving=True)
        assert code == OK, out
        assert "Rover stopped (" in out


def test_virtual_robot_starts_at_its_start_position_or_keeps_its_current_one(master, tmp_path):
    light = block("robot_diffdrive_do_light", ROBOT="Turtle", COLOUR="#ff0000")
    described = thing_description(turtle.ROBOT.thing_model, "Turtle")
    content = {"format": "nep-behaviour", "version": 1, "name": "Light", "robots": {"Turtle": described}}
    path = tmp_path / "light.nepb"
    path.write_text(json.dumps(content | {"workspace": workspace(started(light))}))
    with nep.node("turtle", master=master.address) as node, Driver(turtle.ROBOT, "Turtle", node):
        state, world = node.new_sub("/Turtle/state", "json"), node.new_pub("/Turtle/world", "json")

        def x() -> float:
            return state.receive(30.0).payload["x"]

        first = x()
        until(lambda: world.publish({"move": "robot", "x": 1.0, "y": 1.0}) or x() == 1.0)
        assert run(path, keep_position=True)[0] == OK
        assert x() == 1.0
        assert run(path)[0] == OK
        until(lambda: x() == first)


def test_second_program_with_robot_name_is_reported_and_receives_no_commands(master, pepper, saved):
    with nep.node("evil", master=master.address) as evil:
        described = dict(robot().source)
        announcement = evil.new_pub("/Pepper/description", "robot/description", latched=True)
        announcement.publish(described | {"rb:topics": {"command": "/Evil/command"}})
        code, out = run(saved(workspace(started(say("Hi")))))
    assert code == OK, out
    assert "warning: 2 programs announce themselves as Pepper" in out
    assert [command["action"] for command in pepper.heard("invoke")] == ["say"]


SAID = {
    "Tour guide": ["Thank you for coming."],
    "The finder": ["Hello! Did you lose a ball?"],
    "Reaction to touch": ["Touch my head or my hands.", "Ha ha! That tickles."],
    "A quiz": ["Is the sky blue?", "Is ice cold?", "Right answers: "],
    "A dance": ["Let's dance.", "Thank you."],
    "A careful walk": ["I keep walking while the way is clear."],
    "Weather station": ["I am a weather station.", "It is cold, ", "It is warm, "],
}
"""Words that the robot speaks in each example. The greeting is run by tests/test_readme.py."""
ENDLESS = set(SAID) - {"Tour guide", "The finder"}
"""Examples that don't end by themselves; they are interrupted after their last words."""
STROKED = {"Reaction to touch", "A quiz"}


@contextmanager
def virtual_pepper() -> Iterator[str]:
    """Address of the master of a virtual robot that runs on threads of this process.

    tests/test_readme.py and tests/robots/virtual run it as a process.
    """
    with (
        Master("127.0.0.1:0", learn_s=0.0) as master,
        nep.node("pepper", master=master.address) as node,
        Driver(simulated.ROBOT, "Pepper", node),
    ):
        yield master.address


def example_runs(name: str) -> tuple[int, str]:
    """Run an example with the touches and the weather that it waits for; return its exit code and output."""
    (path,) = [
        each
        for each in resources.path("examples").glob("*.nepb")
        if json.loads(each.read_text("utf-8"))["name"] == name
    ]
    out, interrupted = io.StringIO(), threading.Event()
    with virtual_pepper() as address, ThreadPoolExecutor(1) as pool:
        code = pool.submit(
            run_file,
            path,
            master=address,
            out=out,
            robot_wait_s=100,
            interrupted=interrupted,
            allow_moving=True,
        )
        with nep.node("somebody", master=address) as node:
            hand, weather = node.new_pub("/Pepper/world", "json"), node.new_pub("/weather", "json")
            pause = threading.Event()
            for turn in range(2000):
                all_said = all(f"Pepper says “{words}" in out.getvalue() for words in SAID[name])
                if code.done() or (name in ENDLESS and all_said):
                    break
                if name in STROKED:
                    hand.publish({"touch": "head", "down": turn % 2 == 0})
                weather.publish({"temperature": 5 if turn % 40 < 20 else 25})
                pause.wait(0.1)
            interrupted.set()
        return code.result(60), out.getvalue()


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_examples_run_on_the_virtual_robot():
    """The examples run concurrently because most of their time is waiting for a robot."""
    with ThreadPoolExecutor(len(SAID)) as pool:
        ended = dict(zip(SAID, pool.map(example_runs, SAID), strict=True))
    for name, (code, out) in ended.items():
        assert code in ({OK, INTERRUPTED} if name in ENDLESS else {OK}), (name, out)
        for words in SAID[name]:
            assert f"Pepper says “{words}" in out, (name, out)
        assert "Pepper stopped (" in out, (name, out)


@pytest.mark.timeout(240)
def test_generated_program_runs_as_a_python_file(master, pepper, tmp_path):
    from app.blocks.compiler.compiler import compile_behaviour

    saved = workspace(started(say("Hi"), write(text("done"))))
    path = tmp_path / "program.py"
    path.write_text(compile_behaviour(saved, [robot()], name="Test").source, "utf-8")
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd())}
    done = subprocess.run(
        [sys.executable, path], env=environment, capture_output=True, text=True, timeout=LONG_S, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "done\n", "")
    assert [command["action"] for command in pepper.heard("invoke")] == ["say"]
    told = [command["op"] for command in pepper.commands]
    assert [op for op in told if op != "alive"][-1] == "stop"  # a heartbeat may arrive in between


class Lost(io.StringIO):
    """Output stream that raises `OSError` after ``lines`` lines."""

    def __init__(self, number: int, lines: int) -> None:
        super().__init__()
        self._number, self._lines = number, lines

    def write(self, text: str) -> int:
        if self.getvalue().count("\n") >= self._lines:
            raise OSError(self._number, os.strerror(self._number))
        return super().write(text)


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (errno.EPIPE, ""),
        (errno.ENOSPC, "the output can't be written: no space left on device; the behaviour was stopped.\n"),
    ],
)
def test_unwritable_output_stops_the_behaviour_and_its_robot(pepper, saved, capsys, number, said):
    path = saved(workspace(started(say("Hi"), write(text("one")), write(text("two")), say("never"))))
    assert run_file(path, out=Lost(number, 1)) == FAILED
    assert capsys.readouterr().err == said
    told = [command["op"] for command in pepper.commands]
    assert [op for op in told if op != "alive"][-1] == "stop"  # a heartbeat may arrive in between
    assert "never" not in [each.get("input") for each in pepper.commands]


def test_control_characters_in_output_are_escaped(pepper, saved):
    code, out = run(saved(workspace(started(write(text("a\x1b[2Jb"))))))
    assert code == OK
    assert "a\\x1b[2Jb" in out.splitlines()


@pytest.mark.parametrize("page", ["cp437", "ascii"])
def test_characters_missing_in_the_output_encoding_are_replaced(master, saved, page):
    path = saved(workspace(started(write(text("\u2013 “😀”")))))
    done = subprocess.run(
        [sys.executable, "-m", "app", "run", str(path)],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": page, "PYTHONUTF8": "0"},
        timeout=LONG_S,
        check=False,
    )
    assert (done.returncode, done.stderr) == (OK, b"")
    assert b'- "?"' in done.stdout
    assert b'Running "Test"' in done.stdout


def test_unknown_master_host_is_reported(saved):
    code, out = run(saved(workspace(started(say("Hi")))), master="nosuchhost.invalid:7781")
    assert code == UNUSABLE
    assert out.startswith("unknown computer 'nosuchhost.invalid'; ")


PROGRAM = """
from app.blocks.commands import on_start, run, write

@on_start
def greet():
    write("\u2013 “😀”")

run("greeting")
"""


SAYS = """
from app.blocks.commands import on_start, robot, run

@on_start
def greet():
    robot("Pepper").do("say", text="Hi")

run("greeting")
"""


def test_character_missing_in_ascii_output_of_a_program_file_is_replaced(master, tmp_path):
    file = tmp_path / "greeting.py"
    file.write_text(PROGRAM, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(file)],
        capture_output=True,
        env={
            **os.environ,
            "PYTHONPATH": str(Path(__file__).resolve().parents[3]),
            "PYTHONIOENCODING": "ascii",
            "PYTHONUTF8": "0",
        },
        timeout=LONG_S,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.splitlines() == [b'- "?"']
