"""Tests of drivers as processes: their life cycle, output and options, and a RIZE driver over the network."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

import nep
from app.robots import simulated
from app.robots.description.description import parse
from app.robots.driver.process import run
from tests.robots.conftest import Ears, eventually

ROOT = Path(__file__).resolve().parents[3]
LONG_S = 60.0  # of a process on a busy computer; matters only if something is broken
SLEEPER = "import sys; sys.stdin.read()"


@pytest.fixture
def network() -> Iterator[str]:
    with nep.Master("127.0.0.1:0") as master:
        yield master.address


def start(*arguments: str, network: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "NEP_MASTER": network, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, *arguments], cwd=ROOT, env=environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def ended(process: subprocess.Popen[str], timeout_s: float = LONG_S) -> tuple[int, str]:
    """Return the exit code and the error output of a process; kill it if it has not exited by the timeout."""
    try:
        _, errors = process.communicate(timeout=timeout_s)
    finally:
        process.kill()
        process.wait()
    return process.returncode, errors


@pytest.fixture
def observer(network: str) -> Iterator[nep.Node]:
    with nep.node("observer", master=network) as node:
        yield node


def has_robot(observer: nep.Node) -> bool:
    return any(topic.msg_type == "robot/description" for topic in observer.graph().topics.values())


def test_virtual_robot_process_runs_until_terminated(network, observer):
    process = start("-m", "app.robots.simulated", "--name", "Miss Pepper", "--seed", "3", network=network)
    try:
        with nep.node("me", master=network) as node:
            message = node.new_sub("/Miss_Pepper/description", "robot/description").receive(LONG_S)
            assert message is not None
            assert parse(message.payload).name == "Miss Pepper"
            picture = node.new_sub("/Miss_Pepper/camera", "image").receive(LONG_S)
            assert picture is not None
            assert picture.codec == "image"
            ears = Ears(node, "Miss_Pepper")
            ears.invoke("1", "turn", angle=360, speed=20)
            eventually(lambda: "running" in ears.states("1"))
            process.send_signal(signal.SIGTERM)
            assert ears.final("1")["state"] == "canceled"
    finally:
        code, errors = ended(process)
    assert (code, errors) == (0, "")
    eventually(lambda: not has_robot(observer))


def test_driver_process_exits_with_its_owner(network, observer):
    owner = subprocess.Popen([sys.executable, "-c", SLEEPER], stdin=subprocess.PIPE)
    robot = start("-m", "app.robots.simulated", "--owner-pid", str(owner.pid), network=network)
    try:
        eventually(lambda: has_robot(observer))
        assert robot.poll() is None
        owner.kill()
        owner.wait()
        assert robot.stdout is not None
        said = robot.stdout.read()
        code, errors = ended(robot)
    finally:
        owner.kill()
        owner.communicate()
        ended(robot)
    assert (code, errors, said) == (0, "", ""), "what it prints is taken for why it ended"
    eventually(lambda: not has_robot(observer))


def test_driver_does_not_start_without_its_owner(network, observer):
    gone = max(psutil.pids()) + 100_000
    run(simulated.ROBOT, "Pepper", threading.Event(), master=network, owner_pid=gone)
    assert not has_robot(observer)


def test_driver_prints_its_name_and_when_the_master_is_missing_and_found():
    with nep.Master("127.0.0.1:0") as gone:
        address = gone.address
    process = start("examples/thirty_line_driver.py", "--name", "Table", network=address)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "Table: robot, model turntable; topics: /Table/...\n"
        assert process.stdout.readline() == (
            f"Table: no master at {address}; waiting for one. Start Studio or `nep master`\n"
        )
        with nep.Master(address), nep.node("observer", master=address) as observer:
            said = process.stdout.readline()
            assert said.startswith(f"Table: found the master at {address}; the robot is ready")
            assert has_robot(observer)
            process.send_signal(signal.SIGTERM)
            code, errors = ended(process)
    finally:
        ended(process)
    assert (code, errors) == (0, "")


def test_driver_can_be_terminated_while_waiting_for_a_master():
    process = start("-m", "app.robots.simulated", network="127.0.0.1:1")
    assert process.stdout is not None
    try:
        said = [process.stdout.readline() for _ in range(2)]
        assert "waiting for one" in said[1]
        process.send_signal(signal.SIGTERM)
    finally:
        code, errors = ended(process)
    assert (code, errors) == (0, "")


@pytest.mark.parametrize(
    "given",
    [("--name", "x" * 65), pytest.param(("--master", "127.0.0.1:x"), marks=pytest.mark.long)],
    ids=["name", "master"],
)
def test_invalid_driver_options_print_one_line_without_traceback(given, network):
    code, errors = ended(start("examples/thirty_line_driver.py", *given, network=network))
    assert code == 1
    assert "Traceback" not in errors
    assert errors.count("\n") == 1


def test_unknown_driver_argument_is_reported(capsys):
    with pytest.raises(SystemExit) as exited:
        simulated.main(["--color", "red"])
    assert exited.value.code == 2
    assert "--color" in capsys.readouterr().err


CHATTERBOX = """
import logging
from app.robots.kit import Call, Kind, Link, action, main, safe_stop

class Chatterbox:
    def __init__(self, link: Link) -> None:
        pass

    @action("chatter", "Speech", "message-circle")
    def chatter(self, call: Call) -> None:
        for n in range(500):
            logging.getLogger("chatter").warning("%d %s", n, "x" * 1000)

    @safe_stop(watchdog_s=1.0, within_s=0.2)
    def stop(self) -> None:
        logging.getLogger("chatter").warning("stopped")

if __name__ == "__main__":
    raise SystemExit(main(Kind(model="box", title="Chatterbox", body=Chatterbox)))
"""


def test_driver_with_a_full_output_pipe_replies_and_exits(network, tmp_path):
    """The pipe holds 64 kB and is not read; a terminal paused with Ctrl+S holds less."""
    (tmp_path / "box.py").write_text(CHATTERBOX, encoding="utf-8")
    process = start(str(tmp_path / "box.py"), network=network)
    try:
        with nep.node("me", master=network) as node:
            assert node.new_sub("/Chatterbox/description", "robot/description").receive(LONG_S) is not None
            ears = Ears(node, "Chatterbox")
            for number in ("1", "2"):
                ears.invoke(number, "chatter")
                assert ears.final(number)["state"] == "succeeded"
            process.send_signal(signal.SIGTERM)
            assert process.wait(60.0) == 0
    finally:
        ended(process)


HONEST = '''
import asyncio, enum, sys
from typing import Literal, Optional
from app.robots.kit import Call, Kind, Link, action, main, safe_stop, sensor

class Room(enum.Enum):
    HALL = "hall"

class Robot:
    heat = sensor(float, title="heat")

    def __init__(self, link: Link) -> None:
        self.link = link

    @safe_stop(within_s=0.2)
    def stop(self) -> None:
        """Still."""
'''
DO = '    @action("do %given", "Movement", "move", timeout_s=9)\n'
MAIN = (
    'if __name__ == "__main__":\n    raise SystemExit(main(Kind(model="robot", title="Robot", body=Robot)))\n'
)
FUNCTIONS = {
    "later": (
        "async def later(self, call: Call, given: int) -> int",
        "await asyncio.sleep(0); return given + 1",
    ),
    "ends": ("def ends(self, call: Call, given: int) -> None", "sys.exit(given)"),
    "numbers": ("def numbers(self, call: Call, given: list[float]) -> None", "pass"),
    "senses": ("def senses(self, call: Call, given: str) -> None", 'self.link.sense("heat", given)'),
    "returns": ("def returns(self, call: Call, given: str) -> int", "return given"),
    "pair": ("def pair(self, call: Call, given: tuple[float, int]) -> str", "return repr(given)"),
    "map": ("def map(self, call: Call, given: dict[str, int]) -> str", "return repr(given)"),
    "perhaps": ("def perhaps(self, call: Call, given: Optional[int] = 1) -> str", "return repr(given)"),
    "choice": ("def choice(self, call: Call, given: Literal[1, 2]) -> str", "return repr(given)"),
    "room": ("def room(self, call: Call, given: Room) -> Room", "assert given is Room.HALL; return given"),
}


GIVEN = {
    "later": 6, "ends": 3, "numbers": ["a"], "senses": "warm", "returns": "x",
    "pair": [1.5, 2], "map": {"a": 1}, "perhaps": None, "choice": 2, "room": "hall",
}  # fmt: skip
FINAL_REPLIES = {
    "later": ("succeeded", 7),
    **dict.fromkeys(("ends", "numbers", "senses", "returns"), ("failed", None)),
    "pair": ("succeeded", "(1.5, 2)"),
    "map": ("succeeded", "{'a': 1}"),
    "perhaps": ("succeeded", "None"),
    "choice": ("succeeded", "2"),
    "room": ("succeeded", "hall"),
}


def test_typed_actions_return_their_results_or_fail_and_stop_still_succeeds(network, tmp_path):
    """The actions are called over the network; a Stop afterwards must be answered in any case."""
    actions = "".join(
        f'{DO}    {head}:\n        """What the test says."""\n        {body}\n'
        for head, body in FUNCTIONS.values()
    )
    (tmp_path / "robot.py").write_text(HONEST + actions + MAIN, encoding="utf-8")
    process = start(str(tmp_path / "robot.py"), network=network)
    try:
        with nep.node("me", master=network) as node:
            described = node.new_sub("/Robot/description", "robot/description").receive(LONG_S)
            assert described is not None, ended(process, 0.1)
            ears = Ears(node, "Robot")
            got = {}
            for name, value in GIVEN.items():
                ears.invoke(name, name, given=value)
                final = ears.final(name)
                got[name] = (final["state"], final["output"].get("value"))
            ears.command(id="stop", op="stop")
            assert (got, ears.final("stop", "stop")["state"]) == (FINAL_REPLIES, "succeeded")
    finally:
        process.kill()
        process.communicate()
