"""The driver in docs/robots.md is a driver."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

import nep
from app.robots.description import parse
from app.robots.driver import Driver
from tests.robots.conftest import Ears, eventually

DOCS = Path(__file__).resolve().parents[2] / "docs" / "robots.md"


@pytest.fixture
def rover(monkeypatch):
    (listing,) = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    module = ModuleType("rover")
    monkeypatch.setitem(sys.modules, "rover", module)
    exec(compile(listing, str(DOCS), "exec"), module.__dict__)
    return module.ROBOT


def test_the_listing_works(rover, node):
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
