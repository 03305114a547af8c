"""Commands to publish messages and call services manually."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from app.core.network.topics import split_key
from app.ui.shell.commands.shell import Shell
from nep.i18n import _


@runtime_checkable
class SupportsActing(Protocol):
    """Interface of a panel that publishes messages or calls services."""

    def open_for(self, name: str) -> None:
        """Select a topic or service by name; "" selects none."""


class ActingCommands:
    """Handlers of the commands that open the panels Publish and Services.

    Nothing is sent before the user arms the panel.
    """

    def __init__(self, shell: Shell) -> None:
        self._shell = shell

    def publish(self, key: str = "") -> bool:
        """Open a new message in the Publish panel.

        Args:
            key: Key of the topic, or "" for a message without a topic.

        Returns:
            False if the panel can't be opened, or if the topic is in another network, to which Studio
            can't publish.
        """
        if split_key(key)[0]:
            self._shell.show_toast(_("You can only publish to topics of Studio's own network"))
            return False
        return self._open("publish", key)

    def call(self, service: str) -> bool:
        """Open the Services panel and select a service, unless `service` is "".

        Returns:
            False if the panel can't be opened.
        """
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
