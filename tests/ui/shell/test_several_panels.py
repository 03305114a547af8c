"""Tests of several panels of one kind, each with its own topic, also after a restart."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel

from app.core.session import Session
from app.ui.panels.base import PanelContext
from app.ui.shell.dialogs.command_palette import GROUP_TITLES, CommandPalette
from app.ui.shell.docking.dock import Dock, format_key, parse_key
from app.ui.shell.docking.layouts import layout_named
from app.ui.shell.docking.workbench import MAX_PANELS_PER_KIND, Workbench
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from app.ui.widgets.lists.entry_list import Heading
from tests.ui.shell_parts import PANELS, Answers, PlainPanel

pytest_plugins = ["tests.ui.shell_fixtures"]
MORE = "Open another panel to the side"


class TopicPanel(PlainPanel):
    """Panel that shows a topic in its title and saves it in its state, like the inspector."""

    def show_topic(self, name: str) -> None:
        self.set_title(self._title, name)

    def save_state(self) -> dict[str, object]:
        return {"topic": self.subtitle()}

    def restore_state(self, state) -> None:
        self.show_topic(str(state.get("topic", "")))


def of_topics(name: str):
    def make(context: PanelContext) -> TopicPanel:
        return TopicPanel(context, PANELS[name].title)

    return replace(PANELS[name], make=make, allows_multiple=True)


SEVERAL = {**PANELS, "inspector": of_topics("inspector"), "image": of_topics("image")}


@pytest.fixture
def window(qtbot, theme: Theme, session: Session, answers: Answers) -> Iterator[MainWindow]:
    made = MainWindow(session, theme, SEVERAL, [], dialogs=answers)
    qtbot.addWidget(made)
    theme.set_motion("on")
    theme.apply()
    made.resize(1440, 900)
    yield made
    made.close()


@pytest.fixture
def bench(qtbot, window: MainWindow) -> Workbench:
    window.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    made = window.show_layout("developer")
    qtbot.waitUntil(made.docks["inspector"].is_displayed)
    return made


def choose(dock: Dock, words: str) -> None:
    next(action for action in dock.menu().actions() if action.text() == words).trigger()


def topic_of(bench: Workbench, key: str) -> str:
    return bench.docks[key].panel.subtitle()


def apart(one: Dock, other: Dock) -> bool:
    return not one.geometry().intersects(other.geometry()) and other not in one.parent().tabifiedDockWidgets(
        one
    )


@pytest.mark.parametrize(
    ("key", "kind"),
    [
        ("plot", ("plot", 1)), ("plot#2", ("plot", 2)), ("plot#12", ("plot", 12)), ("plot#1", ("plot#1", 1)),
        ("plot#0", ("plot#0", 1)), ("plot#02", ("plot#02", 1)), ("plot#-2", ("plot#-2", 1)),
        ("#2", ("#2", 1)), ("", ("", 1)), ("plot#", ("plot#", 1)), ("a#b#3", ("a#b", 3)),
        ("plot#²", ("plot#²", 1)), (f"plot#{2**64}", (f"plot#{2**64}", 1)),
    ],
)  # fmt: skip
def test_panel_key_encodes_kind_and_number(key, kind) -> None:
    assert parse_key(key) == kind
    assert format_key(*kind) == key


def test_additional_panel_opens_next_to_the_first_with_a_number_and_its_own_topic(
    qtbot, bench, window
) -> None:
    first = bench.docks["inspector"]
    first.panel.show_topic("/odom")
    choose(first, MORE)
    second = bench.docks["inspector#2"]
    qtbot.waitUntil(lambda: first.is_displayed() and second.is_displayed() and apart(first, second))
    assert (first.panel.title(), second.panel.title()) == ("Inspector", "Inspector 2")
    assert second.accessibleName() == second.panel.accessibleName() == "Inspector 2"
    assert second.isAncestorOf(QApplication.focusWidget())
    second.panel.show_topic("/cmd")
    assert (first.panel.subtitle(), second.panel.subtitle()) == ("/odom", "/cmd")
    # taller than wide: the split is vertical, with about equal heights
    qtbot.waitUntil(lambda: abs(first.height() - second.height()) < 0.2 * first.height())
    assert first.x() == second.x()


def test_additional_panel_next_to_a_tabbed_dock_keeps_the_tabs(qtbot, bench, window) -> None:
    first = bench.docks["image"]
    bench.tabifyDockWidget(first, bench.docks["console"])
    first.raise_()
    qtbot.waitUntil(lambda: bench.docks["console"] in bench.tabifiedDockWidgets(first))
    choose(first, MORE)
    second = bench.docks["image#2"]
    qtbot.waitUntil(lambda: first.is_displayed() and second.is_displayed() and apart(first, second))
    qtbot.waitUntil(lambda: first.title.tabs == ("Image", "Console"))
    assert second.title.tabs == ()


def test_single_instance_panel_offers_no_additional_panel(bench) -> None:
    assert MORE not in [action.text() for action in bench.docks["topics"].menu().actions()]
    assert bench.open("topics#2") is None
    assert bench.open("inspector#9") is None
    assert bench.open(f"inspector#{2**64}") is None


def test_number_of_panels_of_a_kind_is_limited(bench, window) -> None:
    opened = [bench.open_another("image") for _ in range(MAX_PANELS_PER_KIND)]
    assert len([dock for dock in opened if dock is not None]) == MAX_PANELS_PER_KIND - 1
    assert window.toast.text == f"The maximum of {MAX_PANELS_PER_KIND} panels of this kind is already open"


def test_panels_are_restored_with_their_topics_after_restart(qtbot, bench, window) -> None:
    for key, topic in (("inspector", "/odom"), ("inspector#2", "/cmd"), ("image#2", "/camera")):
        dock = bench.docks.get(key) or bench.open_another(parse_key(key)[0])
        assert dock is not None
        assert dock.key == key
        dock.panel.show_topic(topic)
    qtbot.waitUntil(
        lambda: all(bench.docks[key].is_displayed() for key in ("inspector", "inspector#2", "image#2"))
    )
    places = {key: dock.geometry() for key, dock in bench.docks.items() if dock.is_displayed()}
    kept = json.loads(json.dumps(bench.save()))
    bench.reset_layout()
    assert "inspector#2" not in bench.docks
    again = Workbench(window.theme, layout_named("developer"), SEVERAL, window.context)
    qtbot.addWidget(again)
    again.resize(bench.size())
    assert again.restore(kept)
    again.show()
    assert [topic_of(again, key) for key in ("inspector", "inspector#2", "image#2")] == [
        "/odom", "/cmd", "/camera",
    ]  # fmt: skip
    qtbot.waitUntil(lambda: places == {key: again.docks[key].geometry() for key in places})
    again.dispose()


def test_panel_is_styled_once_when_its_layout_is_opened(window: MainWindow) -> None:
    labels: list[StyledLabel] = []

    class LabelPanel(PlainPanel):
        def __init__(self, context: PanelContext, title: str) -> None:
            super().__init__(context, title)
            labels.append(StyledLabel(self))
            labels[-1].ensurePolished()  # as the size of a scroll area's contents does

    panels = {**PANELS, "topics": replace(PANELS["topics"], make=lambda c: LabelPanel(c, "Topics"))}
    bench = Workbench(window.theme, layout_named("developer"), panels, window.context, window.pages)
    window.pages.addWidget(bench)
    bench.reset_layout()
    assert "topics" in bench.docks
    assert [label.style_count for label in labels] == [1]
    bench.dispose()


class StyledLabel(QLabel):
    """Label that counts how often the style sheet is applied to it."""

    style_count = 0

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        self.style_count += event.type() == QEvent.Type.StyleChange


def test_layouts_of_earlier_and_later_versions_are_restored(qtbot, bench) -> None:
    kept = json.loads(json.dumps(bench.save()))
    bench.open_another("inspector")
    assert bench.restore(kept)
    assert "inspector#2" not in bench.docks
    later = {**kept, "open": [*kept["open"], "inspector#3", "hologram#2", "topics#2", "inspector#99", 7]}
    assert bench.restore(later)
    assert [key for key in bench.open_names() if "#" in key] == ["inspector#3"]


def test_closed_additional_panel_is_destroyed_and_can_be_restored(qtbot, bench, window) -> None:
    second = bench.open_another("inspector")
    assert second is not None
    panel = second.panel
    assert isinstance(panel, TopicPanel)
    panel.show_topic("/cmd")
    choose(second, "Close")
    assert panel.closed, "it looks at nothing any more"
    assert "inspector#2" not in bench.docks
    window.tick()
    assert window.toast.text == "Closed Inspector 2"
    window.toast.button.click()
    assert topic_of(bench, "inspector#2") == "/cmd"
    assert bench.docks["inspector#2"] is not second


def test_first_panel_of_a_kind_is_hidden_and_reused_when_closed_and_reopened(bench) -> None:
    first, second = bench.docks["inspector"], bench.open_another("inspector")
    assert second is not None
    first.close()
    assert bench.docks["inspector"] is first
    again = bench.open_another("inspector#2")
    assert again is first, "the free number is the first"


def test_topic_opens_in_the_last_used_panel_or_in_an_additional_panel(qtbot, bench, window) -> None:
    window.open_topic("/a")
    assert topic_of(bench, "inspector") == "/a"
    window.context.open_to_side("/b")
    assert topic_of(bench, "inspector#2") == "/b"
    window.open_topic("/c")
    assert (topic_of(bench, "inspector"), topic_of(bench, "inspector#2")) == ("/a", "/c")
    bench.focus_panel(bench.docks["inspector"])
    bench.focus_panel(bench.docks["topics"])
    window.open_topic("/d")
    assert (topic_of(bench, "inspector"), topic_of(bench, "inspector#2")) == ("/d", "/c")
    bench.docks["inspector"].panel.show_topic("")
    window.context.open_to_side("/e")
    assert topic_of(bench, "inspector") == "/e", "one that shows nothing yet is taken first"


def test_menu_and_palette_list_the_additional_panels(bench, window) -> None:
    bench.open_another("inspector")
    menus = window.commands.menus
    menus._refresh("View")
    entries = {entry.text(): entry for entry in menus._panel_menu.actions()}
    assert entries["Inspector 2"].isChecked()
    entries["Inspector 2"].trigger()
    assert "inspector#2" not in bench.docks
    found = {entry.text: entry for entry in window.commands.view._entries.all()}
    window.commands.view.run_entry(found["Another panel: Inspector"])
    assert "inspector#2" in bench.docks


def test_command_for_an_additional_panel_is_found_in_the_palette(bench, window, qtbot) -> None:
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    window.commands.run("palette.open")
    palette = window.findChild(CommandPalette)
    assert palette is not None
    lines = palette.rows.line_model.lines
    assert "Another panel" in [line.text for line in lines if isinstance(line, Heading)]
    palette.field.setText("Another panel: Inspector")
    QTest.keyClick(palette.field, Qt.Key.Key_Return)
    assert "inspector#2" in bench.docks
    assert bench.docks["inspector#2"].isVisible()


def test_every_entry_kind_in_the_palette_has_a_heading(bench, window) -> None:
    kinds = {entry.kind for entry in window.commands.view._entries.all()}
    assert kinds <= GROUP_TITLES.keys()
    assert "another" in kinds
