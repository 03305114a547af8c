"""Messages between the window and the page of the block editor, as JSON objects with the field ``type``.

`tools/editor_messages.py` writes the types of the page (`app/blocks/editor/src/messages.ts`) from this
module. A field name such as ``can_undo`` is ``canUndo`` in JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NoReturn, TypeAlias

from msgspec import Meta, Struct, convert

from app.blocks.model import deep_json
from app.blocks.model.workspace_json import WorkspaceJson
from app.blocks.runtime.variables import VariableValue

Json = Mapping[str, object]
Id = Annotated[str, Meta(max_length=10_000)]
"""Id of a block, tab, variable or stack, or name of a robot or sensor."""
PictureKind = Literal["png", "svg"]
EditCommand = Literal["copy", "cut", "paste", "duplicate", "selectAll"]
Count = Annotated[int, Meta(ge=0, le=1_000_000_000)]
Coordinate = Annotated[int, Meta(ge=-1_000_000, le=1_000_000)]
"""Coordinate in pixels of the page."""


def _tag(name: str) -> str:
    return name[0].lower() + name[1:]


class FromPage(Struct, frozen=True, tag_field="type", tag=_tag, rename="camel", forbid_unknown_fields=True):
    """Base of the messages from the page."""


class FromWindow(Struct, frozen=True, tag_field="type", tag=_tag, rename="camel"):
    """Base of the messages from the window."""


# -- from the page, for `BlocklyHost` ---------------------------------------------------------------------


class PageOpened(FromPage, frozen=True):
    """The page receives messages. The window replies with `StartEditor`."""


class PageReady(FromPage, frozen=True):
    """The page has started; its editor is empty."""


class PageFailed(FromPage, frozen=True):
    """An error occurred in the page; `text` describes it for the log."""

    text: str


class FieldOpened(FromPage, frozen=True):
    """The field that was requested by the command "find" or "search" has the focus."""


class BlockFocusChanged(FromPage, frozen=True):
    """The focus entered or left the blocks."""

    is_focused: bool


class BlocksCopied(FromPage, frozen=True):
    """The user copied blocks or notes.

    Attributes:
        text: Text for the system clipboard.
    """

    text: str


class ClipboardRequested(FromPage, frozen=True):
    """The page needs the copied blocks on the system clipboard. The window replies with `ClipboardText`."""


# -- from the page, for `BlocklyView` ---------------------------------------------------------------------


class WorkspaceEdited(FromPage, frozen=True):
    """The user edited the blocks of a tab.

    Attributes:
        generation: Number from the `TabContent` that was edited.
        workspace: Workspace after the edit, as JSON text.
    """

    key: Id
    generation: int
    workspace: WorkspaceJson


class WorkspaceFlushed(FromPage, frozen=True):
    """Reply to `FlushWorkspace`. Pending edits were sent before.

    Attributes:
        workspace: Workspace of the shown tab, as JSON text.
    """

    token: int
    workspace: WorkspaceJson


class PngRendered(FromPage, frozen=True):
    """Reply to `RenderPicture` with the kind "png".

    Attributes:
        png: Image, Base64-encoded; empty if there are no blocks.
    """

    token: int
    png: bytes


class SvgRendered(FromPage, frozen=True):
    """Reply to `RenderPicture` with the kind "svg".

    Attributes:
        svg: Image; empty if there are no blocks.
    """

    token: int
    svg: str


class PagesLaidOut(FromPage, frozen=True):
    """Reply to `LayOutPages`.

    Attributes:
        count: Number of pages; 0 if there are no blocks.
    """

    token: int
    count: Count


# -- from the page, for the panel -------------------------------------------------------------------------


class HistoryChanged(FromPage, frozen=True):
    """The undo or redo stack of the shown tab became empty or is no longer empty."""

    can_undo: bool
    can_redo: bool


class FlyoutPinned(FromPage, frozen=True):
    """The user pinned or unpinned the flyout.

    Attributes:
        is_pinned: True if the flyout stays open after a block was dragged out of it.
    """

    is_pinned: bool


class BlocksDeleted(FromPage, frozen=True):
    """The user deleted blocks of the shown tab in one step."""

    count: Count


class SensorsShown(FromPage, frozen=True):
    """Other sensors are visible in the flyout.

    Attributes:
        sensors: Robot and sensor of each block in the open flyout.
    """

    sensors: tuple[tuple[Id, Id], ...]


class VariablesWatched(FromPage, frozen=True):
    """The user chose other variables whose values the page shows."""

    ids: tuple[Id, ...]


class CommandRequested(FromPage, frozen=True):
    """The user chose a command of the window in the page.

    Attributes:
        command: Id of a command for variables or pictures, with its argument.
    """

    command: Annotated[str, Meta(pattern=r"^(variable|picture|print)\.", max_length=10_000)]


class CanvasButtonPressed(FromPage, frozen=True):
    """The user pressed a button of the empty canvas."""

    button: Literal["robot", "examples"]


class StackTried(FromPage, frozen=True):
    """The user runs a single stack of blocks; see `app.blocks.model.stack.Stack`.

    Attributes:
        state: Saved state of a block in the toolbox; None for a block of the behaviour.
    """

    id: Id
    kind: Literal["value", "hat", "stack"]
    state: dict[str, Any] | None


class BackpackOpened(FromPage, frozen=True):
    """The user opened the backpack."""


class BackpackAdded(FromPage, frozen=True):
    """The user added blocks to the backpack.

    Attributes:
        blocks: Stacks in Blockly's JSON format.
        count: Number of blocks in the stacks.
        has_notes: True if the selection also contained notes, which the backpack can't store.
    """

    blocks: tuple[dict[str, Any], ...]
    count: Count
    has_notes: bool


class BackpackRemoved(FromPage, frozen=True):
    """The user removed a stack from the backpack."""

    id: Id


class BackpackEmptied(FromPage, frozen=True):
    """The user removed all stacks from the backpack."""


class PagePosition(Struct, frozen=True):
    """Position relative to the top left corner of the page, which may be outside the page, in pixels."""

    x: Coordinate
    y: Coordinate


class BlocksDraggedOutside(FromPage, frozen=True):
    """The user drags blocks outside the page.

    Attributes:
        position: Position of the mouse; None when the drag ended or is inside the page again.
        tab: Key of the tab in which the drag started.
    """

    position: PagePosition | None
    tab: Id


class DragImageRendered(FromPage, frozen=True):
    """The image of the blocks that are dragged outside the page.

    Attributes:
        png: Image, Base64-encoded.
        ratio: Pixels of the image per pixel of the page.
    """

    png: bytes
    ratio: Annotated[float, Meta(ge=0.01, le=100)]


class BlocksDroppedOutside(FromPage, frozen=True):
    """The user dropped blocks outside the page. They return to their place, or follow with "dropBlocks"."""

    position: PagePosition


class BlocksTransferred(FromPage, frozen=True):
    """Blocks of another tab were added to the shown tab.

    Attributes:
        count: Number of blocks; 0 for a note.
        mode: "moved", "copied", or "added" for blocks of the toolbox.
        source_tab: Key of their former tab.
    """

    count: Count
    mode: Literal["moved", "copied", "added"]
    source_tab: Id


HostMessage: TypeAlias = (
    PageOpened | PageReady | PageFailed | FieldOpened | BlockFocusChanged | BlocksCopied | ClipboardRequested
)
ViewMessage: TypeAlias = WorkspaceEdited | WorkspaceFlushed | PngRendered | SvgRendered | PagesLaidOut
BackpackMessage: TypeAlias = BackpackOpened | BackpackAdded | BackpackRemoved | BackpackEmptied
DragMessage: TypeAlias = BlocksDraggedOutside | DragImageRendered | BlocksDroppedOutside | BlocksTransferred
PanelMessage: TypeAlias = (
    HistoryChanged
    | FlyoutPinned
    | BlocksDeleted
    | SensorsShown
    | VariablesWatched
    | CommandRequested
    | CanvasButtonPressed
    | StackTried
    | BackpackMessage
    | DragMessage
)
PageMessage: TypeAlias = HostMessage | ViewMessage | PanelMessage


# -- from the window --------------------------------------------------------------------------------------


class EditorTheme(Struct, frozen=True, rename="camel"):
    """Appearance of the page.

    Attributes:
        tokens: Design tokens: the parsed token file, or `Theme.blockly_tokens()`.
        is_dark: True for the dark theme.
    """

    tokens: Json
    is_dark: bool


class StartEditor(FromWindow, frozen=True):
    """Settings that the page needs before its first paint.

    Attributes:
        is_motion_reduced: True for a steady glow of running blocks.
        is_pinned: True if the flyout is pinned, None to decide by the available space.
    """

    language: str
    words: Mapping[str, str]
    is_motion_reduced: bool
    is_pinned: bool | None
    theme: EditorTheme


class SetTheme(FromWindow, frozen=True):
    """Change the colours and sizes."""

    theme: EditorTheme


class SetReducedMotion(FromWindow, frozen=True):
    """Select a steady or an animated glow for running blocks."""

    is_reduced: bool


class SetDefinitions(FromWindow, frozen=True):
    """Set the block definitions (`editor_definitions`), while no block is dragged."""

    definitions: Json


class TabContent(Struct, frozen=True):
    """Blocks to load into a tab.

    Attributes:
        generation: Number that the page sends back with edits of these blocks.
    """

    generation: int
    workspace: Json


class ShowTab(FromWindow, frozen=True):
    """Show a tab.

    Attributes:
        content: Blocks to load; None if the page has them.
    """

    key: str
    content: TabContent | None


class CloseTab(FromWindow, frozen=True):
    """Discard a tab with its undo stack."""

    key: str


class PinFlyout(FromWindow, frozen=True):
    """Set whether the flyout stays open after a block was dragged out of it.

    Attributes:
        is_pinned: None to decide by the available space.
    """

    is_pinned: bool | None


class HighlightBlocks(FromWindow, frozen=True):
    """Highlight the running blocks and no others."""

    ids: tuple[str, ...]


class MarkStopped(FromWindow, frozen=True):
    """Outline the blocks at which the program stopped."""

    ids: tuple[str, ...]


class SetAbsent(FromWindow, frozen=True):
    """Dim blocks whose robot is not connected."""

    ids: tuple[str, ...]


class SetBlockErrors(FromWindow, frozen=True):
    """Show errors at blocks, as messages by block id."""

    errors: Mapping[str, str]


class SetBlockWarnings(FromWindow, frozen=True):
    """Show warnings at blocks, as messages by block id."""

    warnings: Mapping[str, str]


class ShowValue(FromWindow, frozen=True):
    """Show a value at a block until the next click.

    Attributes:
        id: Id of a block on the canvas or in the flyout.
    """

    id: str
    text: str


class SetVariableValues(FromWindow, frozen=True):
    """Set the displayed values of the watched variables, by variable id."""

    values: Mapping[str, VariableValue]


class SetLiveValues(FromWindow, frozen=True):
    """Set the displayed values of sensor blocks.

    Attributes:
        values: Formatted values by block id or by ``<robot>/<property>[/<field>]``.
        stale_keys: Keys of stale values, which are dimmed.
    """

    values: Mapping[str, str]
    stale_keys: tuple[str, ...]


class RobotAlarm(Struct, frozen=True):
    """Problem of a robot.

    Attributes:
        status: Status that determines the colour of the dot.
    """

    status: str
    text: str


class SetAlarms(FromWindow, frozen=True):
    """Set the problems shown in the toolbox, by robot name."""

    alarms: Mapping[str, RobotAlarm]


class VariableEdit(Struct, frozen=True):
    """Edit of a variable.

    Attributes:
        name: New name; "" if it stays.
        list: True to create a list.
    """

    do: Literal["new", "rename", "delete", "watch"]
    id: str = ""
    name: str = ""
    list: bool = False


class EditVariable(FromWindow, frozen=True):
    """Edit a variable of the shown tab."""

    edit: VariableEdit


class FlushWorkspace(FromWindow, frozen=True):
    """Request pending edits of the shown tab and its workspace."""

    token: int


class RenderPicture(FromWindow, frozen=True):
    """Request an image of all blocks of the shown tab.

    Attributes:
        is_white: True for a white background, False for a transparent one.
    """

    token: int
    kind: PictureKind
    is_white: bool


class LayOutPages(FromWindow, frozen=True):
    """Lay out all blocks of the shown tab on pages for printing; lengths are in pixels.

    Attributes:
        date: Formatted date on each page.
    """

    token: int
    title: str
    date: str
    width: float
    height: float
    margin: float


class ApplyEdit(FromWindow, frozen=True):
    """Replace the blocks of the shown tab as one undoable edit."""

    workspace: Json


class BackpackItem(Struct, frozen=True):
    """Stack of blocks in the backpack."""

    id: str
    block: Json


class SetBackpack(FromWindow, frozen=True):
    """Set the contents of the backpack, newest first."""

    items: tuple[BackpackItem, ...]


class ClipboardText(FromWindow, frozen=True):
    """Reply to `ClipboardRequested`.

    Attributes:
        text: Copied blocks; "" if the clipboard contains anything else.
    """

    text: str


class Zoom(FromWindow, frozen=True):
    """Change the zoom of the shown tab.

    Attributes:
        steps: Number of steps; negative to zoom out.
    """

    steps: int


class RevealBlock(FromWindow, frozen=True):
    """Scroll to a block and select it."""

    id: str


class EditSelection(FromWindow, frozen=True):
    """Apply an editing command to the selected blocks."""

    command: EditCommand


class SetCanvasHint(FromWindow, frozen=True):
    """Set the hint on the empty canvas.

    Attributes:
        block_label: Label of the suggested block.
        has_robot: True if a robot is connected.
    """

    block_label: str
    has_robot: bool


class PointerTarget(Struct, frozen=True, rename="camel"):
    """Block to point at.

    Attributes:
        placement_hint: Hint where to put the block.
    """

    block: str
    name: str
    placement_hint: str


class PointAt(FromWindow, frozen=True):
    """Highlight the category of a block and then the block, until it is added; None ends the highlighting."""

    target: PointerTarget | None


class RunCommand(FromWindow, frozen=True):
    """Run a command without arguments in the shown tab.

    "undoDeletion" restores the most recently deleted blocks. "dropBlocks" moves the blocks that were
    dropped outside the page into the shown tab, and "undoDrop" moves them back. "find", "search" and
    "help" open the find bar, the search field of the toolbox and the help of the focused block.
    "showFocus" shows the focus, because the user uses the keyboard. "clearPages" removes the pages that
    were laid out for printing.
    """

    command: Literal[
        "undo",
        "redo",
        "undoDeletion",
        "dropBlocks",
        "undoDrop",
        "fit",
        "find",
        "search",
        "help",
        "showFocus",
        "clearPages",
    ]


BlockState: TypeAlias = HighlightBlocks | MarkStopped | SetAbsent | SetBlockErrors | SetBlockWarnings
"""States of the blocks of one tab."""
WindowMessage: TypeAlias = (
    StartEditor
    | SetTheme
    | SetReducedMotion
    | SetDefinitions
    | ShowTab
    | CloseTab
    | PinFlyout
    | BlockState
    | ShowValue
    | SetVariableValues
    | SetLiveValues
    | SetAlarms
    | EditVariable
    | FlushWorkspace
    | RenderPicture
    | LayOutPages
    | ApplyEdit
    | SetBackpack
    | ClipboardText
    | Zoom
    | RevealBlock
    | EditSelection
    | SetCanvasHint
    | PointAt
    | RunCommand
)


def encode(message: WindowMessage) -> str:
    """Format a message as JSON. Raises RecursionError beyond 9000 levels of nesting."""
    return deep_json.run_deep(lambda: json.dumps(message, default=_fields_of))


def decode(text: str) -> PageMessage:
    """Parse and validate a message from the page.

    A workspace isn't part of the JSON object, but follows it on a second line: it stays text.

    Raises:
        ValueError: The text isn't a valid message.
        RecursionError: The nesting exceeds 9000 levels.
    """
    head, newline, workspace = text.partition("\n")
    fields = deep_json.loads(head)
    if newline and isinstance(fields, dict):
        fields["workspace"] = WorkspaceJson(workspace)
    message: PageMessage = convert(fields, PageMessage, dec_hook=_accept_workspace)
    return message


def reject_unhandled(message: NoReturn) -> NoReturn:
    """Raise TypeError; mypy reports a call that can be reached, because a kind of message has no handler."""
    raise TypeError(f"no handler for {message!r}")


def _fields_of(struct: object) -> dict[str, object]:
    if not isinstance(struct, Struct):
        raise TypeError(f"no JSON for {type(struct).__name__}")
    tag = struct.__struct_config__.tag
    fields: dict[str, object] = {"type": tag} if tag is not None else {}
    for name, encode_name in zip(struct.__struct_fields__, struct.__struct_encode_fields__, strict=True):
        fields[encode_name] = getattr(struct, name)
    return fields


def _accept_workspace(kind: type, value: object) -> object:
    if kind is WorkspaceJson and isinstance(value, WorkspaceJson):
        return value
    raise ValueError("expected a workspace after the message")
