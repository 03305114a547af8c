"""Tests of the log: irrelevant messages of Qt and Chromium are dropped, all others are kept."""

from __future__ import annotations

import io
import json
import logging
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from PySide6.QtCore import QMessageLogContext, QtMsgType

from app.core.faults import CONSOLE_EXTRA, LogFile
from app.ui.startup.qt_log import (
    FLAGS_VARIABLE,
    ConsoleHandler,
    TerminalHandler,
    on_qt_message,
    quiet_chromium,
)


@pytest.mark.parametrize(
    ("words", "heard"),
    [
        ("Failed to load vulkan: Cannot load library vulkan: no such file", False),
        ("Failed to create Vulkan instance: -9", False),
        ("initInstance: No Vulkan library available", False),
        ("Unable to detect GPU vendor for device: Mesa/X.org llvmpipe", False),
        ("Sandboxing disabled by user.", False),
        ('Error loading text-to-speech plug-in "speechd"', False),
        ("QObject::connect: signal not found", True),
        ("The page says: Failed to load vulkan:", True),
    ],
)
def test_only_known_irrelevant_qt_messages_are_discarded(
    caplog: pytest.LogCaptureFixture, words: str, heard: bool
) -> None:
    on_qt_message(QtMsgType.QtWarningMsg, QMessageLogContext(), words)
    assert [record.getMessage() for record in caplog.records] == ([words] if heard else [])


def test_fatal_qt_messages_are_always_logged(caplog: pytest.LogCaptureFixture) -> None:
    on_qt_message(QtMsgType.QtFatalMsg, QMessageLogContext(), "Unable to detect GPU vendor")
    assert caplog.records[0].levelno == logging.CRITICAL


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (None, "--log-level=3"),
        ("--disable-gpu", "--disable-gpu --log-level=3"),
        ("--enable-logging=stderr", "--enable-logging=stderr"),
        ("--log-level=0", "--log-level=0"),
    ],
)
def test_chromium_flags_of_the_user_are_kept(before: str | None, after: str) -> None:
    environ = {} if before is None else {FLAGS_VARIABLE: before}
    quiet_chromium(environ)
    assert environ[FLAGS_VARIABLE] == after
    assert "sandbox" not in environ[FLAGS_VARIABLE]


def test_log_records_are_buffered_until_drained_by_the_console() -> None:
    log = ConsoleHandler()
    logger = logging.getLogger("qt.test_messages")
    logger.addHandler(log)
    try:
        logger.warning("a %s", "warning")
        logger.error("an error")
        logger.info("nothing")
    finally:
        logger.removeHandler(log)
    lines: list[tuple[str, str, str]] = []
    log.drain(lambda *line: lines.append(line))
    log.drain(lambda *line: lines.append(line))
    assert lines == [("warn", "qt", "a warning"), ("error", "qt", "an error")]


class Stuck(io.StringIO):
    """Stream that blocks in `write` until released, like a terminal stopped by Ctrl+S."""

    def __init__(self):
        super().__init__()
        self.may_go_on = threading.Event()

    def write(self, text):
        assert self.may_go_on.wait(60.0)
        return super().write(text)


def test_blocked_terminal_does_not_block_logging():
    stuck = Stuck()
    handler = TerminalHandler(stuck)
    for n in range(1000):
        handler.handle(
            logging.makeLogRecord({"name": "qt", "levelno": logging.WARNING, "msg": f"no. {n}\x1b[2J"})
        )
    stuck.may_go_on.set()
    handler.close()
    assert stuck.getvalue().splitlines() == [f"qt: no. {n}\\x1b[2J" for n in range(1000)]


WINDOWED = """
import json, sys, threading
sys.stdout = sys.stderr = None
from PySide6.QtCore import qWarning
from app.ui.startup.qt_log import install_handlers
log = install_handlers()
def fail():
    raise ValueError("in a thread")
thread = threading.Thread(target=fail)
thread.start()
thread.join()
qWarning("of Qt")
told = []
log.drain(lambda *line: told.append(line))
with open(sys.argv[1], "w") as file:
    json.dump(told, file)
raise ValueError("at the end")
"""


def test_windowed_studio_logs_uncaught_exceptions_to_console_and_file(tmp_path: Path) -> None:
    environment = {**os.environ, "NEP_STUDIO_HOME": str(tmp_path / "home")}
    out = tmp_path / "told.json"
    subprocess.run([sys.executable, "-c", WINDOWED, str(out)], env=environment, check=False, timeout=140)
    told = json.loads(out.read_text("utf-8"))
    assert any("in a thread" in words for _level, _origin, words in told)
    assert any("of Qt" in words for _level, _origin, words in told)
    written = "".join(file.read_text("utf-8") for file in (tmp_path / "home").rglob("*.log"))
    assert [words in written for words in ("in a thread", "of Qt", "at the end")] == [True] * 3


def test_record_already_shown_in_the_console_is_written_to_the_log_file_only(tmp_path: Path) -> None:
    logger, log, file = logging.getLogger("studio.test_messages"), ConsoleHandler(), LogFile(tmp_path)
    for handler in (log, file):
        logger.addHandler(handler)
    try:
        logger.error("the panel 'a' stopped", extra=CONSOLE_EXTRA)
    finally:
        for handler in (log, file):
            logger.removeHandler(handler)
            handler.close()
    told: list[str] = []
    log.drain(lambda _level, _origin, words: told.append(words))
    assert told == []
    assert "the panel 'a' stopped" in (tmp_path / "studio.log").read_text("utf-8")
