"""Tests of the console, which keeps the newest records."""

from __future__ import annotations

import orjson

from app.core.world.console import MAX_TEXT_LENGTH, Console
from nep.messages.message import Message
from nep.nodes.log_handler import LOG_TOPIC, LOG_TYPE


def test_console_keeps_the_newest_records_in_order() -> None:
    console = Console(lambda: 5.0, capacity=3)
    for number in range(5):
        console.add("info", "test", str(number))
    assert [record.text for record in console.records] == ["2", "3", "4"]
    assert console.revision == 5
    assert console.records[0].stamp_s == 5.0


def test_long_text_is_truncated_and_shows_its_length() -> None:
    console = Console()
    console.add("info", "test", "x" * (MAX_TEXT_LENGTH + 10))
    assert console.records[0].text.endswith(f"… ({MAX_TEXT_LENGTH + 10} characters)")


def test_clear_removes_all_records() -> None:
    console = Console()
    console.add("warn", "test", "a")
    console.clear()
    assert not console.records


class Sent(Message):
    """Message that counts how often it is decoded."""

    reads = 0

    @property
    def payload(self) -> object:
        self.reads += 1
        return super().payload


def record(**given: object) -> Sent:
    return Sent(LOG_TOPIC, orjson.dumps(given), "json", LOG_TYPE, stamp_ns=7_000_000_000)


def test_log_records_are_decoded_lazily() -> None:
    console = Console(lambda: 5.0)
    console.add("info", "studio", "first")
    sent = record(
        level="warning", text="low", name="driver", node="Pepper", stamp_ns=9_000_000_000, file="a.py", line=3
    )
    console.add_messages([sent])
    console.add("info", "studio", "last")
    assert console.revision == 3
    assert sent.reads == 0
    first, told, last = console.records
    assert (first.text, last.text) == ("first", "last")
    assert (told.level, told.origin, told.logger, told.text) == ("warn", "Pepper", "driver", "low")
    assert (told.stamp_s, told.location) == (9.0, "a.py:3")
    assert [line.number for line in console.records] == [1, 2, 3]
    assert (console.revision, sent.reads) == (3, 1)  # parsed once, without changing the revision


def test_dropped_records_are_counted() -> None:
    console = Console()
    console.add_messages([record(text="newest")], dropped=744)
    console.add_messages([], dropped=1)
    assert [line.text for line in console.records] == [
        "744 log records were dropped: too many at once",
        "newest",
        "1 log record was dropped: too many at once",
    ]
    assert console.dropped_count == 745


def test_records_of_a_local_program_are_not_duplicated() -> None:
    console = Console()
    console.ignore_process(None)
    console.ignore_process(77)
    console.add_messages([record(text="mine", pid=77), record(text="theirs", pid=78), record(text="unsaid")])
    assert [line.text for line in console.records] == ["theirs", "unsaid"]


def test_undecodable_log_message_is_skipped_and_unusual_records_are_shown() -> None:
    console = Console(lambda: 5.0)
    console.add_messages([
        Message(LOG_TOPIC, b"{oops", "json", LOG_TYPE),
        Message(LOG_TOPIC, b'"only words"', "json", LOG_TYPE),
        record(level="critical", text="x" * (MAX_TEXT_LENGTH + 1), node="a", name="a"),
    ])  # fmt: skip
    words, long = console.records
    assert (words.text, words.origin, words.stamp_s) == ("only words", "unknown sender", 5.0)
    assert (long.level, long.logger) == ("critical", "")
    assert long.text.endswith(f"… ({MAX_TEXT_LENGTH + 1} characters)")


def test_full_console_of_unread_records_keeps_the_newest() -> None:
    console = Console(capacity=3)
    console.add_messages([record(text=str(number)) for number in range(10)])
    console.add("info", "studio", "end")
    assert [line.text for line in console.records] == ["8", "9", "end"]
