"""What a master tells beside its work: its alerts, to the terminal that it runs in and to the log records."""

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

__all__ = ["AlertChanges", "AlertLog", "AlertPrinter"]

_LIBRARY = "nep"


class AlertChanges:
    """Which alerts are new or say something else than before, and which are cured."""

    def __init__(self) -> None:
        self._known: dict[str, Alert] = {}

    def take(self, view: GraphView) -> tuple[Sequence[Alert], Sequence[Alert]]:
        """(new ones, cured ones) since the last time."""
        now = {alert.id: alert for alert in view.alerts}
        cured = [self._known.pop(id) for id in [known for known in self._known if known not in now]]
        new = [alert for id, alert in now.items() if self._known.get(id) != alert]
        self._known.update({alert.id: alert for alert in new})
        return new, cured


class AlertPrinter:
    """Attached to the master: writes each alert to `out` when it comes, and when it is cured.

    It does so in the master's thread: `out` must not let it wait, see `nep.system.terminal`.
    """

    def __init__(self, out: Terminal) -> None:
        self._out = out
        self._changes = AlertChanges()

    def start(self, _master: Master) -> None:
        """See `Attachment`."""

    def changed(self, view: GraphView) -> None:
        """See `Attachment`."""
        new, cured = self._changes.take(view)
        for alert in cured:
            cured_now = escaped(_("cured: {sentence}").format(sentence=alert.sentence))
            console(out=self._out).print(cured_now, style="green", markup=False)
        show_alerts(new, self._out)

    def close(self) -> None:
        """See `Attachment`."""


class AlertLog:
    """Attached to the master: publishes its alerts, and what the library warns of, as log records.

    They come from a node "master", which exists for the others as soon as there is something to tell.
    """

    def __init__(self) -> None:
        self._changes = AlertChanges()
        self._node: Node | None = None

    def start(self, master: Master) -> None:
        """See `Attachment`."""
        self._node = Node("master", master=master.address, wait_s=3.0)
        self._node.log.propagate = False  # the terminal has the alerts already
        logging.getLogger(_LIBRARY).addHandler(self._node.log_handler)

    def changed(self, view: GraphView) -> None:
        """See `Attachment`."""
        if self._node is None:
            return
        new, cured = self._changes.take(view)
        for alert in cured:
            self._node.log.info("cured: %s", alert.sentence)
        for alert in new:
            self._node.log.warning("%s", f"{alert.sentence}. {alert.hint}".removesuffix(". "))

    def close(self) -> None:
        """See `Attachment`."""
        node, self._node = self._node, None
        if node is not None:
            logging.getLogger(_LIBRARY).removeHandler(node.log_handler)
            node.close(0.5)
