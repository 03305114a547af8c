"""The gateway as something that lives with a master."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from nep.errors import ClosedError, WaitTimeoutError
from nep.gateway.gateway import Gateway
from nep.gateway.listing import Listing
from nep.gateway.native import Native
from nep.gateway.portmap import default_file
from nep.gateway.processes import SystemProcesses
from nep.gateway.request_server import Ports
from nep.masters.master import Master
from nep.nodes.node import Node
from nep.protocol.graph_view import Alert, GraphView
from nep.protocol.requests import Reply, ReportAlerts, Request
from nep.system.descriptors import allow_many
from nep.system.lazy_import import later

if TYPE_CHECKING:
    import psutil
else:
    psutil = later("psutil")

_WAIT_S = 3.0
"""A master that has just started keeps newcomers waiting for a second."""


class GatewayAttachment:
    """Joins programs of the original NEP to the master that it is attached to (`Attachment`).

    `file` keeps who has which ports; by default it lies where the system keeps such files.
    """

    def __init__(self, file: Path | None = None, ports: Ports | None = None) -> None:
        self._file = file
        self._ports = ports
        self._gateway: Gateway | None = None

    def start(self, master: Master) -> None:
        """Start the gateway. A port that is taken is an alert, not an error."""
        allow_many()
        address = master.address

        def make_node() -> Node:
            return Node("gateway", master=address, generation="gateway", wait_s=_WAIT_S)

        def submit(request: Request) -> Reply | None:
            try:
                return master.submit(request)
            except (ClosedError, WaitTimeoutError):
                return None  # the master is ending, and the graph with it

        def report(alerts: tuple[Alert, ...]) -> None:
            submit(ReportAlerts("gateway", alerts))

        native = Native(make_node, Listing(submit, master.epoch), report)
        file = self._file or default_file(int(address.rpartition(":")[2]))
        self._gateway = Gateway(native, SystemProcesses(), file, ports=self._ports, boot=psutil.boot_time())
        self._gateway.start()

    def changed(self, view: GraphView) -> None:
        """The graph has changed; the gateway follows its own sockets instead."""

    def close(self) -> None:
        """End the gateway and give its ports back."""
        if self._gateway is not None:
            self._gateway.close()
            self._gateway = None
