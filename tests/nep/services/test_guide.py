"""Tests of docs/services.md: its examples run and print the documented output."""

from __future__ import annotations

import re
from textwrap import indent

from nep.masters.master import Master
from tests.nep.programs import ROOT, running

_PROGRAM = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def test_guide_example_prints_the_documented_output(master: Master) -> None:
    guide = (ROOT / "docs" / "services.md").read_text(encoding="utf-8")
    program, _typed, _of_surveys = _PROGRAM.findall(guide)
    with running(program, NEP_MASTER=master.address) as example:
        said, _errors = example.end()
    assert f"It prints `{said.strip()}`" in guide
    assert said.strip() == "{'sum': 5}"


def test_typed_guide_example_prints_the_documented_output(master: Master) -> None:
    guide = (ROOT / "docs" / "services.md").read_text(encoding="utf-8")
    _first, program, _of_surveys = _PROGRAM.findall(guide)
    with running(program, NEP_MASTER=master.address) as example:
        said, _errors = example.end()
    assert said.startswith("AddAnswer(sum=5.0)\n")
    assert indent(said, "    ") in guide


def test_survey_guide_example_runs(master: Master) -> None:
    guide = (ROOT / "docs" / "services.md").read_text(encoding="utf-8")
    _first, _typed, program = _PROGRAM.findall(guide)
    around = f"import nep\nwith nep.node('me') as node:\n{indent(program, '    ')}    print(answers)\n"
    with running(around, NEP_MASTER=master.address) as example:
        assert example.end() == ("[{'name': 'me'}]\n", "")
