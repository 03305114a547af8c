"""Tests of docs/blackboard.md: its programs print the documented output, and the methods it names exist."""

from __future__ import annotations

import re

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import ROOT, running

_GUIDE = (ROOT / "docs" / "blackboard.md").read_text(encoding="utf-8")
_SAID = re.compile(r"It prints `([^`]+)`")


def _programs() -> dict[str, tuple[str, list[str]]]:
    """Return the program and the expected output lines of each section, by its heading."""
    found = {}
    for section in _GUIDE.split("\n## ")[1:]:
        before, fence, after = section.partition("```python\n")
        if fence:
            program, _fence, text = after.partition("\n```\n\n")
            said = _SAID.match(text)
            lines = [said[1]] if said else [line.strip() for line in text.split("\n\n")[1].splitlines()]
            found[before.partition("\n")[0]] = (program, lines)
    return found


@pytest.mark.parametrize("head", sorted(_programs()))
def test_guide_program_prints_the_documented_output(master: Master, head: str) -> None:
    program, said = _programs()[head]
    with running(program, NEP_MASTER=master.address) as example:
        printed, errors = example.end()
    assert errors == ""
    assert printed.splitlines() == said


def test_every_guide_program_is_tested() -> None:
    assert len(_programs()) == _GUIDE.count("```python") == 4


def test_methods_named_in_the_guide_exist() -> None:
    names = set(re.findall(r"`board\.(\w+)", _GUIDE))
    assert {"watch", "put", "get", "age_s", "on_change"} <= names
    assert [name for name in names if not hasattr(nep.Blackboard(), name)] == []
