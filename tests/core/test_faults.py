"""Tests of the log of Studio's internal errors: logged once with a count, without blocking later ones."""

from __future__ import annotations

import logging
import sys
import threading
from collections.abc import Iterator, Sequence
from functools import partial
from operator import attrgetter
from pathlib import Path

import pytest

import nep
from app.blocks.runtime.events import ProgramRunning
from app.core import faults
from app.core.faults import FaultAlerts, LogFile, RepeatFilter, error_text
from app.core.network.source import GraphReceived, JobFailed, LiveSource, MasterFound
from app.core.robots.stop.report import StopCompleted
from app.core.session import Session
from app.core.storage.settings import Settings
from app.intents import ShowLog
from app.robots.client.stop_report import StopReport
from nep.masters.master import Master
from nep.messages.message import Message

ADDRESS = "127.0.0.1:1"


@pytest.fixture
def log(tmp_path: Path) -> Iterator[logging.Logger]:
    """Separate logger that writes to ``log/studio.log``."""
    logger = logging.getLogger("studio.of-this-test")
    logger.propagate = False
    handler = LogFile(tmp_path / "log")
    logger.addHandler(handler)
    yield logger
    logger.removeHandler(handler)
    handler.close()


def written(folder: Path) -> str:
    return (folder / "log" / "studio.log").read_text("utf-8")


# -- repeated faults -------------------------------------------------------------------------------


def test_repeated_fault_is_logged_at_increasing_intervals_with_its_count(
    log: logging.Logger, tmp_path: Path
) -> None:
    for number in range(1000):
        try:
            int(f"x{number}")  # another message each time, raised at the same line
        except ValueError:
            log.exception("can't read number %d", number)
    text = written(tmp_path)
    assert text.count("Traceback") == 1
    assert [line.rpartition(": ")[2] for line in text.splitlines() if " studio.of-this-test: " in line] == [
        "can't read number 0",
        "can't read number 9 (10 times)",
        "can't read number 99 (100 times)",
        "can't read number 999 (1000 times)",
    ]


def test_repeated_fault_is_logged_once_until_it_is_evicted() -> None:
    once = RepeatFilter()

    def said(text: str) -> bool:
        return once.filter(logging.LogRecord("qt", logging.WARNING, "", 0, text, (), None)) is not None

    assert [said(text) for text in ("one", "other", "one", "other")] == [True, True, False, False]
    assert all(said(f"text {number}") for number in range(2 * faults.MAX_COUNTED_FAULTS))
    assert len(once._counts) == faults.MAX_COUNTED_FAULTS
    assert said("one")  # evicted, so it counts as new


# -- log file --------------------------------------------------------------------------------------


def test_log_file_is_private_and_rotated(log: logging.Logger, tmp_path: Path) -> None:
    for number in range(60):
        log.error("%d %s", number, "x" * 100_000)
    files = sorted(path.name for path in (tmp_path / "log").iterdir())
    assert files == ["studio.log", "studio.log.1", "studio.log.2", "studio.log.3"]
    assert sum(path.stat().st_size for path in (tmp_path / "log").iterdir()) < 4.5 * faults.FILE_BYTES
    if sys.platform != "win32":
        assert {path.stat().st_mode & 0o777 for path in (tmp_path / "log").iterdir()} == {0o600}


def test_log_file_is_appended_after_an_update_and_names_the_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for version in ("0.0.9", "0.1.0"):
        monkeypatch.setattr(faults, "__version__", version)
        handler = LogFile(tmp_path / "log")
        for number in range(2):
            handler.handle(logging.LogRecord("a", logging.ERROR, "", 0, f"{version} {number}", (), None))
        handler.close()
    lines = written(tmp_path).splitlines()
    assert [line.partition(": ")[2] for line in lines] == [
        "NEP Studio 0.0.9 writes from here on", "0.0.9 0", "0.0.9 1",
        "NEP Studio 0.1.0 writes from here on", "0.1.0 0", "0.1.0 1",
    ]  # fmt: skip


def test_each_log_file_names_the_version(log: logging.Logger, tmp_path: Path) -> None:
    for number in range(12):
        log.error("%d %s", number, "x" * 100_000)
    for path in (tmp_path / "log").iterdir():
        assert f"NEP Studio {faults.__version__} writes" in path.read_text("utf-8").partition("\n")[0]


def test_failure_to_create_the_log_folder_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("a file", "utf-8")
    handler = LogFile(tmp_path / "log")
    record = logging.LogRecord("studio", logging.ERROR, "", 0, "a fault \ud800", (), None)
    handler.handle(record)
    handler.close()
    assert (tmp_path / "log").read_text("utf-8") == "a file"


# -- unhandled exceptions --------------------------------------------------------------------------


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    """Log capture with the exception hooks of Studio installed during the test."""
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    faults.install_hooks()
    return caplog


def test_unhandled_exceptions_are_logged(heard: pytest.LogCaptureFixture) -> None:
    class Ends:
        def __del__(self) -> None:
            raise OSError("while it ends")

    def fail() -> None:
        raise KeyError("key")

    sys.excepthook(ValueError, ValueError("a slot of Qt"), None)
    thread = threading.Thread(target=fail, name="some thread")
    thread.start()
    thread.join()
    one = Ends()
    del one
    assert [record.getMessage() for record in heard.records] == [
        "uncaught exception: ValueError: a slot of Qt",
        "uncaught exception in thread 'some thread': KeyError: 'key'",
        "exception ignored in a finalizer: OSError: while it ends",
    ]


def test_system_exit_and_keyboard_interrupt_are_not_logged_as_faults(
    heard: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    thread = threading.Thread(target=sys.exit)
    thread.start()
    thread.join()
    sys.excepthook(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert not heard.records
    assert "KeyboardInterrupt" in capsys.readouterr().err


def test_exception_is_formatted_on_one_line() -> None:
    assert error_text(ValueError("two\nlines")) == "ValueError: two lines"
    assert error_text(KeyError()) == "KeyError"


# -- faults in a tick ------------------------------------------------------------------------------


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """Return a session that is never started and has no threads and no sockets."""
    return Session(Settings(tmp_path), address=ADDRESS, journal_folder=tmp_path / "j", start_processes=False)


def raising(*_given: object) -> object:
    return int("x")


def test_event_handler_that_raises_does_not_block_other_events(
    session: Session, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    stopped: list[object] = []
    monkeypatch.setattr(session.runs, "on_runner_event", raising)
    monkeypatch.setattr(session.runs, "on_stop", stopped.append)
    done = StopCompleted(1, StopReport((), 0.0))
    for _ in range(29):
        for event in (ProgramRunning(run=1), done, MasterFound(ADDRESS)):
            session._mailbox.post_event(event)
        session.tick()
    assert stopped == [done] * 29
    assert session.live.master.kind == "connected"
    (alert,) = [alert for alert in session.alerts.active if alert.id == "studio"]
    assert alert.detail.startswith("Studio can't handle ProgramRunning: ValueError")
    assert alert.intent == ShowLog()
    once = RepeatFilter()
    assert sum(once.filter(record) is not None for record in caplog.records) == 2  # the first, and the tenth


@pytest.mark.parametrize(
    "place",
    [
        "live.topics.add",
        "live.topics.update_ages",
        "live.nodes.update_ages",
        "live.series.dispatch",
        "traffic.add",
        "traffic.count_lost",
        "fleet.add",
        "fleet.pop_settled_robots",
        "launcher.start_requested_robots",
        "launcher.check",
        "documents.set_topics",
        "runs.on_runner_event",
        "live.pop_check_results",
        "_health.update",
        "_health.check",
        "live.source.lost_counts",
        "console.add_messages",
    ],
)
def test_stop_and_messages_are_processed_when_part_of_a_tick_raises(
    session: Session, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    part, _, name = place.rpartition(".")
    monkeypatch.setattr(attrgetter(part)(session), name, raising)
    watch = session.live.watch("/faces")
    stopped: list[object] = []
    monkeypatch.setattr(session.runs, "on_stop", stopped.append)
    message = Message("/faces", b"{}", "json", "json", stamp_ns=1, seq=1, publisher=1)
    for _ in range(2):
        session._mailbox.post("/log", [message])
        session._mailbox.post("/faces", [message])
        session._mailbox.post_event(ProgramRunning(run=1))
        session._mailbox.post_event(StopCompleted(1, StopReport((), 0.0)))
        session.tick()
    assert len(stopped) == 2
    if place != "live.topics.add":
        assert session.live.topics["/faces"].received == 2
    watch.close()


def test_fault_alert_is_resolved_after_the_operation_succeeds_for_some_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [100.0]
    session = Session(
        Settings(tmp_path),
        address=ADDRESS,
        journal_folder=tmp_path / "j",
        start_processes=False,
        clock=lambda: now[0],
    )

    def seconds(count: int) -> None:
        for _ in range(count):
            now[0] += 1.0
            session.tick()

    with monkeypatch.context() as broken:
        broken.setattr(session.live.nodes, "update_ages", raising)
        broken.setattr(session.traffic, "add", raising)
        seconds(90)
        assert session.alerts.has("studio"), "it goes on"
    with monkeypatch.context() as broken:
        broken.setattr(session.traffic, "add", raising)
        seconds(6)
        (alert,) = [alert for alert in session.alerts.active if alert.id == "studio"]
        assert alert.detail.startswith("Studio can't count messages: "), "the other one is over"
    seconds(4)
    assert session.alerts.has("studio"), "what fails now and then does not flicker"
    seconds(2)
    assert not session.alerts.has("studio")


def test_fault_alert_expires_if_the_fault_cannot_recur(session: Session) -> None:
    now = [0.0]
    alerts = session.alerts
    faults = FaultAlerts(alerts, lambda: now[0])
    for number in range(300):
        with faults.guarded(f"take over messages of /t{number}"):
            raising()
    faults.check()
    assert alerts.has("studio")
    now[0] = 61.0
    faults.check()
    assert not alerts.has("studio")


def test_session_close_continues_if_closing_some_components_raises(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[str] = []
    for part in ("fleet", "live.images", "live.networks", "doctor", "launcher", "remote_access"):
        monkeypatch.setattr(attrgetter(part)(session), "close", partial(ended.append, part))
    monkeypatch.setattr(session.runs, "close", raising)
    monkeypatch.setattr(session.live.source, "close", raising)
    session.close()
    assert ended == ["fleet", "live.images", "live.networks", "doctor", "launcher", "remote_access"]


def test_source_thread_survives_exceptions_in_jobs_and_sinks(master: Master) -> None:
    """Without this thread Studio receives no messages, and the robots no Stop."""
    events: list[object] = []
    came = threading.Event()

    def sink(_topic: str, messages: Sequence[Message]) -> None:
        came.set()

    source = LiveSource(master.address, [raising, sink], events.append)
    source.watch("/talk")
    source.start()
    try:
        done = threading.Event()
        source.submit("do the impossible", raising)
        source.submit("do it", lambda _node: done.set())
        assert done.wait(20)
        assert [e.message for e in events if isinstance(e, JobFailed)] == [
            "ValueError: invalid literal for int() with base 10: 'x'"
        ]
        with nep.node("talker", master=master.address) as node:
            publisher = node.new_pub("/talk", "json", latched=True)
            publisher.publish({"n": 1})
            assert came.wait(20)
    finally:
        source.close()


def test_source_thread_survives_an_exception_in_the_graph_handler(
    master: Master, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[object] = []
    again = threading.Event()

    def take(event: object) -> None:
        if isinstance(event, GraphReceived):
            seen.append(event)
            if len(seen) > 1:
                again.set()
                return
            int("x")

    source = LiveSource(master.address, [], take)
    source.start()
    try:
        assert again.wait(20)
    finally:
        source.close()
    assert "can't poll the network" in caplog.text


class Unsayable:
    def __str__(self) -> str:
        raise ValueError("no words")


@pytest.mark.parametrize(
    ("text", "value", "said"),
    [
        ("%d items", "many", "%d items (its arguments can't be formatted: TypeError)"),
        ("it is %s", Unsayable(), "it is %s (its arguments can't be formatted: ValueError)"),
        (Unsayable(), None, "Unsayable (its arguments can't be formatted: ValueError)"),
    ],
)
def test_log_call_that_cannot_be_formatted_does_not_raise_and_keeps_its_text(
    tmp_path: Path, text: object, value: object, said: str
) -> None:
    """Any library can log such a record; Python's own handlers don't raise either."""
    logger = logging.Logger("a library")  # noqa: LOG001 - without the handlers of pytest, which raise
    handler = LogFile(tmp_path)
    logger.addHandler(handler)
    for _ in range(10):
        logger.warning(text, *([] if value is None else [value]))
    handler.close()
    written = (tmp_path / "studio.log").read_text()
    assert written.count(said) == 2
    assert "(10 times)" in written
