"""Tests of the translation of the window in the pseudo-language, which also has longer texts."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QKeyCombination, Qt
from PySide6.QtWidgets import QMenu, QWidget

from app import resources
from app.core.alerts.alerts import Alerts
from app.core.network.remote_access import RemoteAccess
from app.core.robots.motion.permission import MotionPermission
from app.core.run.view import RunState, RunView, view_of
from app.core.session import Session
from app.core.storage.settings import Settings
from app.intents import ShowAlarms
from app.robots.client.stop_report import RobotStop, StopReport
from app.ui.application import startup_problem, translate_qt
from app.ui.shell.actions.shortcuts import FIXED_KEYS
from app.ui.shell.bars.app_bar import robots_chip
from app.ui.shell.bars.status_bar import StatusFormatter
from app.ui.shell.dialogs.command_palette import CommandPalette
from app.ui.shell.dialogs.motion_permission import MotionPermissionCard
from app.ui.shell.dialogs.name import NameSheet
from app.ui.shell.dialogs.network_access import NetworkAccessSheet
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.dialogs.shortcuts import ShortcutSheet
from app.ui.shell.dialogs.version_history import VersionHistorySheet
from app.ui.shell.main_window import MainWindow, Placeholder
from app.ui.shell.projects import unknown_type_text
from app.ui.shell.start_page.page import all_examples_text, read_examples
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, StatusItem
from app.ui.widgets.lists.entry_list import EntryList, Heading
from nep import i18n
from nep.i18n import _
from nep.system.addresses import OwnAddress
from tests.pseudo import texts_of, untranslated
from tests.ui import fakes
from tests.ui.clipping import clipped
from tests.ui.shell.test_files import changed, saved
from tests.ui.shell.test_motion_permission import ROVER
from tests.ui.shell_parts import COMMANDS, NAMES, PANELS, Answers, robots_in

# on the offscreen platform, popups can't grab the keyboard
pytestmark = pytest.mark.qt_log_ignore("does not support grabbing the keyboard", extend=True)
pytest_plugins = ["tests.ui.shell_fixtures"]
SETTLE_MS = 20
EXAMPLES = read_examples(resources.folder() / "examples")
DATA = (
    *(text for each in EXAMPLES for text in (each.name, each.text)),
    *(title for title, _accepts in NAMES.values()),
    "Greeting", "Mine", "Rover", "Turtle", "topic list", "NEP_MASTER", "wlan0", "tun0", "lo",
)  # fmt: skip
"""Untranslated texts: titles of plain panels, files, examples and robots."""
KEYS = ("Delete", "PgUp", "PgDown")
ANSWERED, SILENT = RobotStop("Rover", True, 41.4), RobotStop("Turtle", False, None)
RUNS = (
    RunState(),
    RunState(unrunnable_program=object()),
    RunState(unrunnable_program=object(), errors={"a": "Greeting"}),
    RunState("running", "Greeting", is_started=False),
    RunState("running", "Greeting", last_stop_text="Rover"),
    RunState("paused", "Greeting"),
    RunState("stopping", "Greeting", robots_to_stop=("Rover", "Turtle"), replies=(ANSWERED,), elapsed_s=3.0),
    RunState(
        "proven", "Greeting", report=StopReport((ANSWERED,), 41.4), elapsed_s=3.0, has_stopped_blocks=True
    ),
    RunState("proven", "Greeting", report=StopReport((ANSWERED,), 41.4), is_finished=True),
    RunState("unanswered", "Greeting", report=StopReport((ANSWERED, SILENT), 41.4)),
)
OF_QT = ("#qt_dockwidget_", "#ScrollLeftButton", "#ScrollRightButton")
"""Buttons created and labelled by Qt: in dock titles, which Studio replaces, and for tab scrolling."""
OVER = (
    "palette.open",
    "help.shortcuts",
    "settings.open",
    "layout.keep",
    "help.about",
    "file.earlier",
    "help.report",
)


def views() -> Iterator[RunView]:
    """Return every state of Run and Stop, also for a behaviour in a background tab."""
    for run in RUNS:
        for elsewhere in (False, True):
            yield view_of(run, ["Rover", "Turtle"], 3.0, is_elsewhere=elsewhere)


def said_by(root: QWidget) -> Iterator[tuple[str, str]]:
    """Return pairs of location and text for a widget, its lists and its status items."""
    for place, text in texts_of(root):
        if not any(name in place for name in OF_QT):
            yield place, text
    for item in root.findChildren(StatusItem):
        yield "StatusItem", item.text
    for rows in root.findChildren(EntryList):
        for line in rows.line_model.lines:
            if isinstance(line, Heading):
                yield "heading", line.text
            else:
                yield from ((f"row {line.entry.id}", t) for t in (line.entry.text, line.entry.reason))
                if line.entry.kind not in {"topic", "robot"}:
                    yield f"note {line.entry.id}", line.entry.note


def forgotten(root: QWidget, *data: str) -> list[str]:
    """Return the untranslated texts of a widget with their locations."""
    return [f"{place}: {text}" for place, text in said_by(root) if untranslated(text, *DATA, *KEYS, *data)]


def settle(qtbot) -> None:
    for _each in range(2):
        qtbot.wait(SETTLE_MS)


@pytest.fixture
def language(request: pytest.FixtureRequest) -> Iterator[str]:
    """Install the language of the window: the pseudo-language unless a test names another one."""
    code = getattr(request, "param", i18n.PSEUDO_LANGUAGE)
    if code == i18n.PSEUDO_LANGUAGE:
        request.getfixturevalue("pseudo")
    else:
        i18n.install(code)
    yield code
    if code != i18n.PSEUDO_LANGUAGE:
        i18n.install(i18n.ENGLISH)


@pytest.fixture
def whole(qtbot, language: str, session: Session, theme: Theme, tmp_path: Path) -> Iterator[MainWindow]:
    """Main window with sample content for everything except the panels."""
    session.settings.add_recent(saved(tmp_path / "Mine.nepb"))
    window = MainWindow(session, theme, PANELS, EXAMPLES, dialogs=Answers())
    qtbot.addWidget(window)
    theme.set_motion("on")
    window.show()
    yield window
    window.close()


Look = Callable[[str, QWidget], None]


def everything(qtbot, window: MainWindow, look: Look) -> None:
    """Show each bar, page and sheet, and pass each to ``look``."""
    commands = window.commands
    window.tick()
    look("start page", window)
    window.start.show_all(True)
    look("all examples", window.start)
    window.session.alerts.raise_alert(
        "one", "error", _("Nothing is running"), button=_("Try again"), intent=ShowAlarms()
    )
    window.session.alerts.raise_alert("two", "error", _("Nothing is running"))
    for layout, bar in (("behaviour", window.run_bar), ("developer", window.tool_bar)):
        commands.run(f"layout.{layout}")
        window.tick()
        window._update_status_bar()
        window.toast.show_toast(_("Nothing is running"), _("Undo"), lambda: None)
        for view in views():
            bar.show_view(view)
            look(f"{layout}, {view.state}", window)
    for name in OVER:
        commands.run(name)
        (sheet,) = [each for each in window.findChildren(Overlay) if each.isVisible()]
        look(name, sheet)
        sheet.dismiss()


def test_all_texts_of_the_window_are_translated(qtbot, whole: MainWindow, tmp_path: Path) -> None:
    found: set[str] = set()
    paths = (plain.tip(str(tmp_path / "Mine.nepb")), str(whole.session.settings.pictures_folder))
    languages = [name for _code, name in i18n.selectable_languages()]  # each in its own language
    system = f"{platform.system()} {platform.release()} ({platform.machine()})"

    def look(what: str, root: QWidget) -> None:
        found.update(f"{what}: {each}" for each in forgotten(root, *paths, *languages, system))

    everything(qtbot, whole, look)
    assert "\n".join(sorted(found)) == ""


@pytest.mark.parametrize("size", [pytest.param((1440, 900), marks=pytest.mark.long), (1100, 700)])
def test_window_has_room_for_longer_translations(qtbot, whole: MainWindow, size: tuple[int, int]) -> None:
    whole.resize(*size)
    faults: list[str] = []

    def look(what: str, root: QWidget) -> None:
        settle(qtbot)
        faults.extend(f"{what}: {fault}" for fault in clipped(root))

    everything(qtbot, whole, look)
    assert "\n".join(faults) == ""


@pytest.mark.parametrize(
    "language",
    [
        # French has the longest texts, Japanese another font
        code if code in {"fr", "ja"} else pytest.param(code, marks=pytest.mark.long)
        for code, _name in i18n.selectable_languages()
        if code != i18n.ENGLISH
    ],
    indirect=True,
)
def test_window_clips_no_text_in_any_language(qtbot, whole: MainWindow) -> None:
    whole.resize(1100, 700)
    faults: list[str] = []

    def look(what: str, root: QWidget) -> None:
        settle(qtbot)
        faults.extend(f"{what}: {fault}" for fault in clipped(root))

    everything(qtbot, whole, look)
    assert "\n".join(faults) == ""


@pytest.mark.parametrize("language", ["fr"], indirect=True)
def test_tool_bar_hides_tools_instead_of_shortening_texts(qtbot, whole: MainWindow) -> None:
    whole.resize(1280, 800)
    whole.commands.run("layout.developer")
    whole.tick()
    bar = whole.tool_bar
    for view in views():
        bar.show_view(view)
        settle(qtbot)
        assert bar.needed_width() <= bar.width(), view.state
        for button in bar.findChildren(Button):
            if button.isVisible() and button is not bar.confirm:
                assert button.width() >= button.sizeHint().width() - 1, (view.state, button.text())


def test_tools_hidden_for_lack_of_room_reappear_when_there_is_room(qtbot, whole: MainWindow) -> None:
    whole.resize(2400, 800)
    whole.commands.run("layout.developer")
    bar, keep = whole.tool_bar, whole.tools.keep
    settle(qtbot)
    assert keep.isVisible()
    bar.text_label.setMinimumWidth(
        bar.width() - keep.width()
    )  # the text of a run state without room for `keep`
    bar.text_label.show()
    settle(qtbot)
    assert not keep.isVisible()
    bar.text_label.setMinimumWidth(0)
    whole.tools.refresh()
    settle(qtbot)
    assert keep.isVisible()


def test_menus_of_the_window_and_docks_are_translated(qtbot, whole: MainWindow) -> None:
    found: list[str] = []
    for layout in ("start", "behaviour", "developer"):
        if layout != "start":
            whole.commands.run(f"layout.{layout}")
        for menu in whole.findChildren(QMenu):
            menu.aboutToShow.emit()
            entries = [menu.title(), *(each.text().partition("\t")[0] for each in menu.actions())]
            found += [f"{layout}, {menu.title()}: {each}" for each in entries if untranslated(each, *DATA)]
            menu.aboutToHide.emit()
    for dock in whole.benches["developer"].docks.values():
        menu = dock.menu()
        found += [each.text() for each in menu.actions() if untranslated(each.text())]
        menu.deleteLater()
    assert found == []


def test_all_commands_and_shortcuts_are_translated(whole: MainWindow) -> None:
    shown = whole.commands.shortcuts
    whole.commands.add_panels()
    said = [text for each in COMMANDS for text in (each.label, _(each.menu), _(each.tip))]
    said += [whole.commands.actions.disabled_reason(each.id) for each in whole.commands.actions.commands]
    said += [text for each in FIXED_KEYS for text in (_(each.label), _(each.scope))]
    ctrl = Qt.KeyboardModifier.ControlModifier
    for key in (
        QKeyCombination(Qt.Key.Key_A),
        QKeyCombination(Qt.Key.Key_F12),
        QKeyCombination(ctrl, Qt.Key.Key_C),
    ):
        refusal = shown.rejection_reason("file.new", key)
        assert refusal
        said.append(refusal)
    assert [each for each in said if untranslated(each, *DATA)] == []
    assert all("{" not in each for each in said)


def test_command_palette_and_shortcut_sheet_are_translated(qtbot, whole: MainWindow) -> None:
    whole.commands.run("palette.open")
    (palette,) = whole.findChildren(CommandPalette)
    for typed in ("", "ŕúñ", "nowhere"):
        palette.field.setText(typed)
        assert forgotten(palette, "nowhere") == []
        assert untranslated(palette.foot.result_text) == []
    palette.dismiss()
    assert untranslated(" ".join(_(said) for _keys, said in palette.foot.KEY_HINTS)) == []
    whole.commands.run("help.shortcuts")
    (sheet,) = whole.findChildren(ShortcutSheet)
    told = []
    for act in (
        sheet.record,
        sheet._remove_shortcut,
        sheet._reset,
        lambda: sheet._set_status(sheet.hint.text()),
    ):
        act()
        told.append(sheet.hint.text())
    sheet.open_for("file.new")
    told.append(sheet.hint.text())
    assert [each for each in told if untranslated(each)] == []
    assert forgotten(sheet) == []


def test_version_history_is_translated(qtbot, whole: MainWindow, tmp_path: Path) -> None:
    whole.commands.files.open(tmp_path / "Mine.nepb")
    for block in "xy":
        whole.session.document.apply_edit(changed(block))
        whole.commands.run("file.save")
    whole.commands.run("file.earlier")
    (sheet,) = whole.findChildren(VersionHistorySheet)
    qtbot.waitUntil(lambda: sheet.has_read_all)
    assert len(sheet.rows.line_model.lines) == 2
    assert forgotten(sheet) == []
    assert untranslated(whole.toast.text, "Mine") == []


def test_name_sheet_is_translated(whole: MainWindow) -> None:
    whole.commands.run("layout.developer")
    whole.commands.run("layout.keep")
    (sheet,) = whole.findChildren(NameSheet)
    for name in ("", "x" * 50, _("Developer")):
        sheet.field.setText(name)
        sheet._submit()
        assert sheet.isVisible()
        assert sheet.error_label.text()
        assert forgotten(sheet) == []
    sheet.field.setText("Mine")
    sheet._submit()
    for act in ("layout.rename", "layout.delete"):
        assert forgotten(whole.toast, "Mine") == []
        whole.commands.run(act)
        assert forgotten(sheet, "Mine") == []
        sheet.dismiss()


@pytest.mark.parametrize("here", [(), (("192.168.1.20", "wlan0"), ("10.8.0.2", "tun0"))])
@pytest.mark.parametrize("address", ["127.0.0.1:7780", "192.168.1.9:7780"])
def test_network_access_sheet_is_translated(qtbot, pseudo, tmp_path: Path, here, address: str) -> None:
    own = tuple(OwnAddress(*each) for each in here)
    reach = RemoteAccess(
        address,
        Settings(tmp_path),
        Alerts(),
        print,
        request_listen=lambda _hosts, _address: None,
        local_addresses=lambda: own,
    )
    window = QWidget()
    window.resize(1100, 700)
    qtbot.addWidget(window)
    window.show()
    sheet = NetworkAccessSheet(Theme("light"), window, reach)
    sheet.open()
    settle(qtbot)
    assert forgotten(sheet) == []
    assert clipped(sheet) == []
    reach.close()


def test_motion_permission_question_is_translated(qtbot, pseudo, tmp_path: Path) -> None:
    window = QWidget()
    window.resize(1100, 700)
    qtbot.addWidget(window)
    window.show()
    moving = MotionPermission(Settings(tmp_path))
    question = MotionPermissionCard(Theme("light"), window, moving, print)
    moving.request_permission([(ROVER, ("move",))], lambda: None)
    question.refresh()
    settle(qtbot)
    assert forgotten(question, "move") == []
    assert clipped(question) == []


@pytest.mark.parametrize(
    "states",
    [
        (), ("ready",), ("busy",), ("ready", "busy"), ("stopping",), ("stopping", "stopping"), ("silent",),
        ("silent", "ready"), ("silent", "silent"), ("not stopped",), ("not stopped", "not stopped"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("run", ["ready", "running", "paused"])
def test_robots_chip_is_translated(pseudo, states: tuple[str, ...], run: str) -> None:
    words, _status = robots_chip(robots_in(*states, run=run))
    assert words
    assert untranslated(words, "Robot 1", "Robot 2") == []


@pytest.mark.parametrize("session", [fakes.Session, fakes.Session.full], ids=["empty", "full"])
def test_status_bar_items_are_translated(pseudo, session) -> None:
    facts = StatusFormatter(session())
    told = [facts.health(), facts.save_status(), facts.topics(), facts.master(), facts.traffic()]
    told += [facts.lost(), facts.displayed_messages(), facts.refresh_duration()]
    for alert in list(facts._session.alerts.active):
        facts._session.alerts.resolve(alert.id)
    told.append(facts.health())
    assert [words for _icon, words, _status in told if untranslated(words, "Pepper", "Master")] == []


def test_messages_about_files_are_translated(whole: MainWindow, tmp_path: Path) -> None:
    files, toast = whole.commands.files, whole.toast
    alerts = whole.session.alerts
    strange = [tmp_path / "a.png", tmp_path / "b.png"]
    files.open_all(strange)
    files.open(tmp_path / "gone.nepb")
    for alert in alerts.active:
        data = ("gone.nepb", "a.png", ".nepb", "No such file or directory")
        assert untranslated(f"{alert.title} {alert.detail} {alert.button}", *data) == []
    assert untranslated(" ".join(unknown_type_text(strange[:1])), "a.png", ".nepb") == []
    files.reopen()
    assert untranslated(toast.text) == []
    files.open(tmp_path / "Mine.nepb")
    whole.session.document.apply_edit(changed("x"))
    files.close(whole.session.document)
    assert untranslated(toast.text, "Mine") == []
    whole.commands.behaviours.clear_recent()
    assert untranslated(toast.text) == []


def test_startup_errors_without_a_display_are_translated(pseudo) -> None:
    data = ("DISPLAY", "WAYLAND_DISPLAY", "QTWEBENGINE_DISABLE_SANDBOX")
    assert untranslated(startup_problem({}, "linux", 1000), *data) == []
    assert untranslated(startup_problem({"DISPLAY": ":0"}, "linux", 0), *data) == []


def test_placeholders_of_layouts_and_panels_are_translated(qtbot, whole: MainWindow) -> None:
    for layout in ("behaviour", "developer"):
        place = Placeholder(layout)
        qtbot.addWidget(place)
        assert forgotten(place) == []
    bench = whole.show_layout("developer")
    dock = bench.docks["topics"]
    dock.body.show_error("", dock.retry)
    assert forgotten(dock) == []
    dock.body.show_panel()


def test_texts_of_qt_itself_are_translated(qapp, monkeypatch: pytest.MonkeyPatch) -> None:
    assert translate_qt(qapp) is None, "English has no need of it"
    monkeypatch.setattr("app.ui.application.language", lambda: "es")
    translator = translate_qt(qapp)
    assert translator is not None
    try:
        assert QCoreApplication.translate("QPlatformTheme", "Cancel") == "Cancelar"
    finally:
        qapp.removeTranslator(translator)
    monkeypatch.setattr("app.ui.application.language", lambda: "qps")
    assert translate_qt(qapp) is None, "Qt has none for a language that it does not know"


@pytest.mark.parametrize("count", [1, *range(5, 13)])
def test_link_to_all_examples_is_translated(pseudo, count: int) -> None:
    assert untranslated(all_examples_text(count)) == []
