"""Tests of the error messages for invalid declarations in a driver: one sentence with cause and line."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from app.errors import DescriptionError
from tests.robots.driver.test_process import ROOT

GOOD = '''from typing import Annotated, Literal
from app.robots.kit import Call, Kind, Range, action, event, main, safe_stop, sensor
class Table:
    angle = sensor(Annotated[float, Range(0, 360, unit="deg")], title="angle")
    bumped = event("when bumped", title="bumped", icon="zap", fields={"side": str})
    def __init__(self, link):
        self.link = link
    @action("turn %far", "Movement", "move")
    def turn(self, call: Call, far: Annotated[float, Range(-1, 1)] = 0.5) -> None:
        """Turn."""
    @safe_stop()
    def stop(self):
        """Still."""
ROBOT = Kind(model="table", title="Table", body=Table)
if __name__ == "__main__":
    raise SystemExit(main(ROBOT))
'''
USED = "the description of 'table' can't be used: "
AGAIN = "    @action('again', 'Movement', 'move')\n    def turn(self, call: Call):\n        pass\n"


def load(file: Path, text: str) -> object:
    file.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = module  # type hints of classes are resolved through sys.modules
    try:
        spec.loader.exec_module(module)
    finally:
        del sys.modules[file.stem]
    return module.ROBOT


def test_valid_driver_is_accepted(tmp_path):
    load(tmp_path / "table.py", GOOD)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("far: Annotated[float, Range(-1, 1)] = 0.5", "far = 0.5",
         "table.py, line 8: turn: Table.turn: 'far' needs a type annotation"),
        ("Range(-1, 1)] = 0.5", "Range(-1, 1)] = 'x'",
         "table.py, line 8: turn: the default of 'far' must be a number, not 'x'"),
        ("Range(-1, 1)", 'Range(-1, 1, unit="meters")',
         "table.py, line 8: turn: unknown unit 'meters'; write 'm'"),
        ("far: Annotated[float, Range(-1, 1)] = 0.5", "far: 'Missing' = 0.5",
         "table.py, line 8: turn: name 'Missing' is not defined"),
        ("self, call: Call, far", "self, far",
         "table.py, line 8: turn: the parameter after 'self' must be the call; write def NAME(self, call"),
        ("def turn(self, call: Call, far: Annotated[float, Range(-1, 1)] = 0.5)",
         "def turn(self, call: Call, *far: float)",
         "table.py, line 8: turn: 'far' can't take a variable number of arguments; declare each"),
        ('"""Turn."""', "yield",
         "table.py, line 8: turn: actions can't be generators (yield); report progress with"),
        ('-> None:\n        """Turn."""', "-> complex: return 1j",
         "table.py, line 8: turn: unsupported type complex; use float"),
        ('{"side": str}', '{"side": complex}', "table.py, line 5: unsupported type complex; use float"),
        ('unit="deg"', 'unit="°"', "table.py, line 4: unknown unit '°'; write 'deg'"),
        ("turn %far", "turn %wide",
         USED + "table.py, line 9: actions.turn.rb:block.text.en uses %wide, which isn't defined"),
        ("    @safe_stop()", f"{AGAIN}    @safe_stop()",
         USED + "table.py, line 12: 'turn' is defined twice, first in line 9"),
        ("    def __init__", "    angle = 3\n    def __init__", None),
        ('"Movement", "move")\n', '"Movement", "not an icon!")\n',
         USED + "table.py, line 9: actions.turn.rb:block.icon"),
    ],
)  # fmt: skip
def test_invalid_declaration_is_reported_with_its_line(tmp_path, old, new, sentence):
    text = GOOD.replace(old, new)
    assert text != GOOD
    if sentence is None:  # replacing a sensor by another attribute is valid
        load(tmp_path / "table.py", text)
        return
    with pytest.raises(DescriptionError) as caught:
        load(tmp_path / "table.py", text)
    assert str(caught.value).startswith(sentence)
    assert "\n" not in str(caught.value)


def test_invalid_driver_exits_with_an_error_message_and_no_traceback(tmp_path):
    driver = tmp_path / "table.py"
    driver.write_text(GOOD.replace("Range(-1, 1)", 'Range(-1, 1, unit="sec")'), encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, str(driver)],
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    said = "table.py, line 8: turn: unknown unit 'sec'; write 's'\n"
    assert (ended.returncode, ended.stdout, ended.stderr) == (1, "", said)
