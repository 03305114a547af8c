"""Tests of log records as messages: no cost for nodes that never log, bounded for those that log too much."""

from __future__ import annotations

import logging
import sys
import threading

import pytest

import nep
from nep.errors import ClosedError, MasterUnreachable
from nep.nodes.log_handler import (
    LEVELS,
    LOG_TOPIC,
    LOG_TYPE,
    MAX_BURST,
    MAX_LAST_ERRORS,
    MAX_TEXT_LENGTH,
    LogHandler,
    LogRecord,
    NewErrorFilter,
    parse_level,
)
from tests.nep.programs import eventually, running


class Kept:
    """Fake publisher that stores records; `opened` counts the attempts to open it."""

    def __init__(self, failures=()):
        self.records, self.opened, self._failures = [], 0, list(failures)

    def open(self):
        self.opened += 1
        if self._failures:
            raise self._failures.pop(0)
        return self

    def publish(self, payload):
        self.records.append(payload)

    @property
    def texts(self):
        return [record["text"] for record in self.records]


@pytest.fixture(autouse=True)
def _long_flush_timeout(monkeypatch):
    """Wait long for queued records, so that a busy computer doesn't exceed the limit."""
    monkeypatch.setattr(LogHandler.close, "__defaults__", (60.0,))


@pytest.fixture
def kept():
    return Kept()


@pytest.fixture
def handler(kept):
    made = LogHandler("robot", kept.open)
    yield made
    made.close()


def test_last_errors_are_published_as_one_list_with_a_limited_length_and_truncated_texts():
    records, errors = Kept(), Kept([MasterUnreachable("127.0.0.1:1", 2.0)])
    handler = LogHandler("robot", records.open, open_errors=errors.open)
    handler.logger.info("fine")
    handler.logger.error("one, when nobody keeps it yet")
    eventually(lambda: len(records.records) == 2)
    for number in range(30):
        handler.logger.error("error %d %s", number, "x" * 2000)
    handler.close()
    assert "fine" not in str(errors.records)
    assert len(errors.records[-1]) == MAX_LAST_ERRORS
    assert [record["text"][:8] for record in errors.records[-1]] == [
        f"error {number}" for number in range(10, 30)
    ]
    assert all(len(record["text"]) < 1100 for record in errors.records[-1])


def test_error_publisher_is_not_opened_without_errors(kept):
    errors = Kept()
    handler = LogHandler("robot", kept.open, open_errors=errors.open)
    handler.logger.warning("nearly")
    handler.close()
    assert errors.opened == 0


def test_error_received_on_both_topics_is_shown_once():
    shown = NewErrorFilter()
    one, two = ({"level": "error", "text": text, "node": "robot", "stamp_ns": 7} for text in ("one", "two"))
    assert shown.is_new(LogRecord.from_plain(one))
    assert [record.text for record in shown.new_records([two, one])] == ["two"]
    assert not shown.is_new(LogRecord.from_plain(two))
    fine = LogRecord.from_plain({"text": "fine", "node": "robot", "stamp_ns": 7})
    assert shown.is_new(fine)
    assert shown.is_new(fine)


@pytest.mark.parametrize(
    "payload", [None, 7, "text", {}, [None], [[]], [{}], [{"stamp_ns": 2**70, "level": "error"}]]
)
def test_malformed_error_list_is_ignored(payload):
    assert NewErrorFilter().new_records(payload) == []


def test_memory_of_shown_errors_is_bounded():
    shown = NewErrorFilter()
    for number in range(5000):
        assert shown.is_new(LogRecord("error", "x", "n", "robot", number + 1))
    assert len(shown._shown_errors) <= 2000
    assert (
        len(shown.new_records([{"level": "error", "stamp_ns": 10_000 + number} for number in range(999)]))
        == MAX_LAST_ERRORS
    )


def test_log_record_has_level_text_logger_node_time_location_and_process(handler, kept):
    handler.logger.warning("at %d %%", 9)
    handler.close()
    (record,) = kept.records
    given = LogRecord.from_plain(record)
    assert (given.level, given.text, given.name, given.node) == ("warning", "at 9 %", "robot", "robot")
    assert given.file == "test_logs.py"
    assert given.line
    assert given.pid
    assert given.stamp_ns > 1_700_000_000_000_000_000
    assert given.to_plain() == record


def test_node_that_never_logs_has_no_log_thread_and_no_publisher(handler, kept):
    threads = set(threading.enumerate())
    handler.logger.debug("too quiet")
    handler.close()
    assert kept.opened == 0
    assert set(threading.enumerate()) == threads


def test_record_handled_by_node_and_root_logger_is_published_once(handler, kept):
    root = logging.getLogger()
    root.addHandler(handler)
    try:
        handler.logger.error("once")
        logging.getLogger("driver").error("also")
    finally:
        root.removeHandler(handler)
    handler.close()
    assert kept.texts == ["once", "also"]


def test_logged_exception_includes_its_traceback(handler, kept):
    try:
        raise ValueError("no such luck")
    except ValueError:
        handler.logger.exception("it broke")
    handler.close()
    assert kept.texts[0].startswith("it broke\nTraceback")
    assert kept.texts[0].endswith("ValueError: no such luck")


def test_log_burst_is_limited_and_dropped_records_are_counted_exactly(kept):
    now = [0.0]
    handler = LogHandler("robot", kept.open, clock=lambda: now[0])
    for number in range(10_000):
        handler.logger.info("%d", number)
    handler.close()
    told = sum(int(text.split()[0]) for text in kept.texts if not text.isdigit())
    shown = [text for text in kept.texts if text.isdigit()]
    assert shown == [str(number) for number in range(MAX_BURST)]
    assert told == 10_000 - MAX_BURST


def test_rate_limited_logging_resumes_after_a_pause(kept):
    now = [0.0]
    handler = LogHandler("robot", kept.open, rate_hz=10, burst=2, clock=lambda: now[0])
    for text in ("a", "b", "c"):
        handler.logger.info(text)
    now[0] = 0.11
    handler.logger.info("d")
    handler.close()
    dropped = "1 log record was dropped: the limit is 10 per second"
    assert [text for text in kept.texts if text != dropped] == ["a", "b", "d"]
    assert dropped in kept.texts


def test_records_wait_for_a_master_and_are_dropped_when_the_node_closes():
    kept = Kept([MasterUnreachable("127.0.0.1:1", 0.1)])
    handler = LogHandler("robot", kept.open)
    handler.logger.info("early")
    eventually(lambda: kept.texts == ["early"])
    handler.close()
    gone = Kept([ClosedError("node")])
    handler = LogHandler("robot", gone.open)
    handler.logger.info("late")
    handler.close()
    handler.logger.info("later")
    assert not gone.records


def test_unformattable_record_does_not_raise_and_long_text_is_truncated(handler, kept, capsys):
    handler.logger.propagate = False  # pytest's own handler raises
    handler.logger.info("%d", "no number")
    handler.logger.info("x" * (MAX_TEXT_LENGTH + 5))
    handler.close()
    assert kept.texts == [f"{'x' * MAX_TEXT_LENGTH}… ({MAX_TEXT_LENGTH + 5} characters)"]
    capsys.readouterr()  # logging prints the formatting error to stderr


@pytest.mark.parametrize(
    ("payload", "level", "text"),
    [
        ({"level": "WARN", "text": "x"}, "warning", "x"),
        ({"level": 7, "text": None, "line": "no", "stamp_ns": -1, "node": 5}, "info", ""),
        ({"level": "fatal", "text": {"a": 1}}, "critical", "{'a': 1}"),
        ("only words", "info", "only words"),
        ([1, 2], "info", "[1, 2]"),
        (None, "info", ""),
    ],
)
def test_any_payload_is_converted_to_a_log_record(payload, level, text):
    record = LogRecord.from_plain(payload, 5)
    assert (record.level, record.text, record.stamp_ns, record.node) == (level, text, 5, "")


def test_log_level_names_are_parsed_case_insensitively_with_info_as_the_default():
    assert [parse_level(name.upper()) for name in LEVELS] == list(LEVELS)
    assert parse_level(None) == "info"


@pytest.mark.usefixtures("patient")
def test_subscriber_receives_log_records_that_closing_the_node_flushes(master):
    with nep.node("page") as page, page.new_sub(LOG_TOPIC, LOG_TYPE) as sub:
        with nep.node("robot") as robot:
            assert LOG_TOPIC not in robot.graph().topics or not robot.graph().topics[LOG_TOPIC].publishers
            robot.log.warning("hello")
            robot.log.debug("unheard")
        assert sub.listen(timeout_s=30.0)[1]["text"] == "hello"
        assert sub.listen(timeout_s=0) == (False, {})


def test_logging_without_a_master_does_not_delay_close(monkeypatch):
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")
    with nep.node("alone", wait_s=0.05) as node:
        node.log.error("this has no subscribers")


def test_rate_limit_accumulates_at_most_one_burst(kept):
    now = [0.0]
    handler = LogHandler("robot", kept.open, rate_hz=10, burst=3, clock=lambda: now[0])
    now[0] = 3600.0
    for number in range(10):
        handler.logger.info("%d", number)
    handler.close()
    assert [text for text in kept.texts if text.isdigit()] == ["0", "1", "2"]


def test_records_logged_while_publishing_are_not_published():
    kept = Kept()

    class Chatty:
        def publish(self, payload):
            kept.publish(payload)
            logging.getLogger("wire").error("I publish")

    handler, root = LogHandler("robot", Chatty, burst=50), logging.getLogger()
    root.addHandler(handler)
    try:
        handler.logger.info("once")
        eventually(lambda: kept.texts)
        handler.close()
    finally:
        root.removeHandler(handler)
    assert kept.texts == ["once"]


def test_queue_of_records_without_a_master_is_bounded():
    came, kept = threading.Event(), Kept()

    def open_late():
        assert came.wait(60.0)
        return kept

    handler = LogHandler("robot", open_late, burst=5_000)
    for number in range(3_000):
        handler.logger.info("%d", number)
    came.set()
    handler.close(60.0)
    assert len([text for text in kept.texts if text.isdigit()]) == 1_000
    assert any(text.startswith("2000 log records ") for text in kept.texts)


@pytest.mark.skipif(sys.platform != "linux", reason="limits memory as Linux does")
def test_record_is_dropped_if_the_log_thread_cannot_start():
    """From Python 3.12 on this happens at interpreter exit; here a memory limit causes the same error."""
    code = """
    import resource, threading
    from nep.nodes.log_handler import LogHandler
    handler = LogHandler("robot", lambda: None)
    threading.stack_size(1 << 30)
    resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
    handler.logger.warning("nobody can publish this")
    print(handler.unreported_drops)
    handler.close()
    """
    with running(code) as program:
        assert program.line() == "1"
        assert program.end()[1] == ""
        assert program.process.returncode == 0
