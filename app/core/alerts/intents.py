"""Next steps that alerts offer, as data. The window decides how each of them is carried out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from nep.i18n import lazy

OPEN_DOCTOR_LABEL = lazy("Open the connection doctor")
"""Label of a button for `OpenDoctor`."""


@dataclass(frozen=True)
class OpenDoctor:
    """Find out why a connection or topic doesn't work."""


@dataclass(frozen=True)
class ShowLog:
    """Show the log of Studio."""


@dataclass(frozen=True)
class ShowConsole:
    """Show the messages in the console."""


@dataclass(frozen=True)
class ShowAlarms:
    """Show the alarms."""


@dataclass(frozen=True)
class Inspect:
    """Show the messages of a topic."""

    topic: str


@dataclass(frozen=True)
class ConnectRobot:
    """Connect a robot, or restart a virtual one."""

    name: str


@dataclass(frozen=True)
class StopRobots:
    """Stop the program and all robots."""


@dataclass(frozen=True)
class SaveBehaviour:
    """Save the behaviour."""


@dataclass(frozen=True)
class SaveBehaviourAs:
    """Save the behaviour under another name or in another folder."""


@dataclass(frozen=True)
class OpenBehaviour:
    """Open another behaviour."""


@dataclass(frozen=True)
class ChooseRecordingsFolder:
    """Choose the folder in which recordings are saved."""


@dataclass(frozen=True)
class ShowRecordingFile:
    """Show the file of a recording in its folder."""

    path: Path


@dataclass(frozen=True)
class BrowseNetworks:
    """Choose the networks of other middleware that are shown."""


@dataclass(frozen=True)
class AllowOtherComputers:
    """Choose the addresses at which other computers may connect."""


@dataclass(frozen=True)
class ReportProblem:
    """Create a problem report."""


Intent = (
    OpenDoctor
    | ShowLog
    | ShowConsole
    | ShowAlarms
    | Inspect
    | ConnectRobot
    | StopRobots
    | SaveBehaviour
    | SaveBehaviourAs
    | OpenBehaviour
    | ChooseRecordingsFolder
    | ShowRecordingFile
    | BrowseNetworks
    | AllowOtherComputers
    | ReportProblem
)
