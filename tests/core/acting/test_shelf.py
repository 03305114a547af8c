"""Tests of the shelf of saved messages, its limits and its file."""

from __future__ import annotations

import json

import pytest

from app.core.run.acting.sending import MAX_HZ
from app.core.run.acting.shelf import (
    MAX_MESSAGES,
    MAX_REQUESTS,
    NewerSavedMessagesError,
    SavedMessage,
    SavedMessages,
    encode_saved_messages,
    parse_saved_messages,
)
from nep.errors import NepError

LOOK = SavedMessage("a", "Look at Aiko", "/robot_action", "json", '{"yaw": {yaw}}', (("yaw", "-12.5"),), 10.0)


def test_saved_message_payload_is_built_from_its_values() -> None:
    assert LOOK.payload() == {"yaw": -12.5}
    assert LOOK.with_value("yaw", "left").payload() == {"yaw": "left"}
    with pytest.raises(NepError, match="Fill in “yaw” first"):
        LOOK.with_value("yaw", " ").payload()
    assert SavedMessage("b", "Word", "/words", "string", "{yes").payload() == "{yes"


def test_saved_messages_survive_save_and_load() -> None:
    shelf = SavedMessages([LOOK, SavedMessage("b", "Wörter\ud800", "/words", "string", "a\nb")])
    shelf.set_request("/sum", '{"a": 1}')
    data = encode_saved_messages(shelf)
    read, unread = parse_saved_messages(data)
    assert unread == 0
    assert read.messages[0] == LOOK
    assert read.messages[1].text == "a\nb"
    assert dict(read.requests) == {"/sum": '{"a": 1}'}


def test_copies_are_inserted_below_and_deleted_message_is_restored() -> None:
    other = SavedMessage("b", "Stand still", "/cmd_vel")
    shelf = SavedMessages([LOOK, other])
    made = shelf.copy("a")
    assert made is not None
    assert [each.name for each in shelf.messages] == ["Look at Aiko", "Look at Aiko 2", "Stand still"]
    assert shelf.remove("a") == LOOK
    assert shelf.restore() == LOOK
    assert shelf.messages[0] == LOOK
    assert shelf.restore() is None
    assert shelf.remove("nobody") is None


def test_number_of_saved_messages_and_requests_is_limited() -> None:
    shelf = SavedMessages()
    kept = [shelf.set_message(SavedMessage(str(number), "", "/t")) for number in range(MAX_MESSAGES + 1)]
    assert kept == [True] * MAX_MESSAGES + [False]
    assert shelf.copy("0") is None
    assert shelf.set_message(SavedMessage("0", "other", "/t"))
    for number in range(MAX_REQUESTS + 5):
        shelf.set_request(f"/s{number}", "{}")
    assert len(shelf.requests) == MAX_REQUESTS
    assert "/s0" not in shelf.requests


@pytest.mark.parametrize("data", [b"", b"{", b"[]", b"\xff\xfe", b'{"messages": 3}', b"[" * 100_000])
def test_invalid_file_of_saved_messages_is_rejected(data) -> None:
    with pytest.raises(NepError):
        parse_saved_messages(data)


def test_file_of_newer_version_raises_newer_saved_messages_error() -> None:
    with pytest.raises(NewerSavedMessagesError):
        parse_saved_messages(json.dumps({"format": 2, "messages": []}).encode())


def test_damaged_messages_are_skipped_and_counted() -> None:
    good = {"id": "a", "name": "Stop", "topic": "/cmd_vel", "type": "json", "text": "{}", "values": {"x": 1}}
    told = [good, None, 3, {}, {**good, "id": 7}, {**good, "id": "b", "rate_hz": 1e308}, {**good, "id": ""}]
    shelf, unread = parse_saved_messages(json.dumps({"messages": told, "requests": {"/sum": 3}}).encode())
    assert [each.id for each in shelf.messages] == ["a", "b"]
    assert unread == 5
    assert shelf.messages[0].values == ()
    assert [each.rate_hz for each in shelf.messages] == [1.0, MAX_HZ]
    assert dict(shelf.requests) == {}
