"""Tests of ``python -m app run FILE``: a behaviour without a window, on the virtual robot.

`tests/test_readme.py` runs an example to its end.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from nep.masters.master import Master
from tests.e2e.behaviours import forever, say, started, turn, write
from tests.e2e.programs import END_S, Program

pytestmark = pytest.mark.timeout(400)


@pytest.fixture
def pepper(master: Master) -> Iterator[Program]:
    with Program("-m", "app.robots.simulated", "--name", "Pepper") as program:
        yield program


def run(file: Path, *arguments: str) -> Program:
    return Program("-m", "app", "run", str(file), *arguments)


def test_ctrl_c_stops_the_program_and_the_robot(pepper: Program, tmp_path: Path) -> None:
    with run(write(tmp_path / "Turning.nepb", started(forever(turn(300)))), "--robot-wait", "60") as program:
        program.says("Pepper turns left by 300°")
        program.interrupt()
        assert program.wait(END_S) == 130, program.lines
        program.says("Pepper stopped (")
    with nep.node("listener") as node:
        states = node.new_sub("/Pepper/state", "json")
        heard = [states.receive(30.0).payload for _ in range(4)]
    assert not any(state["moving"] for state in heard)
    assert len({state["theta_deg"] for state in heard}) == 1


def test_missing_robot_is_reported_with_exit_code_3(master: Master, tmp_path: Path) -> None:
    with run(write(tmp_path / "Hello.nepb", started(say("Hello"))), "--robot-wait", "0.5") as program:
        assert program.wait(END_S) == 3, program.lines
        program.says("Not found: Pepper. Switch on the robots or start virtual ones.")


def test_invalid_behaviour_file_exits_with_code_2_without_traceback(master: Master, tmp_path: Path) -> None:
    (tmp_path / "x.nepb").write_text("{", encoding="utf-8")
    with run(tmp_path / "x.nepb") as program:
        assert program.wait(END_S) == 2, program.lines
        assert "Traceback" not in "\n".join(program.lines)
