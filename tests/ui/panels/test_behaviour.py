from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import QBuffer, QIODevice, QPoint, Signal
from PySide6.QtGui import QColor, QGuiApplication, QPixmap
from PySide6.QtWidgets import QLabel, QWidget

from app.blocks.model.workspace_json import WorkspaceJson
from app.core.reports.not_installed import ALERT_ID
from app.ui.blockly.messages import (
    BlocksDeleted,
    BlocksDraggedOutside,
    BlocksDroppedOutside,
    CanvasButtonPressed,
    DragImageRendered,
    FlyoutPinned,
    HistoryChanged,
    PagePosition,
    PanelMessage,
    SensorsShown,
)
from app.ui.intents import PressKey, SelectTab
from app.ui.panels.base import Panel
from app.ui.panels.build.behaviour.dragged_blocks import POINTER_OFFSET, DragImage, transfer_text
from app.ui.panels.build.behaviour.panel import BehaviourPanel
from app.ui.panels.build.behaviour.program_view import ProgramView
from app.ui.theme.theme import Theme
from app.ui.widgets import EmptyState
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press, ticks
from tests.ui.sample_data import PROGRAM, Invocation, pepper


class Editor(QWidget):
    """Fake block editor that records its calls."""

    changed = Signal(str, dict)
    key_pressed = Signal(str)
    recovered = Signal()
    message_received = Signal(object)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.is_ready = True
        self.told: list[tuple[object, ...]] = []
        self.late: dict[str, object] = {}

    def __getattr__(self, name: str) -> Callable[..., None]:
        if name.startswith("_") or name == "flush":
            raise AttributeError(name)
        return lambda *given: self.told.append((name, *given))

    def to_screen(self, position: PagePosition) -> QPoint:
        return QPoint(position.x, position.y)

    def flush(self, done: Callable[[dict[str, object]], None]) -> None:
        if self.late:
            self.changed.emit("behaviour-1", self.late)  # pending edits are reported before the reply
        done(self.late)

    def last(self, name: str) -> object:
        return next(call[1] for call in reversed(self.told) if call[0] == name)

    def count(self, name: str) -> int:
        return sum(call[0] == name for call in self.told)


PANEL = Panel("behaviour", "Behaviour", "blocks", (), lambda context: BehaviourPanel(context, Editor))


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> BehaviourPanel:
    made = window.make(PANEL, (1032, 600))
    qtbot.addWidget(made)
    assert isinstance(made, BehaviourPanel)
    qtbot.addWidget(made.title_widget())
    return made


def editor(panel: BehaviourPanel) -> Editor:
    assert isinstance(panel.editor, Editor)
    return panel.editor


def send(panel: BehaviourPanel, message: PanelMessage) -> None:
    editor(panel).message_received.emit(message)


def at(position: QPoint) -> PagePosition:
    return PagePosition(position.x(), position.y())


def test_editor_receives_definitions_once_before_the_blocks(panel, window) -> None:
    names = [call[0] for call in editor(panel).told]
    assert names.index("set_theme") < names.index("set_definitions") < names.index("show_tab")
    ticks(window, panel, 10)
    assert editor(panel).count("show_tab") == editor(panel).count("set_definitions") == 1
    assert ("show_tab", "behaviour-1", window.session.document.workspace) in editor(panel).told


def test_only_replacing_the_document_reloads_the_editor(panel, window) -> None:
    document = window.session.document
    editor(panel).changed.emit("behaviour-1", {"blocks": {"blocks": [{"type": "x"}]}})
    panel.refresh()
    assert document.workspace == {"blocks": {"blocks": [{"type": "x"}]}}
    assert editor(panel).count("load") == 0
    document.set_blocks({"blocks": {}})
    document.revision = 1
    document.definitions_revision = 1
    panel.refresh()
    assert editor(panel).last("load") == {"blocks": {}}
    assert editor(panel).count("set_definitions") == 2


def test_running_block_is_highlighted_and_failed_block_shows_its_error(panel, window) -> None:
    session = window.session
    session.runs.run()
    session.runner.does("b1")
    session.take_over()
    panel.refresh()
    assert editor(panel).last("highlight") == ("b1",)
    session.runner.fails("b2", "“turn left” needs a number.")
    session.take_over()
    panel.refresh()
    assert editor(panel).last("highlight") == ()
    assert editor(panel).last("mark_stopped") == ("b1",)
    assert editor(panel).last("set_errors") == {"b2": "“turn left” needs a number."}


def test_warning_stays_on_its_block_until_the_blocks_change(panel, window) -> None:
    session = window.session
    session.runs.run()
    session.runner.does("b1")
    session.runner.warns("b2", "“walk” was replaced by “turn”", 12)
    session.take_over()
    panel.refresh()
    said = "“walk” was replaced by “turn” (12 times)"
    assert editor(panel).last("set_warnings") == {"b2": said}
    assert editor(panel).last("highlight") == ("b1",), "the winner goes on"
    assert (session.console.records[-1].level, session.console.records[-1].text) == ("warn", said)
    session.runs.stop()
    session.take_over()
    panel.refresh()
    assert editor(panel).last("set_warnings") == {"b2": said}, "it stays"
    session.document.apply_edit({"blocks": {"blocks": [{"type": "x", "id": "b2"}]}})
    session.tick()
    panel.refresh()
    assert editor(panel).last("set_warnings") == {}


def test_blocks_of_absent_robots_are_grey(panel, window) -> None:
    assert editor(panel).last("set_absent") == ("b8", "b9")
    window.session.document.absent_blocks = ()
    window.session.document.edits += 1
    panel.refresh()
    assert editor(panel).last("set_absent") == ()


def test_toolbox_shows_which_robots_may_still_move_or_do_not_respond(panel, window, monkeypatch) -> None:
    link = window.session.fleet.links[0]
    assert editor(panel).last("set_alarms") == {}
    for fact, state, words, status in (
        ({"is_stopping": True}, "stopping", "stopping", "running"),
        (
            {"stop_problem": "Pepper may still move: a joint stuck"},
            "not stopped",
            "may still move",
            "error",
        ),
        ({"is_unresponsive": True}, "silent", "not responding", "warn"),
    ):
        for name, value in fact.items():
            monkeypatch.setattr(link, name, value)
        assert link.state == state
        panel.refresh()
        assert editor(panel).last("set_alarms") == {link.name: (status, words)}
        monkeypatch.undo()
    link.invocations["walk"] = Invocation("1", "walk")
    assert link.state == "busy"
    panel.refresh()
    assert editor(panel).last("set_alarms") == {}


def test_sensor_blocks_show_their_newest_value(panel, window) -> None:
    document = window.session.document
    document.sensors, document.edits = (("Pepper", "battery"), ("NAO", "battery")), 5
    ticks(window, panel, 6)
    assert editor(panel).last("set_live_values") == {"Pepper/battery": "84 %"}
    assert window.session.looked_at == ["Pepper"]
    document.sensors, document.edits = (), 6
    panel.refresh()
    assert window.session.looked_at == []


def test_sensors_in_the_open_flyout_are_watched_until_the_flyout_closes(panel, window) -> None:
    window.session.document.sensors, window.session.document.edits = (), 5
    panel.refresh()
    assert window.session.looked_at == []
    send(panel, SensorsShown((("Pepper", "battery"), ("NAO", "battery"))))
    assert window.session.looked_at == ["Pepper"]
    assert editor(panel).last("set_live_values") == {"Pepper/battery": "84 %"}
    send(panel, SensorsShown(()))
    assert window.session.looked_at == []
    assert editor(panel).last("set_live_values") == {}


def test_robot_that_connects_while_its_sensors_are_shown_is_watched(panel, window) -> None:
    window.session.document.sensors, window.session.document.edits = (), 5
    panel.refresh()
    send(panel, SensorsShown((("Ada", "battery"),)))
    assert window.session.looked_at == []
    window.session.join(pepper("Ada"))
    ticks(window, panel, 6)
    assert window.session.looked_at == ["Ada"]


def test_python_view_shows_and_copies_the_newest_program(panel, window) -> None:
    editor(panel).late = {"blocks": {"blocks": [{"type": "late"}]}}
    panel.title_widget().show()
    press(button(panel.title_widget(), "Python"))
    assert window.session.document.workspace == editor(panel).late  # includes an edit of the last 150 ms
    assert panel.program.toPlainText() == PROGRAM
    assert panel.program.isReadOnly()
    press(button(panel.title_widget(), "Copy the program"))
    assert QGuiApplication.clipboard().text() == PROGRAM
    assert window.toasts == ["Copied the program"]
    window.session.document.source, window.session.document.edits = "pass\n", 99
    panel.refresh()
    assert panel.program.toPlainText() == "pass\n"


def test_undo_button_is_enabled_when_available_and_undoes_in_the_editor(panel, window) -> None:
    title = panel.title_widget()
    title.show()
    undo, redo = button(title, "Undo"), button(title, "Redo")
    assert not undo.isEnabled()
    send(panel, HistoryChanged(True, False))
    assert (undo.isEnabled(), redo.isEnabled()) == (True, False)
    press(undo)
    assert editor(panel).count("undo") == 1


def test_function_keys_in_the_page_trigger_window_commands(panel, window) -> None:
    for key in ("F12", "F5"):
        editor(panel).key_pressed.emit(key)
    assert window.commands == [PressKey("F12"), PressKey("F5")]  # the window maps keys to commands


def test_tab_shows_name_and_save_state_of_the_behaviour(panel, window) -> None:
    (tab,) = panel._bar.tabs.tabs.values()
    assert tab.accessibleName() == "Greeting"
    window.session.document.dirty = True
    panel.refresh()
    assert tab.accessibleName() == "Greeting, not saved"


def test_theme_change_reaches_the_page(panel, window) -> None:
    window.theme.set_mode("dark")
    assert [call for call in editor(panel).told if call[0] == "set_theme"][-1][2] is True


def test_empty_canvas_shows_the_first_step_and_its_buttons_run_commands(qtbot, qapp) -> None:
    window = Window(Session())
    panel = window.make(PANEL, (1032, 600))
    qtbot.addWidget(panel)
    assert isinstance(panel, BehaviourPanel)
    qtbot.addWidget(panel.title_widget())
    assert editor(panel).told[-1] == ("set_canvas_hint", "when started", False)
    send(panel, CanvasButtonPressed("robot"))
    send(panel, CanvasButtonPressed("examples"))
    assert window.commands == ["robots.virtual", "help.examples"]
    window.session.join(pepper())
    panel.refresh()
    assert [call for call in editor(panel).told if call[0] == "set_canvas_hint"][-1][2] is True


def test_highlighted_block_shows_its_name_and_where_to_drop_the_block(panel, window) -> None:
    panel.set_mode("python")
    panel.point_at("events_started")
    assert panel.mode == "blocks"
    assert editor(panel).told[-1] == ("point_at", "events_started", "when started", "Drag it onto the page")
    panel.point_at("robot_virtual_pepper_do_say")
    assert editor(panel).told[-1] == (
        "point_at",
        "robot_virtual_pepper_do_say",
        "say",
        "Drag it below the other blocks",
    )
    panel.point_at("")
    assert editor(panel).told[-1] == ("point_at", "")


def test_highlighting_a_block_switches_from_python_to_blocks(panel) -> None:
    panel.restore_state({"mode": "python"})
    assert panel.save_state() == {"mode": "python"}
    panel.show_block("b3")
    assert panel.mode == "blocks"
    assert editor(panel).last("show_block") == "b3"


def test_python_program_has_syntax_highlighting(qtbot, qapp) -> None:
    view = ProgramView(Theme("light"))
    qtbot.addWidget(view)
    view.show_program(PROGRAM)
    block = view.document().findBlockByNumber(view.line_containing("# Say hello") - 1)
    colours = [one.format.foreground().color().name() for one in block.layout().formats()]
    assert colours == [Theme("light").colour("textTertiary").name()]  # no highlighting inside a comment
    block = view.document().findBlockByNumber(view.line_containing("for _ in range(3)") - 1)
    assert len(block.layout().formats()) == 3  # for, in, 3


def test_toolbox_pinned_setting_is_saved(qtbot, panel, window) -> None:
    assert editor(panel).last("set_toolbox_pinned") is None
    send(panel, FlyoutPinned(False))
    assert window.session.settings.toolbox_pinned is False
    again = window.make(PANEL, (1032, 600))
    qtbot.addWidget(again)
    assert isinstance(again, BehaviourPanel)
    qtbot.addWidget(again.title_widget())
    assert editor(again).last("set_toolbox_pinned") is False


@pytest.mark.parametrize(("count", "words"), [(1, "Deleted 1 block"), (4, "Deleted 4 blocks")])
def test_deleted_blocks_are_restored_from_the_toast(panel, window, count, words) -> None:
    send(panel, BlocksDeleted(count))
    button, run = window.toast_buttons[-1]
    assert (window.toasts[-1], button) == (words, "Undo")
    assert run is not None
    run()
    assert editor(panel).count("undo_deletion") == 1


@pytest.mark.parametrize(
    ("count", "how", "words"),
    [
        (1, "moved", "Moved 1 block to Quiz"),
        (3, "moved", "Moved 3 blocks to Quiz"),
        (3, "copied", "Copied 3 blocks to Quiz"),
        (1, "added", "Added 1 block to Quiz"),
        (0, "moved", "Moved the note to Quiz"),
        (0, "copied", "Copied the note to Quiz"),
    ],
)
def test_toast_describes_the_result_of_dropping_blocks_on_a_tab(count: int, how: str, words: str) -> None:
    assert transfer_text(count, how, "Quiz") == words


def test_block_dropped_on_the_same_tab_or_outside_the_tab_bar_is_not_moved(panel, window) -> None:
    title = panel.title_widget()
    title.resize(900, 34)
    title.show()
    tabs = title.tabs
    own = tabs.tabs[window.session.document.key]
    for place in (own.mapToGlobal(own.rect().center()), own.mapToGlobal(QPoint(10, 300))):
        send(panel, BlocksDraggedOutside(at(place), window.session.document.key))
        assert not own.is_drop_target
        send(panel, BlocksDroppedOutside(at(place)))
    assert window.commands == []
    assert editor(panel).count("move_dragged_blocks") == 0


def test_dragging_a_block_to_the_end_of_the_tab_bar_scrolls_to_hidden_tabs(
    qtbot, panel, window, monkeypatch
) -> None:
    title = panel.title_widget()
    title.show()
    asked: list[QPoint] = []
    place = title.tabs.mapToGlobal(QPoint(4, 4))

    def scroll_at(where: QPoint) -> bool:
        asked.append(where)
        return len(asked) < 3

    monkeypatch.setattr(title.tabs, "scroll_at", scroll_at)
    send(panel, BlocksDraggedOutside(at(place), window.session.document.key))
    qtbot.waitUntil(lambda: len(asked) == 3)
    scrolling = panel._block_drag._scroll_timer
    assert asked == [place] * 3
    assert not scrolling.isActive(), "nothing moved: it waits for the mouse"
    send(panel, BlocksDraggedOutside(at(place), window.session.document.key))
    assert scrolling.isActive()
    send(panel, BlocksDraggedOutside(None, window.session.document.key))
    assert not scrolling.isActive()


def test_tab_under_a_dragged_block_opens_and_the_drag_image_follows(qtbot, panel, window) -> None:
    session = window.session
    home = session.document
    home.apply_edit(WorkspaceJson.from_blocks({"blocks": {"blocks": [{"type": "events_started"}]}}))
    other = session.documents.new()
    session.documents.show(home)
    title = panel.title_widget()
    title.resize(900, 34)
    title.show()
    panel.refresh()
    tab = title.tabs.tabs[other.key]
    place = tab.mapToGlobal(tab.rect().center())
    carried = panel._block_drag
    send(panel, BlocksDraggedOutside(at(place), home.key))
    assert tab.is_drop_target
    assert carried._open_timer.isActive()
    send(panel, BlocksDraggedOutside(at(place + QPoint(0, 400)), home.key))
    assert not carried._open_timer.isActive(), "moved away: it stays closed"
    send(panel, BlocksDraggedOutside(at(place), home.key))
    picture = QPixmap(60, 40)
    picture.fill(QColor("#00ff00"))
    data = QBuffer()
    data.open(QIODevice.OpenModeFlag.WriteOnly)
    picture.save(data, "PNG")
    send(panel, DragImageRendered(bytes(data.data()), 2.0))
    shown = title.window().findChild(DragImage)
    assert shown is not None
    assert shown.isVisible()
    assert (shown.width(), shown.height()) == (30, 20)
    assert shown.pos() == title.window().mapFromGlobal(place) + POINTER_OFFSET
    qtbot.waitUntil(lambda: window.commands == [SelectTab(other.key)])
    send(panel, BlocksDraggedOutside(None, home.key))
    assert not shown.isVisible()
    send(panel, DragImageRendered(bytes(data.data()), 2.0))
    assert not shown.isVisible(), "it came too late"


def test_block_dropped_on_a_tab_opened_during_the_drag_is_moved_to_that_tab(panel, window) -> None:
    session = window.session
    home = session.document
    home.apply_edit(WorkspaceJson.from_blocks({"blocks": {"blocks": [{"type": "events_started"}]}}))
    other = session.documents.new()
    title = panel.title_widget()
    title.resize(900, 34)
    title.show()
    panel.refresh()
    for key, times in ((home.key, 0), (other.key, 1)):
        tab = title.tabs.tabs[key]
        place = tab.mapToGlobal(tab.rect().center())
        send(panel, BlocksDraggedOutside(at(place), home.key))
        assert tab.is_drop_target == bool(times)
        send(panel, BlocksDraggedOutside(None, other.key))
        send(panel, BlocksDroppedOutside(at(place)))
        assert editor(panel).count("move_dragged_blocks") == times


def test_plus_button_is_highlighted_under_a_dragged_block_and_requests_a_new_behaviour(panel, window) -> None:
    title = panel.title_widget()
    title.resize(900, 34)
    title.show()
    tabs = title.tabs
    place = tabs.add.mapToGlobal(tabs.add.rect().center())
    send(panel, BlocksDraggedOutside(at(place), window.session.document.key))
    assert tabs.add.is_drop_target
    send(panel, BlocksDraggedOutside(None, window.session.document.key))
    assert not tabs.add.is_drop_target
    send(panel, BlocksDroppedOutside(at(place)))
    assert window.commands == ["file.new"]
    assert editor(panel).count("move_dragged_blocks") == 0, "no new one came: the block stays"


def test_missing_system_libraries_show_a_message_and_the_python_view_still_works(
    qtbot, window: Window
) -> None:
    tries: list[QWidget] = []

    def fail(parent: QWidget) -> Editor:
        tries.append(parent)
        raise ImportError("libnss3.so: cannot open shared object file: No such file or directory")

    panel = BehaviourPanel(window.context(), fail)
    qtbot.addWidget(panel)
    qtbot.addWidget(panel.title_widget())
    for _ in range(10):
        panel.refresh()
    assert len(tries) == 1
    (told,) = panel.findChildren(EmptyState)
    words = " ".join(label.text() for label in told.findChildren(QLabel))
    assert "sudo apt install libnss3" in words
    alert = window.session.alerts.get(ALERT_ID)
    assert alert is not None
    assert alert.severity == "error"
    panel.set_mode("python")
    assert panel.program.toPlainText()
    panel.dispose()
