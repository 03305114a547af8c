"""What the commands about acting by hand do: publish a message on a topic, call a service."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from app.core.network.topics import split_key
from app.ui.shell.commands.shell import Shell
from nep.i18n import _


@runtime_checkable
class SupportsActing(Protocol):
    """A panel from which something is sent."""

    def begin(self, name: str) -> None:
        """Begin with this topic or service; with "" choose nothing yet."""


class ActingCommands:
    """Opens the panels where a person acts. Nothing is sent by that: they are armed there."""

    def __init__(self, shell: Shell) -> None:
        self._shell = shell

    def publish(self, key: str = "") -> bool:
        """A message for this topic, or for one that is chosen then."""
        if split_key(key)[0]:
            self._shell.say(_("Only topics of Studio's own network can be published to"))
            return False
        return self._begin("publish", key)

    def call(self, service: str) -> bool:
        """Show a service, to be called; with "" all of them."""
        return self._begin("services", service)

    def _begin(self, panel: str, name: str) -> bool:
        if self._shell.bench is None:
            self._shell.show_layout("developer")
        dock = self._shell.open_panel(panel)
        if dock is None or not isinstance(dock.panel, SupportsActing):
            return False
        if name or panel == "publish":
            dock.panel.begin(name)
        return True
