"""Tests that tooltips, labels, menus and views do not interpret names from the network as markup."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QAbstractListModel, QModelIndex, Qt
from PySide6.QtGui import Qt as Guessing
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QAbstractItemView, QLabel, QMenu, QWidget

import app.ui
from app.intents import Inspect
from app.ui.panels.base import PanelWidget
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.bars.banner import AlertBanner
from app.ui.shell.docking.dock import Dock
from app.ui.text import plain
from app.ui.theme.theme import Theme
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, ticks
from tests.ui.sample_data import pepper

pytest_plugins = ["tests.ui.shell_fixtures"]

NAME = '<img src="/etc/passwd"> & <b>R</b>'


@pytest.mark.parametrize(
    "words", [NAME, "<b>x", "<!doctype html>", "<?xml?>", "a\n<i>b</i>", "x < y", "&amp;", "", "a  b"]
)
def test_tooltip_shows_exactly_the_text(qapp, words: str) -> None:
    tip = plain.tip(words)
    if not Guessing.mightBeRichText(tip):
        assert tip == words
        return
    shown = QTextDocument()
    shown.setHtml(tip)
    assert shown.toPlainText() == words
    assert "<img" not in tip


def test_menu_shows_exactly_the_name(qtbot) -> None:
    menu = QMenu()
    qtbot.addWidget(menu)
    action = menu.addAction(plain.escape_menu_text("R&D\t<b>Ctrl+Q</b>"))
    assert action.text() == "R&&D <b>Ctrl+Q</b>"


def test_every_dynamic_tooltip_uses_the_escaping_function() -> None:
    found = [
        f"{path.name}: {given[0].strip()}"
        for path in Path(app.ui.__file__).parent.rglob("*.py")
        for given in re.finditer(r"\.setToolTip\(\s*(.*)", path.read_text("utf-8"))
        if not re.match(r'"[^"]*"\)$|(NAME_COLUMN, )?plain\.tip\(', given[1])
    ]
    assert not found


def hostile() -> Window:
    """Return a window on a session in which all names from the network look like markup."""
    session = Session.full()
    for topic in list(session.shown.topics):
        topic.name = f"{topic.name}{NAME}"
        topic.msg_type = f"{NAME}{topic.msg_type}"
        topic.publisher_nodes = (NAME,)
    link = session.fleet.links[0]
    robot = pepper(f"Pepper{NAME}")
    actions = [replace(action, title=f"{action.title} {NAME}") for action in robot.actions]
    link.robot = replace(robot, actions=tuple(actions))
    session.fleet.revision += 1
    session.alerts.raise_alert("a", "error", NAME, NAME, button=NAME, intent=Inspect(NAME))
    session.console.add("error", NAME, NAME)
    return Window(session)


def shown(view: QAbstractItemView) -> Iterator[str]:
    """Return the tooltips of a view, for at most 50 rows per parent."""
    model = view.model()

    def below(parent: QModelIndex) -> Iterator[str]:
        for row in range(min(50, model.rowCount(parent))):
            for column in range(1 if isinstance(model, QAbstractListModel) else model.columnCount(parent)):
                index = model.index(row, column, parent)
                yield str(index.data(Qt.ItemDataRole.ToolTipRole) or "")
                yield from below(index)

    if model is not None:
        yield from below(QModelIndex())


@pytest.mark.parametrize("name", [name for name in PanelRegistry() if name != "behaviour"])
def test_no_panel_interprets_a_name_as_markup(qtbot, name: str) -> None:
    window = hostile()
    panel = PanelRegistry()[name].make(window.context())
    assert isinstance(panel, PanelWidget)
    dock = Dock(window.theme, PanelRegistry()[name], panel, "comfortable")
    qtbot.addWidget(dock)
    dock.resize(900, 600)
    dock.show()
    ticks(window, panel, 2)
    for topic in list(window.session.shown.topics)[:2]:
        panel.show_topic(topic.name)
        ticks(window, panel)
    for widget in dock.findChildren(QWidget):
        assert "<img" not in widget.toolTip(), widget
        if isinstance(widget, QLabel):
            told = widget.text()
            markup = widget.textFormat() != Qt.TextFormat.PlainText and Guessing.mightBeRichText(told)
            assert not (markup and "<img" in told), widget
        if isinstance(widget, QAbstractItemView):
            assert not any("<img" in tip for tip in shown(widget)), widget
    panel.dispose()


def test_banner_shows_names_literally(qtbot, theme: Theme) -> None:
    window = hostile()
    banner = AlertBanner(theme)
    qtbot.addWidget(banner)
    banner.show_alerts(window.session.alerts.active)
    for label in banner.findChildren(QLabel):
        assert "<img" not in label.text() or label.textFormat() == Qt.TextFormat.PlainText
