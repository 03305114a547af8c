"""Base class of tables with the rows of Studio's own network and of other networks."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.core.network.source import NODE_NAME
from app.core.networks.networks import lost_message
from app.intents import BrowseNetworks
from app.ui.panels.base import PanelContext
from app.ui.panels.table_panel import TablePanel, TableTexts
from app.ui.theme.theme import Theme
from app.ui.widgets import Separator, label
from app.ui.widgets.buttons import LinkButton
from app.ui.widgets.paint import show_when
from nep.i18n import _

Row = TypeVar("Row")


class NetworkTable(TablePanel[Row]):
    """Table panel with a line below the table that names unreachable networks."""

    def __init__(self, context: PanelContext, texts: TableTexts, icon: str) -> None:
        super().__init__(context, texts, icon)
        self.networks = NetworkLine(self.theme, lambda: context.request(BrowseNetworks()))
        self._network_count = 0
        self._networks_action = QAction(self.theme.icon("waypoints"), _("Other networks"), self)
        self._networks_action.triggered.connect(lambda _on=False: context.request(BrowseNetworks()))

    def has_other_networks(self) -> bool:
        """Return True if the table shows other networks in addition to Studio's own."""
        return bool(self.world.networks.selected_networks)

    def show_networks(self) -> None:
        """Update the line with unreachable networks and the visibility of the network column."""
        self.networks.set_messages([lost_message(each) for each in self.world.networks.selected_networks])
        if self._network_count != len(self.world.networks.selected_networks):
            self._network_count = len(self.world.networks.selected_networks)
            self.table.fit_columns()

    def more_actions(self) -> list[QAction]:
        return [*super().more_actions(), self._networks_action]


class NetworkLine(QWidget):
    """Line with the unreachable networks and a button to their settings."""

    def __init__(self, theme: Theme, on_click: Callable[[], object]) -> None:
        super().__init__()
        self.text_label = label("", "small", role="warn", wrap=True)
        self.text_label.setMinimumWidth(0)
        self.button = LinkButton(theme, _("Other networks"))
        self.button.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self.button.clicked.connect(on_click)
        row = QHBoxLayout()
        row.setContentsMargins(12, 5, 12, 5)
        row.setSpacing(8)
        row.addWidget(self.text_label, 1)
        row.addWidget(self.button, 0, Qt.AlignmentFlag.AlignTop)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(Separator(theme))
        column.addLayout(row)
        self.hide()

    def set_messages(self, messages: Sequence[str]) -> None:
        """Show sentences, one per line. The widget is hidden if all of them are empty."""
        text = "\n".join(filter(None, messages))
        self.text_label.setText(text)
        show_when(self, bool(text))


def are_own_nodes(nodes: Iterable[str]) -> bool:
    """Return True if all nodes belong to this Studio, given their names on another network.

    On ROS, the names of nodes contain the process id. Return False if `nodes` is empty.
    """
    name_prefix = f"{NODE_NAME}_{os.getpid()}_"
    names = [name.lstrip("/") for name in nodes]
    return bool(names) and all(name == NODE_NAME or name.startswith(name_prefix) for name in names)
