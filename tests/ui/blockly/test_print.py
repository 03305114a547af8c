"""Tests of printing blocks: page breaks, scaling, and the text of notes and page headers."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QBuffer, QIODevice, QMarginsF, QSize
from PySide6.QtGui import QImage, QPageLayout, QPageSize
from PySide6.QtPdf import QPdfDocument

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView
from tests.blocks.samples import list_of, number, robot, started, text, workspace
from tests.ui.blockly_person import TOKENS, WAIT_MS, Person, editor

pytestmark = pytest.mark.web

A4 = QPageLayout(QPageSize(QPageSize.PageSizeId.A4), QPageLayout.Orientation.Portrait, QMarginsF())
ORANGE = TOKENS["block"]["control"]["light"]["primary"].lower()
NOTE = {"height": 100, "width": 160, "id": "note", "x": 500, "y": 60, "text": "Remember the milk"}


def wait_block(seconds: float) -> dict:
    return {"type": "control_wait", "inputs": {"SECONDS": {"shadow": number(seconds)}}}


def stack(count: int, first: float = 0) -> dict:
    block = wait_block(first + count - 1)
    for at in range(count - 2, -1, -1):
        block = wait_block(first + at) | {"next": {"block": block}}
    return block


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, editor_definitions([robot()]))


class Pages:
    """Pages of a PDF as text and images."""

    def __init__(self, data: bytes) -> None:
        self._buffer = QBuffer()
        self._buffer.setData(data)
        self._buffer.open(QIODevice.OpenModeFlag.ReadOnly)
        self._document = QPdfDocument()
        self._document.load(self._buffer)
        self.count = self._document.pageCount()
        self.texts = [self._document.getAllText(page).text() for page in range(self.count)]

    def picture(self, page: int) -> QImage:
        return self._document.render(page, QSize(794, 1123))


def printed(qtbot, view: BlocklyView, title: str = "Tea for two") -> Pages | None:
    got: list[bytes] = []
    view.render_pdf(title, "23 November 2026", A4, got.append)
    qtbot.waitUntil(lambda: bool(got), timeout=WAIT_MS)
    return Pages(got[0]) if got[0] else None


def colours(image: QImage) -> set[str]:
    return {
        image.pixelColor(x, y).name() for x in range(0, image.width(), 3) for y in range(0, image.height(), 3)
    }


def test_stacks_move_unsplit_to_the_next_page_and_a_long_stack_is_split_between_blocks(
    qtbot, view, person
) -> None:
    person(
        state=workspace(
            started(stack(16)) | {"id": "start", "x": 60, "y": 60},
            stack(10, 100) | {"x": 60, "y": 1400},
            stack(150, 200) | {"x": 60, "y": 4000},
        )
        | {"workspaceComments": [NOTE]}
    )
    pages = printed(qtbot, view)
    assert pages is not None
    for at, words in enumerate(pages.texts):
        assert "Tea for two" in words
        assert f"23 November 2026 · Page {at + 1} of {pages.count}" in words
    assert pages.count == 2
    assert "Remember the milk" in pages.texts[0]
    numbers = [[int(word) for word in each.split() if word.isdigit()] for each in pages.texts]
    held = [{each for each in page if each < 16 or each >= 100} for page in numbers]
    assert set(range(16)) <= held[0]
    assert set(range(100, 110)) <= held[0]
    for seconds in range(200, 350):
        assert sum(seconds in page for page in held) == 1, f"{seconds} is on one page, once"
    for page in range(pages.count):
        assert ORANGE in colours(pages.picture(page))


def test_wide_block_is_scaled_to_the_page_and_canvas_is_unchanged_after_printing(qtbot, view, person) -> None:
    items = [text(f"this is item {number}") for number in range(16)]
    wide = stack(1) | {"id": "wide", "x": 60, "y": 60, "inputs": {"SECONDS": {"block": list_of(*items)}}}
    them: Person = person(state=workspace(wide))
    before = them.box("[data-id=wide] > .blocklyPath")
    view.set_theme(TOKENS, is_dark=True)
    pages = printed(qtbot, view, "A long name " * 30)
    assert pages is not None
    assert pages.count == 1
    assert pages.texts[0].count("this is item") == 16
    picture = pages.picture(0)
    white = {picture.pixelColor(x, y).name() for x in (2, 790) for y in range(0, 1123, 7)}
    assert white == {"#ffffff"}, "nothing reaches over the edge, and paper is white in the dark theme"
    assert them.box("[data-id=wide] > .blocklyPath") == before
    them.wait_for("document.querySelectorAll('.nepPrint').length", 0)


def test_screen_text_size_does_not_enlarge_the_printout(qtbot, view, person) -> None:
    person(state=workspace(stack(3) | {"x": 60, "y": 60}))
    usual = printed(qtbot, view)
    view.set_theme({**TOKENS, "textPercent": 200}, is_dark=False)
    large = printed(qtbot, view)
    assert usual is not None
    assert large is not None
    assert (large.count, large.texts) == (usual.count, usual.texts)
    assert large.picture(0) == usual.picture(0)


def test_notes_are_printed_with_full_text(qtbot, view, person) -> None:
    words = " ".join(f"word{number:02}" for number in range(60))
    sheet = {"text": f"{words} of the block", "pinned": True, "height": 60, "width": 160}
    noted = stack(2) | {"id": "noted", "x": 60, "y": 60, "icons": {"comment": sheet}}
    them: Person = person(state=workspace(noted) | {"workspaceComments": [NOTE | {"y": 600, "text": words}]})
    them.wait_for("!!document.querySelector('.nepNote')")
    pages = printed(qtbot, view)
    assert pages is not None
    assert pages.count == 1
    assert all(pages.texts[0].count(word) == 2 for word in words.split())
    assert "…" not in pages.texts[0]


def test_empty_canvas_prints_no_pages(qtbot, view, person) -> None:
    person(state=workspace())
    assert printed(qtbot, view) is None
