"""Tests of docs/recordings.md: its program prints the documented output, and the named modules exist."""

from __future__ import annotations

import importlib
import re

from nep.masters.master import Master
from tests.nep.programs import ROOT, running

_GUIDE = (ROOT / "docs" / "recordings.md").read_text(encoding="utf-8")


def test_guide_program_prints_the_documented_output(master: Master) -> None:
    program, _fence, text = _GUIDE.partition("```python\n")[2].partition("\n```\n\n")
    with running(program, NEP_MASTER=master.address) as example:
        printed, errors = example.end()
    assert errors == ""
    assert printed.splitlines() == [line.strip() for line in text.split("\n\n")[1].splitlines()]


def test_modules_and_names_in_the_guide_table_exist() -> None:
    rows = re.findall(r"^\| `(nep\.recordings\.\w+)` \| (.*) \|$", _GUIDE, re.MULTILINE)
    assert len(rows) == 11
    for module, said in rows:
        found = importlib.import_module(module)
        for name in re.findall(r"`([A-Z]\w+)`", said):
            assert hasattr(found, name) or name == "TopicSelection", name
