"""Tests of the drivers listed in docs/robots.md and docs/write-a-driver.md."""

from __future__ import annotations

import re
import signal
import sys
from pathlib import Path
from types import ModuleType

import pytest

import nep
from app.robots.description.description import parse
from app.robots.driver.driver import Driver
from tests.robots.conftest import Ears, eventually
from tests.robots.driver.test_process import LONG_S, ended, network, start

__all__ = ["network"]

ROOT = Path(__file__).resolve().parents[3]
EXAMPLE = ROOT / "examples" / "thirty_line_driver.py"
DOCS = Path(__file__).resolve().parents[3] / "docs" / "robots.md"


@pytest.fixture
def rover(monkeypatch):
    (listing,) = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    module = ModuleType("rover")
    monkeypatch.setitem(sys.modules, "rover", module)
    exec(compile(listing, str(DOCS), "exec"), module.__dict__)
    return module.ROBOT


def test_documented_driver_executes_actions_and_stops(rover, node):
    assert parse(dict(rover.thing_model)).action("drive").text == "%robot drive %distance m"
    with nep.node("listener", "memory") as other:
        ears = Ears(other, "Fido")
        with Driver(rover, "Fido", node):
            ears.invoke("1", "drive", distance=0.05)
            assert ears.final("1")["state"] == "succeeded"
            ears.invoke("2", "say", text="x" * 200)
            eventually(lambda: "running" in ears.states("2"))
            ears.command(id="s", op="stop")
            assert ears.final("s", "stop")["state"] == "succeeded"
            assert ears.final("2")["state"] == "canceled"


def test_how_to_guide_contains_the_example_of_at_most_thirty_lines():
    page = (ROOT / "docs" / "write-a-driver.md").read_text(encoding="utf-8")
    (listing,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert listing == EXAMPLE.read_text(encoding="utf-8")
    assert len([line for line in listing.splitlines() if line.strip()]) <= 30


def test_example_driver_runs_as_a_separate_process(network):
    process = start(str(EXAMPLE), "--name", "Table", network=network)
    try:
        with nep.node("me", master=network) as node:
            message = node.new_sub("/Table/description", "robot/description").receive(LONG_S)
            assert message is not None
            table = parse(message.payload)
            assert [action.name for action in table.actions] == ["turn", "blink", "stop"]
            assert table.action("turn").parameter("angle").kind == "angle"
            ears = Ears(node, "Table")
            angles = ears.listen("angle")
            ears.invoke("1", "turn", angle=5)
            assert ears.final("1")["state"] == "succeeded"
            eventually(lambda: {"value": 5.0} in angles)
            ears.invoke("2", "turn", angle=-360)
            eventually(lambda: "running" in ears.states("2"))
            ears.command(id="s", op="stop")
            assert ears.final("s", "stop")["state"] == "succeeded"
            assert ears.final("2")["state"] == "canceled"
            process.send_signal(signal.SIGTERM)
    finally:
        code, errors = ended(process)
    assert (code, errors) == (0, "")
