"""Tests of the channel between the window and the page: its messages, handlers and invalid messages."""

from __future__ import annotations

import json
import logging
import typing
from collections.abc import Callable
from pathlib import Path
from types import UnionType

import pytest
from PySide6.QtCore import QPoint

from app.blocks.model.workspace_json import WorkspaceJson
from app.ui.blockly import messages
from app.ui.blockly.bridge import BlocklyBridge
from app.ui.blockly.messages import (
    BackpackAdded,
    BlocksDeleted,
    BlocksDraggedOutside,
    CommandRequested,
    DragImageRendered,
    FlyoutPinned,
    FromPage,
    FromWindow,
    PageMessage,
    PagePosition,
    RunCommand,
    SensorsShown,
    SetBlockErrors,
    StackTried,
    VariablesWatched,
    WindowMessage,
    WorkspaceEdited,
)
from app.ui.blockly.view import BlocklyView
from app.ui.panels.base import Panel
from app.ui.panels.build.behaviour.panel import BehaviourPanel
from tests import hostile
from tests.ui.fakes import Session
from tests.ui.panel_case import Window

EXAMPLES: dict[str, PageMessage] = {
    '{"type": "workspaceEdited", "key": "a", "generation": 3}\n{"a": "\\n"}': WorkspaceEdited(
        "a", 3, WorkspaceJson('{"a": "\\n"}')
    ),
    '{"type": "commandRequested", "command": "variable.rename:v"}': CommandRequested("variable.rename:v"),
    '{"type": "sensorsShown", "sensors": [["Pepper", "battery"]]}': SensorsShown((("Pepper", "battery"),)),
    '{"type": "variablesWatched", "ids": ["a", "b"]}': VariablesWatched(("a", "b")),
    '{"type": "blocksDeleted", "count": 2}': BlocksDeleted(2),
    '{"type": "blocksDraggedOutside", "position": {"x": -3, "y": 9}, "tab": "a"}': BlocksDraggedOutside(
        PagePosition(-3, 9), "a"
    ),
    '{"type": "dragImageRendered", "png": "aGk=", "ratio": 2}': DragImageRendered(b"hi", 2.0),
    '{"type": "stackTried", "id": "a", "kind": "stack", "state": {"type": "t", "a": [1]}}': StackTried(
        "a", "stack", {"type": "t", "a": [1]}
    ),
    '{"type": "backpackAdded", "blocks": [{"type": "\\ud800"}], "count": 1, "hasNotes": true}': BackpackAdded(
        ({"type": "\ud800"},), 1, has_notes=True
    ),
}


class Received(list):
    """Messages from the page, received by a channel."""

    def __init__(self) -> None:
        super().__init__()
        self.bridge = BlocklyBridge(self.append)


@pytest.fixture
def received(qapp) -> Received:
    return Received()


def members(union: object) -> set[type]:
    return set(typing.get_args(union)) if isinstance(union, UnionType) else {typing.cast("type", union)}


def test_every_message_belongs_to_its_union() -> None:
    assert members(PageMessage) == set(FromPage.__subclasses__())
    assert members(WindowMessage) == set(FromWindow.__subclasses__())


def test_message_reaches_the_page_as_json_with_its_type(qtbot) -> None:
    bridge = BlocklyBridge(lambda _message: None)
    sent: list[str] = []
    bridge.message_sent.connect(sent.append)
    bridge.send(SetBlockErrors({"a": "“no”"}))
    bridge.send(RunCommand("undo"))
    assert [json.loads(each) for each in sent] == [
        {"type": "setBlockErrors", "errors": {"a": "“no”"}},
        {"type": "runCommand", "command": "undo"},
    ]


def test_blocks_with_deep_nesting_and_lone_surrogates_reach_the_page(qtbot) -> None:
    workspace: dict = {"text": "\ud800"}
    for _ in range(2000):
        workspace = {"next": workspace}
    text = messages.encode(messages.ApplyEdit(workspace))
    assert text.isascii()
    assert text.count("next") == 2000


@pytest.mark.parametrize("text", EXAMPLES)
def test_message_from_the_page_is_decoded_once_per_call(received: Received, text: str) -> None:
    received.bridge.message(text)
    assert received == [EXAMPLES[text]]
    assert received.bridge.refused_count == 0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "3",
        "null",
        "{}",
        '{"type": "quit"}',
        '{"type": "startEditor"}',
        '{"type": "pageReady", "extra": 1}',
        '{"type": "commandRequested", "command": "file.quit"}',
        '{"type": "canvasButtonPressed", "button": "quit"}',
        '{"type": "blocksDeleted", "count": 1e999}',
        '{"type": "blocksDroppedOutside", "position": {"x": 99999999999, "y": 0}}',
        '{"type": "dragImageRendered", "png": "!", "ratio": 1}',
        '{"type": "workspaceEdited", "key": "a", "generation": 1}',
        '{"type": "workspaceEdited", "key": "a", "generation": 1, "workspace": "{}"}',
        '{"type": "workspaceEdited", "key": "a", "generation": 1}\n' + "[" * 20_000,
        '{"type": "pageReady"}\n{}',
        "3\n{}",
        "[" * 100_000,
    ],
)
def test_invalid_message_is_refused_counted_and_logged(received: Received, caplog, text: str) -> None:
    with caplog.at_level(logging.WARNING):
        received.bridge.message(text)
    assert received == []
    assert received.bridge.refused_count == 1
    (record,) = caplog.records
    assert record.getMessage().startswith("refused a message from the page of the block editor (1 so far): ")
    assert len(record.getMessage()) < 400


def test_repeated_invalid_messages_are_logged_at_increasing_intervals(received: Received, caplog) -> None:
    with caplog.at_level(logging.WARNING):
        for _ in range(100):
            received.bridge.message("{}")
    assert received.bridge.refused_count == 100
    assert len(caplog.records) == 3


def test_hostile_variants_of_messages_are_decoded_or_refused(received: Received) -> None:
    count = 0
    for text in EXAMPLES:
        for payload in hostile.payloads(json.loads(text.partition("\n")[0])):
            received.bridge.message(payload.decode("utf-8", "replace"))
            count += 1
    assert len(received) + received.bridge.refused_count == count
    assert received.bridge.refused_count > 0


def sample(kind: object) -> object:
    """Return a value of a type that occurs in messages from the page."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        return sample(arguments[0])
    if origin is typing.Literal:
        return arguments[0]
    if isinstance(kind, UnionType):
        return sample(arguments[0])
    if origin is tuple:
        return ()
    if origin is dict:
        return {}
    if kind is WorkspaceJson:
        return WorkspaceJson("{}")
    if kind is PagePosition:
        return PagePosition(1, 2)
    return typing.cast("Callable[[], object]", kind)()


def sample_of(kind: type) -> object:
    hints = typing.get_type_hints(kind, include_extras=True)
    return kind(**{name: sample(hints[name]) for name in kind.__struct_fields__})


class PanelEditor(BlocklyView):
    """Block editor without a page, whose messages reach its panel."""


@pytest.mark.parametrize("kind", sorted(members(PageMessage), key=lambda kind: kind.__name__))
def test_every_message_of_the_page_has_a_handler(qtbot, tmp_path: Path, kind: type) -> None:
    window = Window(Session.full())
    window.session.settings.path = tmp_path / "settings.json"  # the backpack is in the same folder
    made = window.make(
        Panel("behaviour", "Behaviour", "blocks", (), lambda context: BehaviourPanel(context, PanelEditor)),
        (1032, 600),
    )
    qtbot.addWidget(made)
    assert isinstance(made, BehaviourPanel)
    qtbot.addWidget(made.title_widget())
    assert isinstance(made.editor, PanelEditor)
    passed_on: list[object] = []
    made.editor.message_received.connect(passed_on.append)
    made.editor._receive(sample_of(kind))
    is_for_panel = kind in members(messages.PanelMessage)
    assert [type(each) for each in passed_on] == ([kind] if is_for_panel else [])


def test_message_without_a_handler_raises() -> None:
    with pytest.raises(TypeError, match="no handler for FlyoutPinned"):
        messages.reject_unhandled(FlyoutPinned(is_pinned=True))  # type: ignore[arg-type]


def test_position_on_the_page_is_converted_to_the_screen(qtbot) -> None:
    view = BlocklyView()
    qtbot.addWidget(view)
    view.move(40, 30)
    assert view.to_screen(PagePosition(-3, 9)) == view.mapToGlobal(QPoint(-3, 9))
