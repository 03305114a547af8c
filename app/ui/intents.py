"""Intents of panels and of the window; those of problems and alerts are in `app.intents`.

Panels don't import each other: a panel requests an intent by `PanelContext.request`, and another panel or
the window carries it out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.blocks.model.stack import Stack
from app.intents import Intent
from nep.programs.alarms import AlarmCondition

MenuEdit = Literal["cut", "copy", "paste", "selectAll"]
"""Edit of the Edit menu, named like Qt's slot of text fields."""
BlockEdit = Literal["copy", "cut", "paste", "duplicate"]
"""Edit of the selected blocks."""

# -- panels, topics and recordings --------------------------------------------------------------------


@dataclass(frozen=True)
class OpenPanel(Intent):
    """Show a panel.

    Attributes:
        panel: Name of the panel.
    """

    panel: str


@dataclass(frozen=True)
class PlotField(Intent):
    """Plot a field of a topic.

    Attributes:
        topic: Key of the topic.
        path: Path of the field; "" asks for the field.
    """

    topic: str
    path: str


@dataclass(frozen=True)
class PublishMessage(Intent):
    """Write a new message; nothing is sent before the user arms sending.

    Attributes:
        topic: Key of the topic; "" for a message without a topic.
    """

    topic: str


@dataclass(frozen=True)
class SelectService(Intent):
    """Select a service to call.

    Attributes:
        service: Name of the service; "" only shows the services.
    """

    service: str


@dataclass(frozen=True)
class NewAlarm(Intent):
    """Create an alarm; an alarm on a number stays off until the user has confirmed the limit.

    Attributes:
        condition: Condition of the alarm.
    """

    condition: AlarmCondition


@dataclass(frozen=True)
class NewValueAlarm(Intent):
    """Create an alarm on a field of a topic: on a limit for a number, else on any change.

    Attributes:
        topic: Key of the topic.
        path: Path of the field; "" is the path of the whole payload.
    """

    topic: str
    path: str


@dataclass(frozen=True)
class RecordTopic(Intent):
    """Start a recording of a single topic.

    Attributes:
        topic: Key of the topic.
    """

    topic: str


@dataclass(frozen=True)
class OpenRecording(Intent):
    """Open a recording and show its timeline."""

    path: Path


@dataclass(frozen=True)
class ExportRecording(Intent):
    """Select a recording in the panel that can export a part of it."""

    path: Path


@dataclass(frozen=True)
class SelectRecording(Intent):
    """Select a recording in the list, now or as soon as it is listed.

    Attributes:
        path: File of the recording; None only shows the list.
    """

    path: Path | None = None


# -- robots -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ShowRobot(Intent):
    """Show what a robot can do."""

    name: str


@dataclass(frozen=True)
class RemoveVirtualRobot(Intent):
    """Stop a virtual robot that this Studio has started."""

    name: str


# -- tabs of behaviours, identified by the key of the open project ------------------------------------


@dataclass(frozen=True)
class SelectTab(Intent):
    """Show a tab."""

    key: str


@dataclass(frozen=True)
class CloseBehaviour(Intent):
    """Close a tab."""

    key: str


@dataclass(frozen=True)
class CloseOtherTabs(Intent):
    """Close all tabs except one."""

    key: str


@dataclass(frozen=True)
class SaveTab(Intent):
    """Show a tab and save its behaviour."""

    key: str


@dataclass(frozen=True)
class SaveTabAs(Intent):
    """Show a tab and ask for a file to save its behaviour to."""

    key: str


@dataclass(frozen=True)
class RenameTab(Intent):
    """Rename a behaviour and its file."""

    key: str
    name: str


@dataclass(frozen=True)
class DuplicateTab(Intent):
    """Open a copy of a behaviour in a new tab."""

    key: str


@dataclass(frozen=True)
class ShowTabFolder(Intent):
    """Open the folder of a behaviour's file in the file manager."""

    key: str


@dataclass(frozen=True)
class MoveTab(Intent):
    """Move a tab to another position, counted from 0."""

    key: str
    position: int


# -- blocks -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Undo(Intent):
    """Undo the last edit of the blocks."""


@dataclass(frozen=True)
class Redo(Intent):
    """Redo the last undone edit of the blocks."""


@dataclass(frozen=True)
class EditBlocks(Intent):
    """Apply an edit to the selected blocks, wherever the focus is."""

    edit: BlockEdit


@dataclass(frozen=True)
class UseEditMenu(Intent):
    """Apply an edit to the focused text field of the editor's page, else to the selected blocks."""

    edit: MenuEdit


@dataclass(frozen=True)
class TryStack(Intent):
    """Run a single script."""

    stack: Stack


@dataclass(frozen=True)
class ShowBlock(Intent):
    """Scroll to a block.

    Attributes:
        block_id: Id of the block.
    """

    block_id: str


@dataclass(frozen=True)
class HideBlockHint(Intent):
    """Remove the highlight of `PointAtBlock`."""


@dataclass(frozen=True)
class DeleteVariable(Intent):
    """Delete a variable and the blocks that use it."""

    variable_id: str


@dataclass(frozen=True)
class ToggleVariableWatch(Intent):
    """Show or hide the value of a variable next to the blocks."""

    variable_id: str


@dataclass(frozen=True)
class ShowNextUse(Intent):
    """Scroll to the next block that uses a variable, wrapping around."""

    variable_id: str


# -- keys and hints -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class PressKey(Intent):
    """Run the command of a shortcut that the page of the block editor received.

    Attributes:
        key: Shortcut in Qt's portable text format.
    """

    key: str


@dataclass(frozen=True)
class PointAtButton(Intent):
    """Highlight the button of a command.

    Attributes:
        command: Id of the command.
    """

    command: str
