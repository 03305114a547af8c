"""Logging of Qt, Chromium and Studio to stderr, to the log files and to the Console.

Qt and Chromium log many harmless messages on machines without a GPU or a message bus, although Studio
works there. Messages that are known to be harmless are dropped.
"""

from __future__ import annotations

import logging
import os
import re
import sys
from collections import deque
from collections.abc import Callable, MutableMapping
from typing import TextIO

from PySide6.QtCore import QMessageLogContext, QtMsgType, qInstallMessageHandler

from app.core import faults
from app.core.faults import RepeatFilter
from nep.system import terminal

FLAGS_VARIABLE = "QTWEBENGINE_CHROMIUM_FLAGS"
QUIET_FLAG = "--log-level=3"  # only fatal messages of Chromium
NO_PLATFORM_MESSAGE = "no Qt platform plugin could be initialized"
MAX_RECORDS = 200

NOISE_PATTERN = re.compile(
    r"Failed to load vulkan:|initInstance: No Vulkan library available$"
    r"|Failed to create (platform )?Vulkan instance(: -\d+)?$|QVulkanInstance: Failed to initialize Vulkan$"
    r"|Unable to detect GPU vendor|GBM is not supported with the current configuration"
    r"|GPUInfo not initialized on GpuInfoUpdate|Sandboxing disabled by user"
    r"|Couldn't (load|resolve) (pipewire|va)\b.* (library|symbols)$"
    r"|Error loading text-to-speech plug-in "  # the speaker reports missing voices itself
    r"|PulseAudioService: pa_context_connect\(\) failed$|Using Qt multimedia with FFmpeg "
    r"|This plugin does not support (propagateSizeHints|raise|createPlatformVulkanInstance)"
)
LEVELS = {
    QtMsgType.QtDebugMsg: logging.DEBUG,
    QtMsgType.QtInfoMsg: logging.INFO,
    QtMsgType.QtWarningMsg: logging.WARNING,
    QtMsgType.QtCriticalMsg: logging.ERROR,
    QtMsgType.QtFatalMsg: logging.CRITICAL,
}

_log = logging.getLogger("qt")


def quiet_chromium(environ: MutableMapping[str, str]) -> None:
    """Limit Chromium's log to fatal messages, unless the flags in the environment configure it."""
    flags = environ.get(FLAGS_VARIABLE, "")
    if "--log-level" not in flags and "--enable-logging" not in flags:
        environ[FLAGS_VARIABLE] = f"{flags} {QUIET_FLAG}".strip()


def on_qt_message(kind: QtMsgType, _context: QMessageLogContext, message: str) -> None:
    """Log a message of Qt, unless it is known to be harmless.

    If Qt can't open a window, the process exits with code 2 after a log message of our own, because Qt
    would abort and advise to reinstall the application. This happens during startup, so no work is
    lost.
    """
    if kind == QtMsgType.QtFatalMsg and NO_PLATFORM_MESSAGE in message:
        _log.critical(
            "no window can open; check that the display exists and accepts connections (DISPLAY is %r), and "
            "that the libraries that Qt names above are installed, or run a behaviour without a window: "
            "nep-studio run FILE",
            os.environ.get("DISPLAY", ""),
        )
        logging.shutdown()
        os._exit(2)
    if kind == QtMsgType.QtFatalMsg or NOISE_PATTERN.match(message) is None:
        _log.log(LEVELS.get(kind, logging.WARNING), "%s", message)


class ConsoleHandler(logging.Handler):
    """Logging handler that stores warnings and errors for the Console. Thread-safe."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._repeat_filter = RepeatFilter()
        self._records: deque[tuple[str, str, str]] = deque(maxlen=MAX_RECORDS)

    def emit(self, record: logging.LogRecord) -> None:
        """Store a record; repetitions are combined and stored with their count.

        Records that are already in the Console (attribute ``in_console``) are ignored.
        """
        if getattr(record, "in_console", False):
            return
        filtered = self._repeat_filter.filter(record)
        if filtered is not None:
            level = "error" if filtered.levelno >= logging.ERROR else "warn"
            self._records.append((level, filtered.name.partition(".")[0], filtered.getMessage()))

    def drain(self, add_record: Callable[[str, str, str], object]) -> None:
        """Remove the stored records and pass them to a function, oldest first.

        Args:
            add_record: Called with level ("warn" or "error"), origin and text of each record.
        """
        while self._records:
            add_record(*self._records.popleft())


class TerminalHandler(logging.StreamHandler[terminal.Terminal]):
    """Logging handler that writes warnings and errors to stderr, with a traceback for new errors.

    Never blocks the calling thread, even if the terminal stops accepting output.
    """

    def __init__(self, stream: TextIO | None) -> None:
        super().__init__(terminal.Terminal(stream))
        self._repeat_filter = RepeatFilter()
        self.setLevel(logging.WARNING)
        self.setFormatter(terminal.LineFormatter("%(name)s: %(message)s"))

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record; repetitions are combined and written with their count."""
        filtered = self._repeat_filter.filter(record)
        if filtered is not None:
            super().emit(filtered)
            if filtered.levelno >= logging.CRITICAL:  # Qt ends the program after this message
                self.stream.drain()

    def close(self) -> None:
        """Write pending output within a time limit; called by `logging` at exit."""
        self.stream.close()
        super().close()


def install_handlers() -> ConsoleHandler:
    """Install handlers for Qt's messages, uncaught exceptions and log records.

    Records also go to stderr and to the log files (`app.core.faults`).

    Returns:
        The handler that stores records for the Console.
    """
    faults.install_hooks()
    qInstallMessageHandler(on_qt_message)
    root = logging.getLogger()
    if not root.handlers:
        root.addHandler(TerminalHandler(sys.stderr))
    console_handler = ConsoleHandler()
    root.addHandler(console_handler)
    root.addHandler(faults.LogFile(faults.log_folder()))
    return console_handler
