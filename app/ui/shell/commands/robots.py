"""Commands for robots, network access, and the replacement of missing robots."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from app.core.session import Session
from app.errors import SettingsError
from app.intents import ReplaceRobot
from app.robots.virtual_models import VirtualModel, virtual_models
from app.ui.intents import Undo
from app.ui.shell.commands.shell import Shell
from nep.i18n import _
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.ui.shell.dialogs import network_access, other_networks, web_pages
else:  # imported after the window is shown
    network_access = lazy_module("app.ui.shell.dialogs.network_access")
    other_networks = lazy_module("app.ui.shell.dialogs.other_networks")
    web_pages = lazy_module("app.ui.shell.dialogs.web_pages")


class RobotCommands:
    """Handlers of the commands for robots and for access to the network."""

    def __init__(self, shell: Shell, session: Session) -> None:
        self._shell, self._session = shell, session
        self._network_access: network_access.NetworkAccessSheet | None = None
        self._other_networks: other_networks.OtherNetworksSheet | None = None
        self._web_pages: web_pages.WebPagesSheet | None = None

    def toggle_reset_before_run(self) -> None:
        """Toggle the setting that virtual robots return to their start position before each run."""
        fleet = self._session.fleet
        try:
            fleet.set_resets_at_start(is_enabled=not fleet.resets_at_start)
        except SettingsError as error:
            self._shell.log_problem(str(error))

    def start_pepper(self) -> None:
        """Start the virtual Pepper without changing the layout."""
        self._session.launcher.start_virtual_robot()

    def use_virtual_pepper(self) -> None:
        """Start the virtual Pepper and show the Behaviour layout."""
        self.start_pepper()
        if self._shell.current_layout != "behaviour":  # otherwise the focus stays where it is
            self._shell.show_layout("behaviour")

    def use_virtual(self, robot: VirtualModel) -> None:
        """Start a virtual robot; on the start page, show the Behaviour layout."""
        self._session.launcher.start_virtual_robot(robot.name, robot.model)
        if self._shell.bench is None:
            self._shell.show_layout("behaviour")
        self._shell.show_toast(
            _("Starting the virtual {robot}").format(robot=robot.name),
            until=lambda: not self._is_starting(robot.name),
        )

    def _is_starting(self, name: str) -> bool:
        return name in self._session.starting_robots

    def stop_virtual(self, name: str = "") -> bool:
        """Stop a virtual robot that this Studio has started, and don't restart it at the next start.

        Args:
            name: Name of the robot; "" stops all of them.

        Returns:
            False if there is no such robot.
        """
        launcher = self._session.launcher
        names = [robot for robot in launcher.models_by_name if name in {"", robot}]
        for robot in names:
            launcher.stop_virtual_robot(robot)
        return bool(names)

    def reconnect(self, name: str) -> None:
        """Restart a missing virtual robot; show the Robots panel for a real robot or an unknown model."""
        kind = self._description(name).get("rb:robot")
        model = _virtual_model(kind) if isinstance(kind, Mapping) and kind.get("virtual") is True else None
        if model is not None:
            self._session.launcher.restart_virtual_robot(name, model)
        else:
            self._shell.open_panel("robots")

    def start_virtual_model(self, missing: str) -> bool:
        """Start a virtual robot in place of a missing one; return False if its model has no virtual robot.

        Shows a toast with an Undo button.
        """
        model = _virtual_model(self._description(missing).get("rb:robot"))
        if model is None:
            return False
        launcher = self._session.launcher
        launcher.restart_virtual_robot(missing, model)
        self._shell.show_toast(
            _("Starting the virtual {robot}").format(robot=missing),
            _("Undo"),
            lambda: launcher.stop_virtual_robot(missing),
            until=lambda: not self._is_starting(missing),
        )
        return True

    def _description(self, name: str) -> Mapping[str, object]:
        # The last description received, or the one saved in the behaviour.
        link = self._session.fleet.link(name)
        return link.robot.source if link is not None else self._session.document.robots.get(name, {})

    def replace_robot(self, swap: ReplaceRobot) -> bool:
        """Replace a missing robot in the behaviour; return False if the new one is unknown.

        Shows a toast with an Undo button.

        Args:
            swap: Names of the missing robot and of its replacement.
        """
        link = self._session.fleet.link(swap.replacement)
        if link is None:
            return False
        project, robot = self._session.document, link.robot

        def replace() -> None:
            if project.replace_missing_robot(swap.missing, robot):
                message = _("Replaced {other} with {robot}")
                message = message.format(robot=swap.replacement, other=swap.missing)
                self._shell.show_toast(message, _("Undo"), lambda: self._shell.request(Undo()))

        self._shell.flush(replace)
        return True

    def revoke_motion_permissions(self) -> None:
        """Revoke all permissions of real robots to move, so that Studio asks again before a movement."""
        message = _("Studio will ask again before a real robot moves")
        try:
            self._session.fleet.permission.revoke_all()
        except SettingsError as error:
            self._shell.log_problem(str(error))
            message = _("Until you close Studio, it will ask again before a real robot moves")
        self._shell.show_toast(message)

    def open_network_access(self) -> None:
        """Open the sheet that controls access from other computers."""
        if self._network_access is None:
            self._network_access = network_access.NetworkAccessSheet(
                self._shell.theme, self._shell.surface, self._session.remote_access
            )
        self._network_access.open()

    def open_other_networks(self) -> None:
        """Open the sheet to select other networks to monitor."""
        if self._other_networks is None:
            self._other_networks = other_networks.OtherNetworksSheet(
                self._shell.theme, self._shell.surface, self._session.live.networks
            )
        self._other_networks.open()

    def open_web_pages(self) -> None:
        """Open the sheet of the web server."""
        if self._web_pages is None:
            self._web_pages = web_pages.WebPagesSheet(
                self._shell.theme,
                self._shell.surface,
                self._session.web_pages,
                self._robot_names,
                self._shell.show_toast,
            )
        self._web_pages.open()

    def _robot_names(self) -> tuple[str, ...]:
        return tuple(link.name for link in self._session.fleet.connected)


def _virtual_model(kind: object) -> str | None:
    # None if there is no virtual robot of the model.
    model = str(kind.get("model")) if isinstance(kind, Mapping) else ""
    return model if model in virtual_models() else None
