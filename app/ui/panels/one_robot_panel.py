"""A panel of one robot: which one it shows, and the watch that brings what that robot tells."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from PySide6.QtGui import QShowEvent

from app.ui.panels.base import PanelContext, PanelWidget

if TYPE_CHECKING:
    from app.core.network.watches import Suspendable, Watch
    from app.core.robots.robot_link import RobotLink


class OneRobotPanel(PanelWidget):
    """Shows the robot that a person chose to see, else the first; one that goes stays until another is there.

    Calls `fleet_changed` when robots came, went or were chosen, `show_robot` when another one is to be shown,
    and `refresh_robot` with every refresh.
    """

    def __init__(self, context: PanelContext, title: str) -> None:
        super().__init__(context, title)
        self._robot = ""
        self._shown: object = None  # what `key_of` said of it
        self._watch: Watch | None = None
        self._revision = -1

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self.session.fleet.revision != self._revision:
            self.refresh()  # before it is painted: until the next tick it would say that no robot is there

    def refresh(self) -> None:
        fleet = self.session.fleet
        if fleet.revision != self._revision:
            self._revision = fleet.revision
            self.fleet_changed()
            link = self.wanted_robot()
            if link is not None and self.key_of(link) != self._shown:
                self.turn_to(link)
        self.refresh_robot(fleet.link(self._robot) if self._robot else None)

    def turn_to(self, link: RobotLink) -> None:
        """Show this robot from now on."""
        self.shut()
        self._robot, self._shown, self._revision = link.name, self.key_of(link), self.session.fleet.revision
        self._watch = self.session.fleet.look_at(link.name)
        self.show_robot(link)

    # -- what a panel says of itself ----------------------------------------------------------------------

    def wanted_robot(self) -> RobotLink | None:
        """The robot to show now; None leaves what is shown."""
        fleet = self.session.fleet
        return fleet.shown or fleet.link(self._robot)

    def key_of(self, link: RobotLink) -> object:
        """What of a robot decides what the panel is made of: when it differs, `show_robot` is called anew."""
        return link.name

    def fleet_changed(self) -> None:
        """Robots came, went or were chosen."""

    def show_robot(self, link: RobotLink) -> None:
        """Make the panel anew for this robot."""

    def refresh_robot(self, link: RobotLink | None) -> None:
        """Show how the robot is now; None while there has not been any."""

    def looks(self) -> Iterable[Suspendable | None]:
        return (self._watch,)

    def shut(self) -> None:
        if self._watch is not None:
            self._watch.close()
            self._watch = None
        self._shown, self._revision = None, -1
