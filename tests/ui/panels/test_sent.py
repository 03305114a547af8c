"""Tests of the Sent panel: list of messages and calls, copying, resending while armed."""

from __future__ import annotations

import json

import pytest
from PySide6.QtGui import QGuiApplication

from app.core.run.acting.arming import Target
from app.core.run.acting.sent_log import SentRecord
from app.core.run.acting.shelf import SavedMessage
from app.ui.intents import SelectService
from app.ui.panels.act.sent import PANEL, SentPanel
from tests.pseudo import untranslated_in
from tests.ui.clipping import clipped
from tests.ui.fakes import Session
from tests.ui.panel_case import OUT_OF_SIGHT, Window, button, press, ticks
from tests.ui.test_accessible import unsaid

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
WORD = SavedMessage("a", "Word", "/words", "json", '{"word": "yes"}')


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


def made(qtbot, window: Window, size: tuple[int, int] = (640, 320)) -> SentPanel:
    panel = window.make(PANEL, size)
    qtbot.addWidget(panel)
    assert isinstance(panel, SentPanel)
    return panel


def rows(panel: SentPanel) -> list[list[str]]:
    """Return the texts of the table without the times."""
    return [
        [panel.table.cell_at(row, column).text for column in (2, 3, 4, 5)]
        for row in range(panel.model.rowCount())
    ]


def sign(panel: SentPanel, row: int) -> str:
    return panel.table.cell_at(row, 1).accessible_text


def test_sent_messages_are_listed_copied_and_resent_while_armed(qtbot, window) -> None:
    session, panel = window.session, made(qtbot, window)
    acting = session.acting
    press(button(panel, "Publish a message"))
    assert window.commands == ["publish.new"]
    heard = session.live.source.listen("/words", "json")
    assert acting.send(WORD) == ""
    assert heard.listen(timeout_s=60.0)[0]
    ticks(window, panel)
    assert rows(panel) == [
        ["/words", "Word, 1 subscriber", "", "Publish"],
        ["Studio", "armed for 5 min", "", "Studio"],
    ]
    assert panel.total.text().startswith("1 sent since ")
    assert unsaid(panel) == []
    key = panel.model.key_of(panel.model.row_at(panel.model.index(0, 0)))
    assert not panel.repeat_button.isEnabled()
    panel.table.select_key(key)
    panel.refresh()
    assert panel.repeat_button.isEnabled()
    press(panel.repeat_button)
    assert heard.listen(timeout_s=60.0) == (True, {"word": "yes"})
    ticks(window, panel)
    assert rows(panel)[0] == ["/words", "Word, 1 subscriber", "\u00d7 2", "Publish"]
    assert panel.selected_record() is not None, "what is chosen stays chosen"

    panel.copy()
    line = QGuiApplication.clipboard().text()
    assert line.endswith("[Publish] /words 2 \u00d7 Word, 1 subscriber")
    menu = panel.menu_of(key)
    assert menu is not None
    entries = {action.text(): action for action in menu.actions()}
    assert list(entries) == ["Send again", "Copy the line", "Copy the message", "Show messages"]
    entries["Copy the message"].trigger()
    assert json.loads(QGuiApplication.clipboard().text()) == {"word": "yes"}
    entries["Show messages"].trigger()
    assert window.opened == ["/words"]

    session.runs.stop()
    ticks(window, panel, 7)
    assert not panel.repeat_button.isEnabled()
    assert rows(panel)[0][1] == "no longer armed"
    menu = panel.menu_of(key)
    assert menu is not None
    again = menu.actions()[0]
    assert (again.text(), again.isEnabled()) == ("Send again (not armed)", False)
    panel.table.select_key(key)
    panel.repeat()
    assert window.toasts[-1] == "Sending to /words isn't armed. Arm it first."
    assert heard.receive(0.0) is None
    panel.filter.setText("image words")
    assert rows(panel) == []
    press(button(panel, "Clear the filter"))
    panel.clear()
    assert rows(panel) == []
    assert panel.total.text().startswith("2 sent since ")


def put_all(session: Session) -> None:
    """Add one record of each kind and arm the session."""
    sent = session.acting.sent_log
    for number, (asker, name) in enumerate(
        (("publish", "/words"), ("service", "remember_face"), ("replay", "/scan"), ("image", "/cam/point"))
    ):
        text = '{"n": 1}' if asker != "replay" else ""
        again = str if asker != "replay" else None
        sent.add(SentRecord(float(number), asker, name, "1", number % 2 > 0, text, text, again), 1)  # type: ignore[arg-type]
    session.acting.arm()


def test_menus_of_sent_calls_and_replayed_messages_differ_from_published_messages(qtbot, window) -> None:
    panel, acting = made(qtbot, window), window.session.acting
    put_all(window.session)
    acting.allow(Target("service", "remember_face"))
    ticks(window, panel)
    assert [sign(panel, row) for row in range(5)] == ["Studio", "failed", "Replay", "failed", "Publish"]
    entries = []
    for row in range(5):
        menu = panel.menu_of(panel.model.key_of(panel.model.row_at(panel.model.index(row, 0))))
        assert menu is not None
        entries.append([action.text() for action in menu.actions()])
    assert entries == [
        ["Copy the line"],
        ["Send again (not armed)", "Copy the line", "Copy the message", "Show messages"],
        ["Copy the line", "Show messages"],
        ["Call again", "Copy the line", "Copy the request", "Open the service"],
        ["Send again (not armed)", "Copy the line", "Copy the message", "Show messages"],
    ]
    called = next(each for each in acting.sent_log.records if each.origin == "service")
    panel.table.opened.emit(str(called.number))
    assert window.commands[-1] == SelectService("remember_face")
    panel.table.opened.emit("12345")
    assert panel.menu_of("12345") is None


@pytest.mark.parametrize("size", [(640, 320), (300, 200)], ids=["roomy", "narrow"])
def test_texts_are_translated_and_fit(qtbot, pseudo, window, size) -> None:
    panel = made(qtbot, window, size)
    assert untranslated_in(panel) == []
    put_all(window.session)
    ticks(window, panel, 2)
    assert untranslated_in(panel, "words", "face", "remember", "scan", "cam", "point", "JSON") == []
    assert [fault for fault in clipped(panel) if f"at {9 - OUT_OF_SIGHT}," not in fault] == []
