"""Tests of a driver of 30 lines for nep 0.5.3.5: it is found, driven and stopped like any other robot."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.robots.client import rize
from tests.e2e.behaviours import block, number, say, started, write
from tests.e2e.programs import END_S, Program
from tests.e2e.studio import Studio
from tests.e2e.waiting import until
from tests.interop.conftest import CACHE, Peers, fixed_ports, peers, start_master
from tests.interop.conftest import Program as Peer

__all__ = ["fixed_ports", "peers"]
pytestmark = [pytest.mark.ports, pytest.mark.interop, pytest.mark.timeout(400)]
ROOT = Path(__file__).resolve().parents[2]
VERSION = "0.5.3.5"


@pytest.fixture
def driver(peers: Peers, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Peer]:
    """Example driver in a virtual environment of its own, and a master with its gateway."""
    monkeypatch.setenv("NEP_STATE_DIR", str(tmp_path / "state"))
    peers.start(VERSION, "subscriber", "warming/up").kill()  # installs the peer, or skips the test
    start_master(peers, address)
    python = CACHE / VERSION / "bin" / "python"
    driver = peers.run([str(python), str(ROOT / "examples" / "rize_driver.py"), "Turtle"])
    yield driver
    assert "Traceback" not in driver.printed, driver.printed


def turtle(tmp_path: Path) -> Path:
    """Behaviour file that speaks and walks once."""
    fields = {"ROBOT": "Turtle", "DIRECTION": "forwards"}
    walk = block("robot_rize_do_walk", fields=fields, METERS=number(0.5))
    first = started(say("Hello from blocks", walk, "Turtle", "rize"))
    return write(tmp_path / "Turtle.nepb", first, robots={"Turtle": dict(rize.robot("Turtle").source)})


def heard(driver: Peer) -> None:
    until(lambda: "Turtle says: Hello from blocks" in driver.printed, lambda: f"it says it: {driver.printed}")
    until(
        lambda: "Turtle walks forwards: {'meters': 0.5}" in driver.printed,
        lambda: f"it walks: {driver.printed}",
    )


def test_blocks_drive_the_robot_without_a_window(driver: Peer, tmp_path: Path) -> None:
    words = ("-m", "app", "run", str(turtle(tmp_path)), "--robot-wait", "60", "--allow-moving")
    with Program(*words) as program:
        assert program.wait(END_S) == 0, program.lines
        program.says("Turtle: Stop sent; this robot can't confirm")
    heard(driver)


def test_robot_is_found_in_the_window_and_driven_by_blocks(
    driver: Peer, start: Callable[..., Studio], tmp_path: Path
) -> None:
    studio = start(str(turtle(tmp_path)))
    studio.says("Turtle ready")
    studio.open_category("Speech")
    studio.screen.key("Escape")
    studio.click("Run", kind="RunButton")
    studio.click("Allow motion")  # not a virtual robot, and the program moves it
    heard(driver)
    studio.says("Turtle can't confirm")
