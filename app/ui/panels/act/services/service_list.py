"""List of available services with the nodes that serve them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QModelIndex, Qt, Signal
from PySide6.QtGui import QKeyEvent

from app.core.graph.node_graph import INTERNAL_PREFIX
from app.ui.theme.theme import Theme
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.two_lines import ROW_PX, TwoLines
from app.ui.widgets.table.view import TableView
from nep.i18n import _, format_list, lazy, ngettext
from nep.protocol.graph_view import GraphView
from nep.protocol.service_wire import SURVEY_PREFIX


@dataclass(frozen=True, slots=True)
class OfferedService:
    """Service with the nodes that serve it.

    Attributes:
        name: Name of the service.
        nodes: Names of the serving nodes. The first one receives the calls.
    """

    name: str
    nodes: tuple[str, ...]

    @property
    def servers_text(self) -> str:
        """Names of the serving nodes as text, such as "face_tracker"."""
        return format_list(list(self.nodes))


def offered_services(view: GraphView | None) -> list[OfferedService]:
    """Return the available services, sorted by name. Parameter services and surveys are omitted.

    Args:
        view: Graph reported by the master, or None.
    """
    if view is None:
        return []
    services = []
    for name, info in sorted(view.services.items()):
        if info.servers and not name.startswith((INTERNAL_PREFIX, SURVEY_PREFIX)):
            nodes = [view.nodes[each.node_id].name for each in info.servers if each.node_id in view.nodes]
            services.append(OfferedService(name, tuple(dict.fromkeys(nodes))))
    return services


def count_text(services: Sequence[OfferedService]) -> str:
    """Format the numbers of services and nodes, such as "6 services of 3 nodes"; "" without services."""
    if not services:
        return ""
    nodes = len({name for each in services for name in each.nodes})
    service_text = ngettext("{count} service", "{count} services", len(services)).format(count=len(services))
    node_text = ngettext("{count} node", "{count} nodes", nodes).format(count=nodes)
    return _("{services} of {nodes}").format(services=service_text, nodes=node_text)


class ServiceList(TableView[OfferedService]):
    """List of services; a click selects a service, Ctrl+Enter calls it.

    Signals:
        selected: Name of the service that was selected by mouse or keyboard.
    """

    selected = Signal(str)
    call_requested = Signal()

    def __init__(self, theme: Theme) -> None:
        columns: tuple[Column[OfferedService], ...] = (
            Column(
                "service",
                lazy("Service"),
                90,
                lambda each: Cell(
                    mark=TwoLines(each.name, each.servers_text, mono=True),
                    accessible_text=f"{each.name}, {each.servers_text}",
                ),
                stretch=True,
                tip=lambda each: f"{each.name}\n{each.servers_text}",
            ),
        )
        super().__init__(theme, TableModel(columns, lambda each: each.name))
        self.horizontalHeader().hide()
        self.setAccessibleName(_("Services"))
        self.selectionModel().currentRowChanged.connect(lambda _new, _old: self._emit_selected())
        self.fit_rows()

    def fit_rows(self) -> None:
        """Adjust the row height to the text size."""
        self.set_row_height(round(self.theme.scaled(ROW_PX)), large=False)

    def _open(self, index: QModelIndex) -> None:
        # A click only selects.
        ...

    def _emit_selected(self) -> None:
        self.selected.emit(self.selected_key() or "")

    def keyPressEvent(self, event: QKeyEvent) -> None:
        has_ctrl = event.modifiers() == Qt.KeyboardModifier.ControlModifier
        if has_ctrl and event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.call_requested.emit()
        else:
            super().keyPressEvent(event)
