"""Attachments of `nep master` that report its alerts: on the terminal and as log records."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from nep.cli.screen import console, show_alerts
from nep.i18n import _
from nep.masters.master import Master
from nep.nodes.node import Node
from nep.protocol.graph_view import Alert, GraphView
from nep.system.terminal import Terminal
from nep.text import escaped

_LIBRARY_LOGGER = "nep"


class AlertTracker:
    """Tracker of alerts that returns the difference between successive graph snapshots."""

    def __init__(self) -> None:
        self._alerts: dict[str, Alert] = {}

    def update(self, view: GraphView) -> tuple[Sequence[Alert], Sequence[Alert]]:
        """Return (new or changed alerts, resolved alerts) since the previous call."""
        current = {alert.id: alert for alert in view.alerts}
        resolved = [
            self._alerts.pop(id) for id in [alert_id for alert_id in self._alerts if alert_id not in current]
        ]
        new = [alert for id, alert in current.items() if self._alerts.get(id) != alert]
        self._alerts.update({alert.id: alert for alert in new})
        return new, resolved


class AlertPrinter:
    """Master attachment that prints each alert when it appears and when it is resolved.

    Runs in the master's thread, so `out` must not block; see `nep.system.terminal`.
    """

    def __init__(self, out: Terminal) -> None:
        self._out = out
        self._tracker = AlertTracker()

    def start(self, _master: Master) -> None:
        """Do nothing; alerts are printed from the first graph change on."""

    def changed(self, view: GraphView) -> None:
        """Print the alerts that are new, changed or resolved in `view`."""
        new, resolved = self._tracker.update(view)
        for alert in resolved:
            text = escaped(_("resolved: {sentence}").format(sentence=alert.sentence))
            console(out=self._out).print(text, style="green", markup=False)
        show_alerts(new, self._out)

    def close(self) -> None:
        """Do nothing: the terminal belongs to the caller."""


class AlertLog:
    """Master attachment that publishes alerts, and warnings of the library, as log records.

    The records come from a node named "master".
    """

    def __init__(self) -> None:
        self._tracker = AlertTracker()
        self._node: Node | None = None

    def start(self, master: Master) -> None:
        """Create the node and forward log records of the library to it."""
        self._node = Node("master", master=master.address, wait_s=3.0)
        self._node.log.propagate = False  # AlertPrinter already prints the alerts
        logging.getLogger(_LIBRARY_LOGGER).addHandler(self._node.log_handler)

    def changed(self, view: GraphView) -> None:
        """Log the alerts that are new, changed or resolved in `view`."""
        if self._node is None:
            return
        new, resolved = self._tracker.update(view)
        for alert in resolved:
            self._node.log.info("resolved: %s", alert.sentence)
        for alert in new:
            self._node.log.warning("%s", f"{alert.sentence}. {alert.hint}".removesuffix(". "))

    def close(self) -> None:
        """Close the node and remove its log handler."""
        node, self._node = self._node, None
        if node is not None:
            logging.getLogger(_LIBRARY_LOGGER).removeHandler(node.log_handler)
            node.close(0.5)
