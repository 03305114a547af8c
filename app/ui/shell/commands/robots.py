"""What the commands about robots and other computers do; and a problem's button about a missing robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from app.core.robots.launcher import VIRTUAL_ROBOTS
from app.core.session import Session
from app.errors import SettingsError
from app.ui.shell.commands.shell import Shell
from app.ui.shell.dialogs.network_access import NetworkAccessSheet
from app.ui.shell.dialogs.other_networks import OtherNetworksSheet
from app.ui.shell.dialogs.web_pages import WebPagesSheet
from app.ui.shell.documents import DocumentController
from nep.i18n import _


@dataclass(frozen=True, slots=True)
class RobotSwap:
    """A robot that is missing, and another one that is to do what it was asked to do."""

    missing: str
    other: str

    @classmethod
    def parse(cls, text: str) -> RobotSwap:
        """Of ``MISSING:OTHER``."""
        missing, _colon, other = text.partition(":")
        return cls(missing, other)


@runtime_checkable
class FillsScreen(Protocol):
    """A panel whose content can fill the screen."""

    def fill_screen(self) -> None:
        """Fill the screen, or not any more."""


class RobotCommands:
    """Starts virtual robots, connects missing ones, and asks who may connect."""

    def __init__(
        self, shell: Shell, session: Session, files: DocumentController, undo: Callable[[], object]
    ) -> None:
        """``undo`` takes back the last edit of the blocks."""
        self._shell, self._session, self._files, self._undo = shell, session, files, undo
        self._network_access: NetworkAccessSheet | None = None
        self._other_networks: OtherNetworksSheet | None = None
        self._web_pages: WebPagesSheet | None = None

    # -- virtual robots ---------------------------------------------------------------------------

    def choose_start(self) -> None:
        """Let virtual robots go to their start position before each run, or leave them where they are."""
        fleet = self._session.fleet
        try:
            fleet.choose_start(begins=not fleet.begins_at_start)
        except SettingsError as error:
            self._shell.complain(str(error))

    def start_pepper(self) -> None:
        """Start the virtual Pepper; what shows stays."""
        self._session.launcher.start_virtual_robot()

    def virtual_pepper(self) -> None:
        """Start the virtual Pepper and show the Behaviour layout."""
        self.start_pepper()
        if self._shell.showing != "behaviour":  # else the keyboard stays where it is
            self._shell.show_layout("behaviour")

    def virtual_turtle(self) -> None:
        """Start the virtual Turtle."""
        self._session.launcher.start_virtual_robot("Turtle", "diffdrive")
        if self._shell.bench is None:
            self._shell.show_layout("behaviour")
        self._shell.say(_("Starting the virtual Turtle"), until=lambda: not self._is_coming("Turtle"))

    def _is_coming(self, name: str) -> bool:
        return name in self._session.coming

    def end_virtual(self, name: str = "") -> bool:
        """End this virtual robot, or all that were started here; they do not come back at the next start."""
        launcher = self._session.launcher
        names = [each for each in launcher.wanted if name in {"", each}]
        for each in names:
            launcher.stop_virtual_robot(each)
        return bool(names)

    def room_in_full_screen(self) -> None:
        """Show the virtual robots' room as large as the screen, or in its panel again."""
        dock = self._shell.open_panel("robot")
        if dock is not None and isinstance(dock.panel, FillsScreen):
            dock.panel.fill_screen()

    # -- robots that are missing ------------------------------------------------------------------

    def connect(self, name: str) -> None:
        """A virtual robot starts again; for a real one the list of robots shows."""
        kind = self._described(name).get("rb:robot")
        model = _model(kind) if isinstance(kind, Mapping) and kind.get("virtual") is True else None
        if model is not None:
            self._session.launcher.restart_virtual_robot(name, model)
        else:
            self._shell.open_panel("robots")

    def start_for(self, missing: str) -> bool:
        """Start the virtual robot of a missing one's model; False when there is none. It can be undone."""
        model = _model(self._described(missing).get("rb:robot"))
        if model is None:
            return False
        launcher = self._session.launcher
        launcher.restart_virtual_robot(missing, model)
        self._shell.say(
            _("Starting the virtual {robot}").format(robot=missing),
            _("Undo"),
            lambda: launcher.stop_virtual_robot(missing),
            until=lambda: not self._is_coming(missing),
        )
        return True

    def _described(self, name: str) -> Mapping[str, object]:
        """A robot's description, as it was seen last or as the behaviour keeps it."""
        link = self._session.fleet.link(name)
        return link.robot.source if link is not None else self._session.document.robots.get(name, {})

    def use(self, swap: RobotSwap) -> bool:
        """Let another robot do what a missing one was asked to do; False when it is away.

        It can be undone.
        """
        link = self._session.fleet.link(swap.other)
        if link is None:
            return False
        document, robot = self._session.document, link.robot

        def change() -> None:
            if document.use_robot(swap.missing, robot):
                words = _("{robot} does what {other} was asked to do")
                words = words.format(robot=swap.other, other=swap.missing)
                self._shell.say(words, _("Undo"), self._undo)

        self._files.with_newest(change)
        return True

    # -- who may --------------------------------------------------------------------------------

    def ask_before_moving(self) -> None:
        """Ask again before a real robot moves."""
        words = _("Studio will ask again before a real robot moves")
        try:
            self._session.fleet.permission.forget()
        except SettingsError as error:
            self._shell.complain(str(error))
            words = _("Studio will ask again before a real robot moves, until you close it")
        self._shell.say(words)

    def ask_about_others(self) -> None:
        """Ask whether other computers may connect."""
        if self._network_access is None:
            self._network_access = NetworkAccessSheet(
                self._shell.theme, self._shell.surface, self._session.remote_access
            )
        self._network_access.open()

    def choose_networks(self) -> None:
        """Show which other networks are looked at, and let the person choose."""
        if self._other_networks is None:
            self._other_networks = OtherNetworksSheet(
                self._shell.theme, self._shell.surface, self._session.live.networks
            )
        self._other_networks.open()

    def show_web_pages(self) -> None:
        """Show the web server: its switch, who may connect, and which pages are connected."""
        if self._web_pages is None:
            self._web_pages = WebPagesSheet(
                self._shell.theme,
                self._shell.surface,
                self._session.web_pages,
                self._robot_names,
                self._shell.say,
            )
        self._web_pages.open()

    def _robot_names(self) -> tuple[str, ...]:
        return tuple(link.name for link in self._session.fleet.connected)


def _model(kind: object) -> str | None:
    """The model of a robot's description, if there is a virtual robot of it."""
    model = str(kind.get("model")) if isinstance(kind, Mapping) else ""
    return model if model in VIRTUAL_ROBOTS else None
