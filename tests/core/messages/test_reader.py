"""Tests of reading large messages in another thread, where only the newest pending one is read."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator

import pytest

from app.core.messages import reader as reader_module
from app.core.messages.lazy_json import LazyObject
from app.core.messages.reader import LARGE_BYTES, MessageReader, ReadResult, read
from nep.messages.message import Message

WAIT_S = 30.0  # for busy computers; the test ends as soon as the result arrives


def message(data: bytes, codec: str = "json", seq: int = 1) -> Message:
    return Message("/big", data, codec, codec, seq=seq)


@pytest.fixture
def reader() -> Iterator[MessageReader]:
    made = MessageReader()
    yield made
    made.close()


def taken(reader: MessageReader) -> ReadResult:
    pause = threading.Event()
    for _ in range(int(WAIT_S * 100)):
        found = reader.pop_result()
        if found is not None:
            return found
        pause.wait(0.01)
    raise AssertionError("nothing was read")


def large(text: bytes) -> bytes:
    """Return the JSON padded to a size at which it is read lazily."""
    return text + b" " * LARGE_BYTES


def test_small_message_is_decoded_and_invalid_message_returns_an_error() -> None:
    found = read(message(b'{"a": [1, 2]}'))
    assert (found.value, found.index, found.error) == ({"a": [1, 2]}, None, None)
    bad = read(message(b"{bad"))
    assert bad.error
    assert bad.value is None
    assert read(message(b"{}", seq=2)).error is None


def test_large_json_is_indexed_lazily_and_other_messages_are_decoded() -> None:
    found = read(message(large(b'{"a": [1, 2]}')))
    assert isinstance(found.value, LazyObject)
    assert found.index is not None
    assert read(message(b"text", "string")).value == "text"
    assert read(message(b"\xff", "string")).error is not None
    assert read(message(large(b'{"a": '))).error == "unbalanced brackets"


def test_reader_runs_in_another_thread(reader: MessageReader, monkeypatch) -> None:
    threads: list[int] = []
    before = reader_module.read

    def watched(one: Message) -> ReadResult:
        threads.append(threading.get_ident())
        return before(one)

    monkeypatch.setattr(reader_module, "read", watched)
    reader.submit(message(json.dumps({"data": list(range(1000))}).encode()))
    assert len(taken(reader).value["data"]) == 1000  # type: ignore[index, arg-type]
    assert len(threads) == 1
    assert threading.get_ident() not in threads


class SlowRead:
    """Replacement of `read` that blocks until the test releases it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.began, self.go_on = threading.Event(), threading.Event()
        self.seqs: list[int | None] = []
        monkeypatch.setattr(reader_module, "read", self)

    def __call__(self, one: Message) -> ReadResult:
        self.seqs.append(one.seq)
        self.began.set()
        self.go_on.wait(WAIT_S)
        return ReadResult(one, one.seq)


def test_only_newest_pending_message_is_read(reader: MessageReader, monkeypatch) -> None:
    slow = SlowRead(monkeypatch)
    reader.submit(message(b"1", seq=1))
    assert slow.began.wait(WAIT_S)
    for seq in range(2, 50):
        reader.submit(message(b"1", seq=seq))
    assert reader.is_busy
    slow.go_on.set()
    found = taken(reader)
    while found.value != 49:
        found = taken(reader)
    assert slow.seqs == [1, 49]


def test_result_of_cleared_message_is_discarded(reader: MessageReader, monkeypatch) -> None:
    slow = SlowRead(monkeypatch)
    reader.submit(message(b"1", seq=1))
    assert slow.began.wait(WAIT_S)
    reader.clear()
    assert not reader.is_busy
    slow.go_on.set()
    reader.submit(message(b"1", seq=2))
    assert taken(reader).value == 2


def test_low_priority_reads_are_throttled_and_skipped_while_busy(reader: MessageReader) -> None:
    assert reader.submit_throttled(message(b"[1]", seq=1), 10.0)
    assert taken(reader).message.seq == 1
    assert not reader.submit_throttled(message(b"[1]", seq=2), 10.9)
    assert reader.submit_throttled(message(b"[1]", seq=3), 11.0)
    assert taken(reader).message.seq == 3
    reader.clear()  # as when another topic is selected
    assert reader.submit_throttled(message(b"[1]", seq=4), 11.1)
    assert not reader.submit_throttled(message(b"[1]", seq=5), 11.1)
