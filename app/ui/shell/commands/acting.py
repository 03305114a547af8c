"""Commands for manual operation: publish a message, call a service."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from app.core.network.topics import split_key
from app.ui.shell.commands.shell import Shell
from nep.i18n import _


@runtime_checkable
class SupportsActing(Protocol):
    """Panel that sends messages or calls services."""

    def open_for(self, name: str) -> None:
        """Select a topic or service; "" selects none."""


class ActingCommands:
    """Opens the panels for manual sending. Nothing is sent before the user arms them."""

    def __init__(self, shell: Shell) -> None:
        self._shell = shell

    def publish(self, key: str = "") -> bool:
        """Open a new message for the topic `key`, or without a topic for ""."""
        if split_key(key)[0]:
            self._shell.show_toast(_("Only topics of Studio's own network can be published to"))
            return False
        return self._open("publish", key)

    def call(self, service: str) -> bool:
        """Show the request form of a service, or all services for ""."""
        return self._open("services", service)

    def _open(self, panel: str, name: str) -> bool:
        if self._shell.bench is None:
            self._shell.show_layout("developer")
        dock = self._shell.open_panel(panel)
        if dock is None or not isinstance(dock.panel, SupportsActing):
            return False
        if name or panel == "publish":
            dock.panel.open_for(name)
        return True
