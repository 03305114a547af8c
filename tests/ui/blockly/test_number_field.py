"""Tests of number fields of blocks: comma or point as decimal separator; other text is rejected."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import number, started, workspace
from tests.ui.blockly.test_bundle import EDITOR, built, node, tools  # noqa: F401 (a fixture)
from tests.ui.blockly_person import Person, editor

EXAMPLES = Path(__file__).parents[2] / "data" / "typed_numbers.json"
SENTENCE = "document.querySelector('.nepTab:not([hidden]) .nepWhy').textContent"
RUN_EXAMPLES = """
import {buildSync} from 'esbuild';
import {readFileSync} from 'node:fs';
const built = buildSync({entryPoints: ['src/typed_number.ts'], format: 'esm', write: false});
const code = Buffer.from(built.outputFiles[0].contents).toString('base64');
const {parseNumber} = await import(`data:text/javascript;base64,${code}`);
const {numbers, separators, not_numbers} = JSON.parse(readFileSync(process.argv[1], 'utf8'));
console.log(JSON.stringify({
  numbers: numbers.map(([text]) => [text, parseNumber(text)]),
  separators: separators.map(parseNumber), not_numbers: not_numbers.map(parseNumber),
}));
"""


@built
@pytest.mark.timeout(300)
def test_editor_parses_numbers_like_the_window(tools) -> None:  # noqa: F811
    examples = json.loads(EXAMPLES.read_text("utf-8"))
    command = [node, "--input-type=module", "-e", RUN_EXAMPLES, str(EXAMPLES)]
    done = subprocess.run(command, cwd=EDITOR, capture_output=True, text=True, check=True, timeout=280)
    read = json.loads(done.stdout)
    assert read["numbers"] == examples["numbers"]
    assert set(read["separators"]) == {"separators"}
    assert set(read["not_numbers"]) == {"not a number"}


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions(()), 900, 500)


@pytest.fixture
def them(view, person) -> Person:
    wait = {"type": "control_wait", "id": "w", "inputs": {"SECONDS": {"shadow": number(5) | {"id": "n"}}}}
    made: Person = person(state=workspace(started(wait) | {"id": "start", "x": 60, "y": 60}))
    view.setFocus()
    made.wait_for("document.hasFocus()")
    return made


def open_field(them: Person) -> None:
    them.click("[data-id=n]")
    them.wait_for("document.activeElement.classList.contains('blocklyHtmlInput')")


def seconds(them: Person) -> object:
    saved = them.tops()[0]["next"]["block"]["inputs"]["SECONDS"]["shadow"]
    return saved["fields"]["NUMBER"]


@pytest.mark.web
def test_typed_and_pasted_numbers_in_a_block_are_parsed_or_rejected(them: Person) -> None:
    open_field(them)
    QTest.keyClicks(them.target, "0,2")
    them.press(Qt.Key_Return)
    them.until(lambda: seconds(them) == 0.2, "0,2 is 0.2")
    assert not them.ask(SENTENCE)

    open_field(them)
    QGuiApplication.clipboard().setText("1.234,5")
    them.press(Qt.Key_V, Qt.ControlModifier)
    them.wait_for(f"{SENTENCE}.includes('comma or point')")
    them.wait_for("document.activeElement.classList.contains('blocklyInvalidInput')")
    them.press(Qt.Key_Return)
    them.wait_for(f"{SENTENCE}.includes('0.2')")  # the value that the field restores
    assert seconds(them) == 0.2

    open_field(them)
    them.wait_for(SENTENCE, "")
    QTest.keyClicks(them.target, "abc")
    them.wait_for(f"{SENTENCE}.includes('Enter a number.')")
    them.press(Qt.Key_Backspace)
    QTest.keyClick(them.target, Qt.Key_A, Qt.ControlModifier)
    QTest.keyClicks(them.target, "-1,5")
    them.wait_for(SENTENCE, "")
    them.press(Qt.Key_Return)
    them.until(lambda: seconds(them) == -1.5, "-1,5 is -1.5")
