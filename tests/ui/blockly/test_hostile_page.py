"""Tests that invalid values from the editor's page, the clipboard and drags are parsed or rejected."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QMimeData

from app.blocks.model.stack import Stack
from app.core.projects.file_format import parse_file
from app.errors import DocumentError
from app.ui.shell.commands.behaviours import parse_stack
from app.ui.widgets.field_drag import MIME_TYPE, dropped_field
from tests import hostile

STACK: hostile.Message = {
    "block": {
        "type": "robot_say",
        "id": "a",
        "fields": {"TEXT": "hi"},
        "inputs": {"X": {"block": {"type": "t"}}},
    },
    "variables": [{"name": "n", "id": "v"}],
}
BEHAVIOUR: hostile.Message = {
    "format": "nep-behaviour", "version": 1, "name": "x", "workspace": {"blocks": {"blocks": []}},
    "robots": {},
}  # fmt: skip
LISTS = tuple(hostile.payloads([["Pepper", "battery"], ["a", "b"]]))


def text_of(payload: bytes) -> str:
    return payload.decode("utf-8", "replace")


def test_stacks_and_behaviours_are_parsed_or_rejected() -> None:
    read = set()
    for payload in hostile.payloads(STACK):
        try:
            read.add(type(parse_stack(text_of(payload))))
        except (ValueError, RecursionError):
            read.add(ValueError)
    for payload in hostile.payloads(BEHAVIOUR):
        try:
            read.add(type(parse_file(payload, Path("a.nepb"))))
        except DocumentError as error:
            read.add(DocumentError)
            assert len(str(error)) < 20_000  # noqa: PT017 - of each
    assert {Stack, ValueError, DocumentError} < read


def test_dragged_field_is_parsed_or_none() -> None:
    for payload in LISTS:
        data = QMimeData()
        data.setData(MIME_TYPE, payload)
        found = dropped_field(data)
        assert found is None or len(found) == 2
