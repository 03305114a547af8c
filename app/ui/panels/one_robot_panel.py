"""Base class of panels that show one robot at a time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from PySide6.QtGui import QShowEvent

from app.ui.panels.base import PanelContext, PanelWidget

if TYPE_CHECKING:
    from app.core.network.watches import Suspendable, Watch
    from app.core.robots.robot_link import RobotLink


class OneRobotPanel(PanelWidget):
    """Base class of panels that show one robot at a time, by default `Fleet.current`.

    A robot that disconnects stays visible until another one is available. Subclasses implement
    `fleet_changed`, called when robots connect, disconnect or are selected; `show_robot`, called to
    build the widgets for another robot or after `rebuild_key` changed; and `refresh_robot`, called on
    every refresh.
    """

    def __init__(self, context: PanelContext, title: str) -> None:
        super().__init__(context, title)
        self._robot = ""
        self._shown_rebuild_key: object = None  # value of `rebuild_key` for the robot shown
        self._watch: Watch | None = None
        self._revision = -1

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self.session.fleet.revision != self._revision:
            # before the first paint: otherwise the empty state would flash until the next tick
            self.refresh()

    def refresh(self) -> None:
        fleet = self.session.fleet
        if fleet.revision != self._revision:
            self._revision = fleet.revision
            self.fleet_changed()
            link = self.robot_to_show()
            if link is not None and self.rebuild_key(link) != self._shown_rebuild_key:
                self.switch_to(link)
        self.refresh_robot(fleet.link(self._robot) if self._robot else None)

    def switch_to(self, link: RobotLink) -> None:
        """Switch to a robot and watch its topics."""
        self.dispose()
        self._robot, self._shown_rebuild_key, self._revision = (
            link.name,
            self.rebuild_key(link),
            self.session.fleet.revision,
        )
        self._watch = self.session.fleet.watch_sensors(link.name)
        self.show_robot(link)

    # -- overridden by subclasses -------------------------------------------------------------------------

    def robot_to_show(self) -> RobotLink | None:
        """Return the robot to show; None leaves the current one."""
        fleet = self.session.fleet
        return fleet.current or fleet.link(self._robot)

    def rebuild_key(self, link: RobotLink) -> object:
        """Return a value that changes when `show_robot` must build the panel's widgets again."""
        return link.name

    def fleet_changed(self) -> None:
        """Update the panel after robots connected, disconnected or were selected; does nothing by default."""

    def show_robot(self, link: RobotLink) -> None:
        """Build the widgets for a robot."""

    def refresh_robot(self, link: RobotLink | None) -> None:
        """Update the panel to the current state of the robot.

        Args:
            link: Robot shown, which may be disconnected; None if no robot was shown yet or it is
                unknown now.
        """

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (self._watch,)

    def dispose(self) -> None:
        if self._watch is not None:
            self._watch.close()
            self._watch = None
        self._shown_rebuild_key, self._revision = None, -1
