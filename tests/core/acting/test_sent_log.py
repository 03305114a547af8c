"""Tests of the log of sent messages: bounded, repeats merged into one entry, no large content stored."""

from __future__ import annotations

from app.core.run.acting.sent_log import MAX_ENTRIES, MAX_TEXT_BYTES, SentLog, SentRecord


def entry(at_s: float, words: str = "Still, heard by 1", text: str = "{}", source: str = "{}") -> SentRecord:
    return SentRecord(at_s, "publish", "/cmd_vel", words, text=text, source=source, resend=lambda: "")


def test_repeated_message_is_one_entry_with_count_and_newest_text() -> None:
    log = SentLog()
    for at_s, text in ((1.0, '{"id": "a"}'), (2.0, '{"id": "b"}')):
        log.add(entry(at_s, text=text, source='{"id": {new id}}'), 1)
    (only,) = log.records
    assert (only.number, only.count, only.at_s, only.text) == (1, 2, 2.0, '{"id": "b"}')
    log.add(entry(3.0, "Still, no subscribers", source='{"id": {new id}}'), 1)
    log.add(entry(4.0, source='{"id": 7}'), 1)
    log.add(entry(5.0, source='{"id": 8}'), 1)
    assert [(each.number, each.count) for each in log.records] == [(1, 2), (2, 1), (3, 1), (4, 1)]
    assert (log.total, log.since_s) == (5, 1.0)


def test_arming_changes_are_neither_merged_nor_counted_as_sent() -> None:
    log = SentLog()
    for _ in range(2):
        log.add(SentRecord(1.0, "switch", "", "no longer armed"), 0)
    assert [each.count for each in log.records] == [1, 1]
    assert (log.total, log.since_s) == (0, None)


def test_log_keeps_newest_entries_and_the_total_count() -> None:
    log = SentLog()
    for number in range(MAX_ENTRIES + 50):
        log.add(entry(float(number), f"{number}"), 1)
    assert len(log.records) == MAX_ENTRIES
    assert log.records[0].result_text == "50"
    assert log.get(50) is None
    assert log.get(51) is log.records[0]
    revision = log.revision
    log.clear()
    assert list(log.records) == []
    assert (log.total, log.since_s) == (MAX_ENTRIES + 50, 0.0)
    assert log.revision > revision
    log.add(entry(1.0), 1)
    assert log.records[0].number == MAX_ENTRIES + 51, "a number is never used again"


def test_large_message_is_listed_without_its_content() -> None:
    log = SentLog()
    at_the_limit, over_it = "x" * MAX_TEXT_BYTES, "\N{EURO SIGN}" * (MAX_TEXT_BYTES // 2)
    for text in (at_the_limit, over_it, over_it + "x"):
        log.add(entry(1.0, text=text, source=text), 1)
    kept, gone = log.records
    assert (kept.text, kept.resend is not None) == (at_the_limit, True)
    assert (gone.text, gone.source, gone.resend, gone.count) == ("", "", None, 2)
