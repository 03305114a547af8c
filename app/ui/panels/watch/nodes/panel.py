"""Nodes panel: nodes of all networks shown, with their publishers, subscribers and parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QModelIndex, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QVBoxLayout

from app.core.network.source import NODE_NAME
from app.core.networks.networks import network_label
from app.core.networks.parameters import NodeParameters
from app.ui.panels.base import Density, Panel, PanelContext
from app.ui.panels.home import RowHome, TabHome
from app.ui.panels.network_table import NetworkTable, are_own_nodes
from app.ui.panels.row_actions import RowAction, copy_action, node_actions, show_messages, topic_actions
from app.ui.panels.table_panel import TableTexts
from app.ui.panels.watch.nodes.parameters import ParametersView
from app.ui.panels.watch.nodes.rows import (
    NodeRow,
    columns,
    details_text,
    limits_text,
    no_parameters_reason,
    rows_of,
)
from app.ui.text.numbers import rate_text
from app.ui.widgets import ContentScrollArea
from app.ui.widgets.paint import show_when
from app.ui.widgets.table.model import TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from app.core.network.nodes import NodeEntry
    from app.core.network.watches import Suspendable

TABLE_TEXTS = TableTexts(
    title=lazy("Nodes"),
    filter=lazy("Filter nodes"),
    no_matches=lazy("No matching nodes"),
    clear_filter_hint=lazy("Clear the filter to see all nodes."),
    not_recorded=lazy("Recordings don't contain programs"),
)
SORT_TICKS = 30  # refreshes at 30 Hz: changing columns are re-sorted once a second
CHANGING_COLUMNS = frozenset({"cpu"})


class NodesPanel(NetworkTable[NodeRow]):
    """Panel with the table of nodes and, below it, details and parameters of the selected node."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, TABLE_TEXTS, "network")
        self.table.selectionModel().currentChanged.connect(self._selection_changed)
        self._footer = ContentScrollArea(self.foot)
        session = self.session
        self._parameters = NodeParameters(
            session.live.watch,
            session.live.topic,
            session.parameters,
            lambda: session.live.master.kind == "connected",
        )
        self.parameters = ParametersView(self.theme, self._parameters)
        self.parameters.hide()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        parts = (
            (self.pages, 1),
            (self.parameters, 1),
            (self.networks, 0),
            (self.line, 0),
            (self._footer, 0),
            (self.doctor, 0),
        )
        for widget, stretch in parts:
            column.addWidget(widget, stretch)
        self._expanded_keys: set[str] = set()
        self._last_snapshot: tuple[object, ...] = ()
        self._values_revision = -1
        self._ticks = 0
        self._has_gone_nodes = False

    def make_model(self) -> TableModel[NodeRow]:
        return TableModel(columns(self._is_own), lambda row: row.key)

    def make_table(self, model: TableModel[NodeRow]) -> TableView[NodeRow]:
        table = _NodeTable(self.theme, model, "node")
        table.expand_requested.connect(self._set_expanded)
        return table

    def _is_own(self, node: NodeEntry) -> bool:
        if node.network:
            return are_own_nodes([node.name])
        return node.name in {NODE_NAME, *self.session.launcher.virtual_robots}

    def refresh(self) -> None:
        self._ticks += 1
        order = self.table.order.column
        is_sort_due = order is not None and order.name in CHANGING_COLUMNS and self._ticks % SORT_TICKS == 0
        if is_sort_due or self._snapshot() != self._last_snapshot:
            self.rebuild()
        values_revision = self.world.nodes.values_revision + self.world.networks.values_revision
        if values_revision != self._values_revision or (
            self._has_gone_nodes and self._ticks % SORT_TICKS == 0
        ):
            self._values_revision = values_revision
            self.table.refresh_visible()
        self.parameters.refresh()

    def _snapshot(self) -> tuple[object, ...]:
        session = self.session
        return session.shown.nodes.revision, session.shown.networks.revision, session.live.master.kind

    def source_changed(self) -> None:
        self._last_snapshot, self._values_revision = (), -1

    def rebuild(self) -> None:
        nodes = self.world.all_nodes
        self._last_snapshot = self._snapshot()
        self._has_gone_nodes = any(node.gone_s is not None for node in nodes)
        keywords = self.filter_words()
        matches = [node for node in nodes if all(keyword in _haystack(node) for keyword in keywords)]
        self.model.set_rows(rows_of(matches, self._expanded_keys, self.table.order, self._rate_text))
        self.filter.setVisible(len(nodes) > 0)
        self.table.refresh_visible()
        self.show_table(bool(matches), bool(keywords))
        self.show_networks()
        self._show_details()

    def _rate_text(self, name: str) -> str:
        topic = self.world.topic(name)
        return rate_text(topic.rate_hz) if topic is not None else ""

    def update_empty_state(self) -> None:
        text = _("Programs appear here as soon as they join the master.")
        self.empty.set_texts(_("No nodes yet"), text, "network")
        self.empty.set_actions([])

    def _selection_changed(self, _now: QModelIndex, _before: QModelIndex) -> None:
        self._show_details()

    def _show_details(self) -> None:
        row = self.model.row_at(self.table.currentIndex())
        is_table_visible = self.pages.currentIndex() == 0
        text = _("Expand a node to see its topics") if row is None else details_text(row.node)
        limits = limits_text(row.node) if row is not None else ""
        if row is not None:
            limits = "\n".join(filter(None, (limits, no_parameters_reason(row.node))))
        self._parameters.show(row.node if row is not None and is_table_visible else None)
        show_when(self.parameters, self._parameters.node is not None)
        self.foot.setText(f"{text}.\n{limits}" if limits else text)
        self._footer.setVisible(is_table_visible)
        self.line.setVisible(is_table_visible)

    def open_row(self, key: str) -> None:
        row = self.model.row_at(self.model.index_of(key))
        if row is None:
            return
        if row.is_pattern and self.world.topic(row.topic_key) is None:
            message = _("{pattern} has wildcards and matches several topics")
            self.context.show_toast(message.format(pattern=row.topic))
        elif row.topic:
            show_messages(self.context, row.topic_key)
        else:
            network = self.world.networks.get(row.node.network)
            (network.nodes if network is not None else self.world.nodes).mark_seen(row.node.id)
            self._set_expanded(key, row.node.key not in self._expanded_keys)

    def row_actions(self, key: str) -> Sequence[RowAction]:
        row = self.model.row_at(self.model.index_of(key))
        if row is None:
            return ()
        if row.is_pattern and self.world.topic(row.topic_key) is None:
            return (copy_action(self.context, row.topic),)  # a pattern stands for many topics
        if row.topic:
            return topic_actions(self.context, row.topic_key)
        show_action = RowAction(_("Show topics"), "list-tree", lambda: self.open_row(key))
        return (show_action, *node_actions(self.context, row.node.network, row.node.name))

    def _set_expanded(self, key: str, is_expanded: bool) -> None:
        row = self.model.row_at(self.model.index_of(key))
        if row is None or (is_expanded and row.topic):
            return
        (self._expanded_keys.add if is_expanded else self._expanded_keys.discard)(row.node.key)
        self.rebuild()
        self.table.select_key(NodeRow(row.node).key)

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (self._parameters.watch_handle,)

    def dispose(self) -> None:
        self._parameters.close()

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        self.parameters.table.set_row_height(self.row_height(), large=density == "comfortable")

    def theme_changed(self) -> None:
        super().theme_changed()
        self.parameters.table.set_row_height(self.row_height(), large=self.density == "comfortable")


class _NodeTable(TableView[NodeRow]):
    """Table of nodes; Right expands the selected node, Left collapses it."""

    expand_requested = Signal(str, bool)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = self.selected_key()
        if key is not None and event.key() in {Qt.Key.Key_Left, Qt.Key.Key_Right}:
            self.is_keyboard_navigation = True
            self.expand_requested.emit(key, event.key() == Qt.Key.Key_Right)
        else:
            super().keyPressEvent(event)


def _haystack(node: NodeEntry) -> str:
    topics = " ".join((*node.published_topics, *node.subscribed_topics))
    network = network_label(node.network)
    own_fields = f"{node.name} {node.host} {node.pid} {node.language} {node.generation} {network}"
    return f"{own_fields} {topics}".casefold()


PANEL = Panel(
    "nodes",
    TABLE_TEXTS.title,
    "network",
    (),
    NodesPanel,
    home=(TabHome("behaviour", "problems"), RowHome("developer", 2, 1, 394, tab=2)),
)
