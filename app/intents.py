"""Intents: next steps that problems, alerts, panels and the window request, as data.

This module contains the intents of problems and alerts; `app.ui.intents` contains those of panels. The
window passes each of them to the panel or the part of the window that handles its class.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from nep.i18n import lazy

OPEN_DOCTOR_LABEL = lazy("Open the connection doctor")
"""Label of a button for `OpenDoctor`."""


@dataclass(frozen=True)
class Intent:
    """Base class of intents; an intent has one handler."""


# -- next steps of alerts -----------------------------------------------------------------------------


@dataclass(frozen=True)
class OpenDoctor(Intent):
    """Find out why a connection or topic doesn't work."""


@dataclass(frozen=True)
class ShowLog(Intent):
    """Show the log of Studio."""


@dataclass(frozen=True)
class ShowConsole(Intent):
    """Show the messages in the console."""


@dataclass(frozen=True)
class ShowAlarms(Intent):
    """Show the alarms."""


@dataclass(frozen=True)
class Inspect(Intent):
    """Show the messages of a topic in the Inspector.

    Attributes:
        topic: Key of the topic.
    """

    topic: str


@dataclass(frozen=True)
class StopRobots(Intent):
    """Stop the program and all robots."""


@dataclass(frozen=True)
class SaveBehaviour(Intent):
    """Save the behaviour."""


@dataclass(frozen=True)
class SaveBehaviourAs(Intent):
    """Save the behaviour under another name or in another folder."""


@dataclass(frozen=True)
class OpenBehaviour(Intent):
    """Open another behaviour."""


@dataclass(frozen=True)
class ChooseRecordingsFolder(Intent):
    """Choose the folder in which recordings are saved."""


@dataclass(frozen=True)
class ShowRecordingFile(Intent):
    """Show the file of a recording in its folder."""

    path: Path


@dataclass(frozen=True)
class BrowseNetworks(Intent):
    """Choose the networks of other middleware that are shown."""


@dataclass(frozen=True)
class AllowOtherComputers(Intent):
    """Choose the addresses at which other computers may connect."""


@dataclass(frozen=True)
class ReportProblem(Intent):
    """Create a problem report."""


# -- fixes of problems --------------------------------------------------------------------------------


@dataclass(frozen=True)
class ConnectRobot(Intent):
    """Restart a virtual robot, or show the robots and why a real one is missing."""

    name: str


@dataclass(frozen=True)
class ReplaceRobot(Intent):
    """Replace a missing robot in the behaviour.

    Attributes:
        missing: Name of the robot that is missing.
        replacement: Name of the robot that replaces it.
    """

    missing: str
    replacement: str


@dataclass(frozen=True)
class StartVirtualRobot(Intent):
    """Start a virtual robot in place of a missing robot of the same model.

    Attributes:
        missing: Name of the missing robot.
    """

    missing: str


@dataclass(frozen=True)
class PointAtBlock(Intent):
    """Highlight a block in the toolbox.

    Attributes:
        block_type: Type of the block.
    """

    block_type: str


@dataclass(frozen=True)
class RenameVariable(Intent):
    """Ask for a new name of a variable.

    Attributes:
        variable_id: Id of the variable.
    """

    variable_id: str


@dataclass(frozen=True)
class BlockFix(Intent):
    """Base class of fixes that change the blocks of a behaviour, see `app.blocks.fixes.fixes.fix`."""


@dataclass(frozen=True)
class AddTimeLimit(BlockFix):
    """Set a time limit for a "wait until".

    Attributes:
        block_id: Id of the block.
    """

    block_id: str


@dataclass(frozen=True)
class DefineFunction(BlockFix):
    """Create the function that a block calls.

    Attributes:
        block_id: Id of the block.
    """

    block_id: str


@dataclass(frozen=True)
class AddStartBlock(BlockFix):
    """Put a start block above the first script without one, or alone if there is none.

    Attributes:
        block_type: Type of the start block.
    """

    block_type: str


@dataclass(frozen=True)
class SetAtStart(BlockFix):
    """Set a variable at the start of the behaviour.

    Attributes:
        variable_id: Id of the variable.
        is_list: True for an empty list, False for the number 0.
    """

    variable_id: str
    is_list: bool


@dataclass(frozen=True)
class AddReceiver(BlockFix):
    """Create a script that receives a broadcast.

    Attributes:
        broadcast: Name of the broadcast.
    """

    broadcast: str


@dataclass(frozen=True)
class JoinScripts(BlockFix):
    """Run a script after another one.

    The script moves to the end of the other one, and its start block is removed.

    Attributes:
        moved_start: Id of the start block of the script to move.
        target_start: Id of the start block of the other script.
    """

    moved_start: str
    target_start: str
