from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, QRectF, Qt
from PySide6.QtGui import QFont, QFontMetricsF
from PySide6.QtTest import QTest

from app.blocks.model.program import Problem
from app.core.reports.not_installed import MissingLibraries, alert_missing
from app.intents import ConnectRobot, ReplaceRobot
from app.ui.intents import ShowBlock
from app.ui.panels.build.problems import PANEL, ProblemsPanel
from app.ui.widgets import paint
from app.ui.widgets.keyboard import tab_stops
from app.ui.widgets.labels import PartlyBoldLabel
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, has_keys, press
from tests.ui.sample_data import pepper


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> ProblemsPanel:
    made = window.make(PANEL, (900, 124))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, ProblemsPanel)
    return made


def test_each_problem_is_shown_with_its_message_and_fix(panel, window) -> None:
    assert [row.problem.subject for row in panel.rows] == ["wave", "wait until"]
    assert panel.rows[0].accessibleName() == "warning: NAO isn't connected, so wave will be skipped."
    assert (panel.chip.text, panel.chip.status) == ("2", "warn")
    press(panel.rows[1].buttons[0])
    assert window.commands == ["add_time_limit"]


def test_click_or_return_shows_the_block(panel, window) -> None:
    QTest.mouseClick(panel.rows[0], Qt.MouseButton.LeftButton, pos=QPoint(200, 15))
    QTest.keyClick(panel.rows[1], Qt.Key.Key_Return)
    assert window.commands == [ShowBlock("b8"), ShowBlock("b3")]


def test_behaviour_is_checked_only_after_an_edit(panel, window) -> None:
    rows = list(panel.rows)
    document = window.session.document
    panel.refresh()
    document.edits += 1
    panel.refresh()
    assert panel.rows == rows  # unchanged problems keep their rows
    document.found = (Problem("error", None, None, "x", "x is not known."), *document.found)
    panel.refresh()
    assert len(panel.rows) == 2  # not checked again without an edit
    document.edits += 1
    panel.refresh()
    assert len(panel.rows) == 3
    assert panel.chip.status == "error"
    assert panel.rows[0].buttons == []
    assert panel.rows[1:] == rows  # existing rows are reused
    document.found = document.found[1:2]
    document.edits += 1
    panel.refresh()
    assert panel.rows == rows[:1]  # fixed problems are removed


def test_panel_without_problems_shows_an_empty_state(qtbot, qapp) -> None:
    window = Window(Session())
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(panel, ProblemsPanel)
    assert panel.empty_label.isVisible()
    assert (panel.chip.text, panel.chip.status) == ("No problems", "ok")


def test_missing_robot_is_one_row_that_lists_possible_replacements(panel, window, monkeypatch) -> None:
    document = window.session.document
    absent = [
        Problem("warning", f"b{n}", "robot", "say", "Pepper 2 isn't connected, so say will be skipped.",
                "Show the robots", ConnectRobot("Pepper 2"), icon="message-circle")
        for n in range(3)
    ]  # fmt: skip
    document.found, document.edits, document.absent_blocks = tuple(absent), 7, ("b0", "b1", "b2")
    monkeypatch.setattr(type(document), "absent_robots", (pepper("Pepper 2"),))
    say = {"type": "robot_virtual_pepper_do_say", "fields": {"ROBOT": "Pepper 2"}}
    document.set_blocks({"blocks": {"blocks": [{**say, "id": f"b{n}"} for n in range(3)]}})
    panel.refresh()
    (row,) = panel.rows
    assert row.accessibleName() == "warning: Pepper 2 isn't connected, so 3 blocks will be skipped."
    assert [button.text() for button in row.buttons] == ["Use Pepper"]
    press(row.buttons[0])
    assert window.commands == [ReplaceRobot("Pepper 2", "Pepper")]
    assert panel.chip.toolTip() == "1 warning"


def test_arrow_keys_move_through_the_problems(panel, window) -> None:
    panel.activateWindow()
    panel.rows[0].setFocus()
    QTest.keyClick(panel.rows[0], Qt.Key.Key_Down)
    assert has_keys(panel.rows[1])
    QTest.keyClick(panel.rows[1], Qt.Key.Key_Down)
    assert has_keys(panel.rows[1])
    QTest.keyClick(panel.rows[1], Qt.Key.Key_Up)
    assert has_keys(panel.rows[0])


def test_tab_moves_through_the_problems_including_later_problems(qtbot, panel, window) -> None:
    document = window.session.document
    document.found = (Problem("error", None, None, "x", "x is not known."), *document.found)
    document.edits += 1
    panel.refresh()
    qtbot.waitUntil(lambda: all(row.isVisible() for row in panel.rows))
    stops = list(tab_stops(panel, panel))
    places = [stops.index(stop) for row in panel.rows for stop in (row, *row.buttons)]
    assert places == sorted(places)
    assert len(places) > len(panel.rows), "buttons come behind their rows"


def test_old_problems_are_kept_while_a_long_behaviour_is_checked(panel, window, monkeypatch) -> None:
    rows = list(panel.rows)
    monkeypatch.setattr(window.session.document, "newest_program", lambda: None)
    panel.refresh()
    assert panel.rows == rows
    assert panel.status_label.text() == "Checking"


def test_fixing_a_problem_keeps_keyboard_focus_in_the_panel(panel, window) -> None:
    panel.activateWindow()
    document = window.session.document
    panel.rows[0].buttons[0].setFocus()
    document.found, document.edits = document.found[1:], 20
    panel.refresh()
    assert has_keys(panel.rows[0])
    document.found, document.edits = (), 21
    panel.refresh()
    assert has_keys(panel)


def test_hundreds_of_problems_are_counted_and_only_the_first_are_listed(panel, window) -> None:
    document = window.session.document
    document.found = tuple(
        Problem("error", f"x{n}", None, f"b{n}", f"b{n} needs a number.") for n in range(500)
    )
    document.edits = 30
    panel.refresh()
    assert (len(panel.rows), panel.chip.text) == (60, "500")
    assert panel.overflow_label.text() == "440 more, shown once these are fixed"
    document.found, document.edits = document.found[400:], 31
    panel.refresh()
    assert panel.rows[0].problem.subject == "b400"
    assert panel.overflow_label.text() == "40 more, shown once these are fixed"
    document.found, document.edits = document.found[:1], 32
    panel.refresh()
    assert not panel.overflow_label.isVisibleTo(panel)


def test_unavailable_block_editor_is_a_problem_regardless_of_the_blocks(panel, window) -> None:
    before = len(panel.rows)
    alert_missing(window.session.alerts, MissingLibraries(("libnss3.so",), ("libnss3",)))
    panel.refresh()
    assert len(panel.rows) == before + 1
    assert "sudo apt install libnss3" in panel.rows[0].accessibleName()


def test_fix_buttons_are_below_the_sentence_in_a_narrow_panel(qtbot, panel) -> None:
    row = panel.rows[0]
    button, sentence = row.buttons[0], row.sentence

    def is_below() -> bool:
        return button.mapTo(row, QPoint()).y() >= sentence.geometry().bottom()

    assert not is_below()
    assert sentence.width() >= sentence.full_width()
    panel.resize(285, 300)
    qtbot.waitUntil(is_below)
    qtbot.waitUntil(lambda: button.mapTo(row, QPoint(0, button.height())).y() <= row.height())
    assert sentence.width() > 0.6 * row.width()
    assert panel.rows[1].y() >= row.geometry().bottom()
    panel.resize(900, 300)
    qtbot.waitUntil(lambda: not is_below())


def test_status_text_is_elided_or_left_out_in_a_narrow_title_bar(panel) -> None:
    status_label = panel.status_label
    shown = []
    for width in (300, 90, 40):
        status_label.resize(width, 20)
        shown.append(status_label.displayed_text())
    assert shown[0] == "Checked as you build"
    assert "…" in shown[1]
    assert shown[2] == ""


def test_sentence_that_does_not_fit_ends_with_an_ellipsis_at_any_width(qtbot, panel, monkeypatch) -> None:
    sentence = PartlyBoldLabel(panel.theme, "NAO isn't connected; wave is skipped.", "wave")
    qtbot.addWidget(sentence)
    painted: list[str] = []

    def record(_painter: object, rect: QRectF, text: str, font: QFont, *_: object) -> None:
        painted.append(QFontMetricsF(font).elidedText(text, Qt.TextElideMode.ElideRight, rect.width() + 1))

    monkeypatch.setattr(paint, "text_line", record)
    for width in range(40, int(sentence.full_width()) - 4):
        painted.clear()
        sentence.resize(width, 20)
        sentence.grab()
        assert painted[-1].endswith("…"), width
