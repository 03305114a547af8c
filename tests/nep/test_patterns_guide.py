"""Tests of docs/patterns.md: its programs run and print the documented output."""

from __future__ import annotations

import re

import pytest

from nep.masters.master import Master
from tests.nep.programs import ROOT, running

_GUIDE = (ROOT / "docs" / "patterns.md").read_text(encoding="utf-8")
_SECTION = re.compile(r"^## (.*?)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
_PROGRAM = re.compile(r"^```python\n(.*?)^```\n(.*)", re.MULTILINE | re.DOTALL)
_SAID = re.compile(r"`([^`]+)`")


def _programs() -> dict[str, tuple[str, list[str]]]:
    """Return each program and its documented output lines, by the heading of its section."""
    found = {}
    for head, text in _SECTION.findall(_GUIDE):
        program = _PROGRAM.search(text)
        if program is not None:
            after = program[2].strip().partition("\n\n")
            said = _SAID.findall(after[0].partition(". ")[0]) if "`" in after[0] else []
            if after[0] == "It prints":
                said = [line.strip() for line in after[2].partition("\n\n")[0].splitlines()]
            found[head] = (program[1], said)
    return found


@pytest.mark.parametrize("head", sorted(_programs()))
def test_guide_program_prints_the_documented_output(master: Master, head: str) -> None:
    program, said = _programs()[head]
    with running(program, NEP_MASTER=master.address) as example:
        printed, errors = example.end()
    assert errors == ""
    assert printed.splitlines() == said


def test_patterns_guide_has_one_program_per_pattern() -> None:
    sections = dict(_SECTION.findall(_GUIDE))
    assert sections
    assert {head: text.count("```python\n") for head, text in sections.items()} == dict.fromkeys(sections, 1)
    assert _programs().keys() == sections.keys()
