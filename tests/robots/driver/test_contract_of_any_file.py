"""Tests that the contract can check a driver's file in any directory, and that it accepts correct drivers."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.robots.driver.test_process import ROOT

HEAD = '''
import asyncio
from dataclasses import dataclass
from enum import Enum
from app.robots.kit import Call, Failed, Kind, Link, action, main, safe_stop, sensor
import beside  # a module of the driver's own folder


class Room(Enum):
    HALL = "hall"


@dataclass
class Place:
    room: Room
    x: float = 0.0


class Robot:
    heat = sensor(float | None, title="heat")

    def __init__(self, link: Link) -> None:
        self.link = link

    @safe_stop(within_s=0.3)
    async def stop(self) -> None:
        """Still."""
'''
QUICK = '''
    @action("say %words", "Speech", "an-icon-of-its-own")
    def say(self, call: Call, words: str) -> int:
        """Needs a value that nothing suggests, ends at once, moves nothing."""
        return len(words)


ROBOT = Kind(model="quick", title="Quick", body=Robot)
'''
ASYNC = '''
    @action("go to %place", "Movement", "move", uses=("wheels",), timeout_s=9, risk="locomotes")
    async def go(self, call: Call, place: Place, by: list[Place] | None = None) -> Place:
        """Runs in the loop."""
        await asyncio.sleep(beside.LONG_S)
        return place

    @action("find %name", "Movement", "move")
    def find(self, call: Call, name: str) -> None:
        """Refuses what it does not know."""
        raise Failed("there is no such thing here")


AGENT = Kind(model="walker", title="Walker", body=Robot)
'''
DEAF = '''
    @action("go", "Movement", "move", uses=("wheels",), risk="locomotes", timeout_s=20)
    def go(self, call: Call) -> None:
        """Hears nothing of its end."""
        import time
        time.sleep(13)  # longer than the contract waits


ROBOT = Kind(model="deaf", title="Deaf", body=Robot)
'''


def contract(folder: Path, *drivers: str, only: str = "") -> subprocess.CompletedProcess[str]:
    (folder / "beside.py").write_text("LONG_S = 60\n", encoding="utf-8")
    chosen = []
    for number, driver in enumerate(drivers):
        path = folder / f"driver_{number}.py"
        path.write_text(HEAD + driver, encoding="utf-8")
        chosen += ["--driver", str(path)]
    command = [sys.executable, "-m", "pytest", "tests/robots/driver/test_contract.py", "-q", "-n0", "-p",
               "no:cacheprovider", "-k", only, *chosen]  # fmt: skip
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_correct_drivers_pass_the_contract_and_a_driver_that_ignores_stop_fails(tmp_path):
    stop_test = "test_stop_ends_running_and_queued_actions"
    done = contract(tmp_path, QUICK, ASYNC, DEAF, only=f"not deaf or {stop_test}")
    assert done.returncode == 1, done.stdout
    assert "pepper" not in done.stdout
    failed = [
        line.split(" - ")[0] for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))
    ]
    assert failed == [f"FAILED tests/robots/driver/test_contract.py::{stop_test}[deaf]"], done.stdout
    assert "1 failed, " in done.stdout
