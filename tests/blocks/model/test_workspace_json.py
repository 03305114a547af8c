"""Tests of workspaces as JSON text or as blocks: parsed on demand, compared without parsing."""

from __future__ import annotations

import json

import pytest

from app.blocks.model import deep_json
from app.blocks.model.workspace_json import LONG_TEXT_LENGTH, WorkspaceJson

ONE = {"blocks": {"blocks": [{"type": "events_started", "id": "\u00e9\ud800"}]}}


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Texts that were parsed during the test."""
    seen: list[str] = []
    before = deep_json.loads

    def loads(text: str) -> object:
        seen.append(text)
        return before(text)

    monkeypatch.setattr(deep_json, "loads", loads)
    return seen


def test_workspace_text_is_kept_unchanged_and_parsed_once(parsed: list[str]) -> None:
    text = json.dumps(ONE, separators=(",", ":"))
    told = WorkspaceJson(text)
    assert told.text is text
    assert parsed == []
    assert told.blocks == ONE
    assert told.blocks == ONE
    assert parsed == [text]


def test_texts_are_compared_without_parsing(parsed: list[str]) -> None:
    text = json.dumps(ONE)
    one, same, other = WorkspaceJson(text), WorkspaceJson(text), WorkspaceJson("{}")
    assert one.blocks  # parses the text, as the compiler does
    del parsed[:]
    assert one.is_equal_to(same)
    assert not one.is_equal_to(other)
    assert parsed == []


def test_differently_formatted_json_is_equal() -> None:
    assert WorkspaceJson(json.dumps(ONE, indent=2)).is_equal_to(WorkspaceJson.from_blocks(ONE))
    assert not WorkspaceJson.from_blocks({}).is_equal_to(WorkspaceJson(json.dumps(ONE)))


def test_has_blocks_does_not_parse_long_text(parsed: list[str]) -> None:
    assert not WorkspaceJson("{}").has_blocks
    assert not WorkspaceJson('{"blocks": {"blocks": []}}').has_blocks
    assert WorkspaceJson.from_blocks(ONE).has_blocks
    del parsed[:]
    assert WorkspaceJson(json.dumps(ONE) + " " * LONG_TEXT_LENGTH).has_blocks
    assert parsed == []


def test_json_without_object_has_no_blocks() -> None:
    assert WorkspaceJson("[]").blocks == {}


def test_too_deeply_nested_json_is_rejected_on_creation() -> None:
    text = "[" * 200_000 + "]" * 200_000
    with pytest.raises(RecursionError):
        WorkspaceJson(text)
