"""Tests of the translation of every panel in the pseudo-language, which also has longer texts."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager

import pytest
from PySide6.QtCore import QAbstractItemModel, QAbstractListModel, QModelIndex, Qt
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QMenu, QWidget

from app.core.run.acting.picture_point import MESSAGE_TYPES, default_topic
from app.robots.description.inputs import Parameter
from app.robots.description.model import Robot
from app.ui.panels.base import Panel, PanelWidget
from app.ui.panels.build import behaviour
from app.ui.panels.build.behaviour.panel import BehaviourPanel
from app.ui.panels.watch.alarms.phrases import payload_text
from app.ui.panels.watch.inspector.tree_view import TreeView
from app.ui.panels.watch.nodes import rows as nodes
from app.ui.panels.watch.topics import columns as topics
from app.ui.shell.docking.dock import Dock
from app.ui.theme.theme import Theme
from app.ui.widgets.table.cells import PADDING, header_font, header_width
from nep.programs.alarms import AlarmRule
from tests.pseudo import ROOT, texts_of, untranslated
from tests.ui.clipping import clipped
from tests.ui.fakes import Session
from tests.ui.panels.test_behaviour import Editor
from tests.ui.show_panels import SIZES, shown_panel
from tools import words

pytest_plugins = ["tests.ui.shell_fixtures"]
Show = Callable[[str, Session], AbstractContextManager[tuple[Dock, PanelWidget]]]
CHOSEN = "robots.Pepper.pose.y"  # selected in the inspector
PLOTTED = ("robots.Pepper.pose.x", "robots.Pepper.pose.y", "robots.Pepper.emotion", "happy")
SHOWING = frozenset({
    "Button", "EmptyAction", "EmptyState", "FilterField", "IconButton", "LinkButton", "Menu", "Panel",
    "QAction", "QLabel", "SearchField", "addAction", "label", "say", "set", "setAccessibleDescription",
    "setAccessibleName", "setPlaceholderText", "setText", "setTitle", "setToolTip", "setWindowTitle",
    "set_name", "set_title", "set_word", "tip", "toast",
})  # fmt: skip
NOT_SHOWN = frozenset({"icon", "kind", "role", "size", "status"})
NO_WORDS = (
    "Alt+", "Ctrl", "Esc", "NEP Studio", "Return", "Shift", "Space", "bodyLarge", "font-weight",
    "textSecondary", "textTertiary",
)  # fmt: skip
"""Untranslated texts: key names, the product name, roles and style names."""
SAID = (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole, Qt.ItemDataRole.AccessibleTextRole)


def panel_of(name: str) -> Panel:
    """Return a panel by name; the Behaviour panel has a fake block editor, which is tested separately."""
    if name != "behaviour":
        return SIZES[name][0]
    make = lambda context: BehaviourPanel(context, Editor)  # noqa: E731
    return Panel("behaviour", behaviour.PANEL.title, "blocks", (), make)


def rows_of(model: QAbstractItemModel, above: QModelIndex | None = None) -> Iterator[str]:
    """Return the texts of all cells of a model, including child rows."""
    above = QModelIndex() if above is None else above
    for row in range(model.rowCount(above)):
        # QAbstractListModel.columnCount is private
        for column in range(1 if isinstance(model, QAbstractListModel) else model.columnCount(above)):
            index = model.index(row, column, above)
            yield from (text for role in SAID if isinstance(text := index.data(role), str))
            yield from rows_of(model, index)


def said_by(widget: QWidget) -> Iterator[tuple[str, str]]:
    """Return pairs of location and text for a widget, its lists and its menus."""
    yield from texts_of(widget)
    for view in widget.findChildren(QAbstractItemView):
        is_message = isinstance(view, TreeView)  # its keys and values are data
        if view.model() is not None and not is_message and not isinstance(view, QHeaderView):
            yield from ((f"{type(view).__name__} row", text) for text in rows_of(view.model()))


def said_in(panel: PanelWidget) -> Iterator[tuple[str, str]]:
    """Return pairs of location and text for a panel, its title and its menus."""
    yield "title", panel.title()
    for action in panel.more_actions():
        yield "more", action.text().partition("\t")[0]
        menu = action.menu()
        if isinstance(menu, QMenu):
            yield from (("more", each.text()) for each in menu.actions())
    for outside in (panel, *panel.header_widgets(), *filter(None, [panel.title_widget()])):
        yield from said_by(outside)


def cased(title: str) -> tuple[str, str]:
    """Return a title unchanged and with an upper-case first letter."""
    return title, title[:1].upper() + title[1:]


def texts_in(value: object) -> Iterator[str]:
    """Return all texts in a value from a robot."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for below in value.values():
            yield from texts_in(below)
    elif isinstance(value, (list, tuple)):
        for below in value:
            yield from texts_in(below)


def words_of(robot: Robot) -> Iterator[str]:
    """Return the texts of a robot's description, which are not translated by Studio."""

    def of(parameters: Iterable[Parameter]) -> Iterator[str]:
        for one in parameters:
            yield from (one.name, *cased(one.title), one.unit or "", str(one.default))
            yield from (word for choice in one.choices for word in (str(choice.value), *cased(choice.title)))

    yield from (robot.title, robot.name)
    for sensor in robot.sensors:
        yield from (sensor.name, *cased(sensor.title), sensor.unit or "")
        yield from (choice.title for choice in sensor.choices)
        yield from (word for field in sensor.fields for word in (field.name, field.title))
    for action in robot.actions:
        yield from (action.name, *cased(action.title), action.category or "")
        yield from of(action.parameters)
        yield from (field.title for field in (*action.feedback, *action.output))


def named_in(rules: Iterable[AlarmRule]) -> Iterator[str]:
    """Return the names and payloads in alarms, which come from users or programs."""
    for rule in rules:
        yield from (rule.condition.name, rule.condition.path)
        for action in rule.actions:
            yield from (action.name, payload_text(action.payload))


def data_of(session: Session) -> Iterator[str]:
    """Return texts from users, robots and the network, which are not translated."""
    yield from MESSAGE_TYPES
    for topic in session.shown.topics:
        yield default_topic(topic.name)
        yield from (topic.name, topic.msg_type, topic.msg_type.rpartition("/")[2], *topic.publisher_nodes)
    for node in session.shown.nodes:
        yield from (node.name, node.host, node.language)
    for link in session.fleet.links:
        yield from (link.name, *words_of(link.robot), *texts_in((link.values, link.drawing)))
        yield link.last_stop or ""
        yield from (text for made in link.past_invocations for text in texts_in((made.input, made.output)))
    for record in session.console.records:
        yield from (
            record.text,
            record.origin,
            record.logger,
            record.location,
            record.logger.rpartition(".")[2],
        )
    for alert in session.alerts.active:
        yield from (alert.title, alert.detail, alert.button or "")
    for finding in session.doctor.findings:
        yield from (finding.sentence, finding.fix, finding.command)
    yield "nep doctor"  # a terminal command
    yield from named_in(session.alarms.rules)
    for document in session.documents:
        yield from (document.name, "NAO")
        for problem in document.program().problems:
            yield from (problem.message, problem.subject, problem.fix or "")


@pytest.fixture
def shown(qtbot, theme: Theme) -> Show:
    """Context manager that shows a panel in its dock at its usual size."""
    theme.apply()

    @contextmanager
    def show(name: str, session: Session) -> Iterator[tuple[Dock, PanelWidget]]:
        with shown_panel(qtbot, theme, name, session) as (dock, widget):
            for _each in range(2):  # until the layouts settle
                qtbot.wait(20)
            yield dock, widget

    return show


@pytest.mark.parametrize("name", sorted(SIZES))
@pytest.mark.parametrize("session", [Session, Session.full], ids=["empty", "full"])
def test_all_texts_of_a_panel_are_translated(pseudo, shown, name, session) -> None:
    there = session()
    with shown(name, there) as (_dock, panel):
        data = {each for each in (*data_of(there), "#33aaff", CHOSEN, *PLOTTED) if each}
        forgotten = {f"{place}: {text}" for place, text in said_in(panel) if untranslated(text, *data)}
    assert "\n".join(sorted(forgotten)) == ""


@pytest.mark.parametrize("session", [Session, Session.full], ids=["empty", "full"])
def test_panel_has_room_for_longer_translations(pseudo, shown, session) -> None:
    faults = []
    for name in SIZES:
        with shown(name, session()) as (dock, _panel):
            faults += [f"{name}: {fault}" for fault in clipped(dock)]
    assert faults == []


@pytest.mark.parametrize("name", ["nodes", "topics"])
def test_table_columns_are_wide_enough_for_their_headers(pseudo, shown, name) -> None:
    with shown(name, Session.full()) as (dock, panel):
        dock.resize(1400, 500)
        panel.refresh()
        table = panel.table
        for place, column in enumerate(table.columns):
            assert table.columnWidth(place) >= header_width(table.theme, column) or table.isColumnHidden(
                place
            )
            assert table.model().headerData(place, Qt.Orientation.Horizontal, Qt.ItemDataRole.ToolTipRole)


@pytest.mark.parametrize("language", words.languages(words.LOCALE_FOLDER))
def test_headers_of_topics_and_nodes_are_not_clipped_in_any_language(theme, language) -> None:
    """A narrow table does not widen a column for its header, so the translation must be short."""
    catalog = words.read(words.po_file(words.LOCALE_FOLDER, language), language)
    metrics = QFontMetricsF(header_font(theme))
    for column in (*topics.COLUMNS, *nodes.COLUMNS):
        entry = catalog.get(column.title, getattr(column.title, "context", None))
        for head in (column.title, entry.string if entry is not None else ""):
            assert metrics.horizontalAdvance(head) + 2 * PADDING <= column.width, head


def bare_words(folder: str) -> Iterator[str]:
    """Return each call that displays an untranslated text literal, with file and line."""
    for path in sorted((ROOT / "app" / "ui" / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and _name_of(node.func) in SHOWING:
                given = [*node.args, *(each.value for each in node.keywords if each.arg not in NOT_SHOWN)]
                for each in given:
                    if any(" " in text or text[:1].isupper() for text in _constants(each) if len(text) > 1):
                        yield f"{path.name}:{each.lineno}: {ast.unparse(each)}"


def _name_of(called: ast.expr) -> str:
    return called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")


def _constants(given: ast.expr) -> Iterator[str]:
    """Return the text literals of an expression, including f-strings and both branches of a conditional."""
    if isinstance(given, ast.Constant) and isinstance(given.value, str):
        yield "".join(re.findall(r"[A-Za-z ]+", given.value)).strip()
    elif isinstance(given, ast.JoinedStr):
        for each in given.values:
            yield from _constants(each)
    elif isinstance(given, ast.IfExp):
        yield from _constants(given.body)
        yield from _constants(given.orelse)


@pytest.mark.parametrize("folder", ["panels", "pictures", "shell", "startup", "text", "widgets"])
def test_every_shown_text_is_translatable(folder) -> None:
    found = [each for each in bare_words(folder) if not any(known in each for known in NO_WORDS)]
    assert "\n".join(found) == ""
