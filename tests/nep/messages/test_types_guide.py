"""Tests of docs/types.md: its programs run and print the documented output."""

from __future__ import annotations

import re

import pytest

from nep.masters.master import Master
from tests.nep.programs import ROOT, running

_GUIDE = (ROOT / "docs" / "types.md").read_text(encoding="utf-8")
_PROGRAM = re.compile(
    r"^```python\n(.*?)^```\n\nIt prints(?: `([^`]+)`\.|\n\n((?: {4}[^\n]*\n)+))", re.MULTILINE | re.DOTALL
)


@pytest.mark.parametrize("number", range(3))
def test_guide_program_prints_the_documented_output(master: Master, number: int) -> None:
    program, said, lines = _PROGRAM.findall(_GUIDE)[number]
    with running(program, NEP_MASTER=master.address) as example:
        printed, _errors = example.end()
    assert printed.splitlines() == [line.strip() for line in (said or lines).splitlines()]


def test_every_guide_program_documents_its_output() -> None:
    assert len(_PROGRAM.findall(_GUIDE)) == _GUIDE.count("```python") == 3
