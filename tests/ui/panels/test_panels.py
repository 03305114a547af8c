"""Tests of every panel, empty and with sample data, in both densities and themes."""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtWidgets import QAbstractButton, QLineEdit, QWidget

import app.ui.panels
import app.ui.panels.build.behaviour
from app.ui.panels.base import Panel
from app.ui.panels.build.behaviour import panel as behaviour
from app.ui.theme import icons
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, ticks
from tests.ui.panels.test_behaviour import Editor

BASES = {
    "act.armed_strip",
    "base",
    "build.variable_values",
    "command",
    "home",
    "registry",
    "network_table",
    "one_robot_panel",
    "table_panel",
    "no_robot",
    "row_actions",
}  # modules without a panel
FOLDERS = {each.name for each in pkgutil.iter_modules(app.ui.panels.__path__)} - BASES
MODULES = {
    each.name: f"{folder}.{each.name}"
    for folder in FOLDERS
    for each in pkgutil.iter_modules([f"{app.ui.panels.__path__[0]}/{folder}"])
    if f"{folder}.{each.name}" not in BASES
}
NAMES = sorted(MODULES)


@pytest.fixture(autouse=True)
def without_web(monkeypatch) -> None:
    """Behaviour panel with a fake block editor, which is tested separately."""
    made = lambda context: behaviour.BehaviourPanel(context, Editor)  # noqa: E731
    monkeypatch.setattr(
        app.ui.panels.build.behaviour, "PANEL", Panel("behaviour", "Behaviour", "blocks", (), made)
    )


def description(name: str) -> Panel:
    panel = importlib.import_module(f"app.ui.panels.{MODULES[name]}").PANEL
    assert isinstance(panel, Panel)
    return panel


@pytest.mark.parametrize("name", NAMES)
def test_each_module_exports_one_panel_of_its_name_with_a_known_icon(name) -> None:
    panel = description(name)
    assert panel.name == name
    assert panel.icon in icons.names()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("session", [Session, Session.full], ids=["empty", "full"])
def test_full_life_cycle_of_each_panel_raises_no_error(qtbot, qapp, name, session) -> None:
    window = Window(session())
    panel = window.make(description(name), (500, 400))
    qtbot.addWidget(panel)
    for widget in [*panel.header_widgets(), *([panel.title_widget()] if panel.title_widget() else [])]:
        qtbot.addWidget(widget)
    for density, mode in (("compact", "light"), ("comfortable", "dark")):
        panel.set_density(density)  # type: ignore[arg-type]
        window.theme.set_mode(mode)  # type: ignore[arg-type]
        ticks(window, panel, 7)
        assert not panel.grab().isNull()
    for topic in list(window.session.shown.topics):
        panel.show_topic(topic.name)
        ticks(window, panel, 2)
        window.session.remove(topic.name)
    for link in window.session.fleet.links:
        link.is_connected = False
    window.session.fleet.revision += 1
    ticks(window, panel, 3)
    panel.restore_state(panel.save_state())
    panel.dispose()
    panel.dispose()
    assert window.session.watched == []
    assert window.session.looked_at == []
    assert all(stream.is_closed for stream in window.session.shown.images.streams)


@pytest.mark.parametrize("name", NAMES)
def test_every_button_and_text_field_has_an_accessible_name(qtbot, qapp, name) -> None:
    window = Window(Session.full())
    panel = window.make(description(name), (1000, 700))
    qtbot.addWidget(panel)
    outside = [*panel.header_widgets(), *([panel.title_widget()] if panel.title_widget() else [])]
    for widget in outside:
        qtbot.addWidget(widget)
    assert panel.accessibleName()
    for place in (panel, *outside):
        for kind in (QAbstractButton, QLineEdit):
            controls: list[QWidget] = [*place.findChildren(kind)]
            for control in controls:
                if control.isVisibleTo(place):
                    assert control.accessibleName(), control
    panel.dispose()


@pytest.mark.parametrize(
    "name", sorted(set(NAMES) - {"behaviour"})
)  # covered by test_guidance for the web page
def test_empty_panel_shows_an_explanatory_text(qtbot, qapp, name) -> None:
    from PySide6.QtWidgets import QLabel

    window = Window(Session())
    panel = window.make(description(name))
    qtbot.addWidget(panel)
    for widget in [*panel.header_widgets(), *([panel.title_widget()] if panel.title_widget() else [])]:
        qtbot.addWidget(widget)
    said = " ".join(shown.text() for shown in panel.findChildren(QLabel) if shown.isVisible())
    assert len(said.split()) >= 5
    panel.dispose()


def imported_panels(folder: Path) -> Iterator[tuple[str, str]]:
    """Return pairs of a panel module or package and another one that it imports."""
    for path in folder.rglob("*.py"):
        own = ".".join(path.relative_to(folder).with_suffix("").parts[:2])
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("app.ui.panels"):
                for alias in node.names:
                    name = f"{node.module}.{alias.name}".removeprefix("app.ui.panels.")
                    parts = name.split(".")
                    yield own, ".".join(parts[:2]) if parts[0] in FOLDERS else parts[0]


def test_panel_modules_do_not_import_other_panels() -> None:
    found = list(imported_panels(Path(app.ui.panels.__path__[0])))
    assert ("watch.inspector", "watch.inspector") in found, "panels that are folders are read, too"
    assert [(own, other) for own, other in found if other not in {own, *BASES}] == []


@pytest.mark.parametrize("name", sorted(BASES))
def test_panel_base_modules_export_no_panel(name) -> None:
    assert not hasattr(importlib.import_module(f"app.ui.panels.{name}"), "PANEL")
