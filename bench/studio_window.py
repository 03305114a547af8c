"""Helpers of the window's benchmarks: the real window in this process, publishers in others, and meters."""

from __future__ import annotations

import gc
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import psutil
from PySide6.QtCore import QCoreApplication, QEventLoop, Qt, QTimer

from app.core.session import Session
from app.core.storage.settings import Settings
from app.ui.application import Options, make_application, make_window
from app.ui.shell.commands.commands import Commands
from app.ui.shell.main_window import MainWindow
from app.ui.startup import qt_log
from nep.masters.master import start_process

__all__ = [
    "BARE",
    "Child",
    "Meter",
    "Row",
    "Studio",
    "child",
    "network",
    "percentile",
    "run_for",
    "studio",
    "until",
    "verdict",
]

ROOT = Path(__file__).resolve().parents[1]
LOOK_MS = 20
TIMER_MS = 10
TRUSTED_MS = 5.0


@dataclass
class Studio:
    """The measured window, its commands and its session."""

    window: MainWindow
    commands: Commands
    session: Session


@contextmanager
def network() -> Iterator[str]:
    """Start a master in its own process, as Studio does, and the QApplication; yield the master's address."""
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        os.environ["QTWEBENGINE_DISABLE_SANDBOX"] = "1"  # Chromium's sandbox doesn't work as root
    os.environ["NEP_GATEWAY"] = "0"  # the gateway's ports can be open only once per computer
    qt_log.install_handlers()
    make_application()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{probe.getsockname()[1]}"
    master = start_process(address, os.getpid())
    try:
        yield address
    finally:
        application = QCoreApplication.instance()
        assert application is not None
        QTimer.singleShot(0, application.quit)
        application.exec()  # emits aboutToQuit, so that web engine pages close
        master.kill()
        master.wait()


@contextmanager
def studio(address: str, layout: str = "developer") -> Iterator[Studio]:
    """Open the real window at its real size with its own home folder; it joins the master at `address`."""
    with tempfile.TemporaryDirectory(prefix="nep-bench-") as home:
        os.environ["NEP_STUDIO_HOME"] = home
        session = Session(
            Settings(Path(home)), address=address, journal_folder=Path(home), start_processes=False
        )
        window = make_window(session, Options(theme="light", opens_new_window=True))
        window.show()
        window.start_session()
        window.commands.run(f"layout.{layout}")
        try:
            yield Studio(window, window.commands, session)
        finally:
            window.close()
            run_for(0.05)


def run_for(seconds: float) -> None:
    """Run the event loop for `seconds`."""
    loop, timer = QEventLoop(), QTimer()
    timer.setTimerType(Qt.TimerType.PreciseTimer)
    timer.setSingleShot(True)
    timer.timeout.connect(loop.quit)
    timer.start(round(seconds * 1000))
    loop.exec()


def until(true: Callable[[], object], what: str, within_s: float = 20.0) -> None:
    """Run the event loop until the condition is true; exit with `what` on timeout."""
    end = time.monotonic() + within_s
    while not true():
        if time.monotonic() > end:
            raise SystemExit(f"not within {within_s:g} s: {what}")
        run_for(LOOK_MS / 1000)


class Child:
    """Child process that replies to each line with a line; the event loop runs while waiting for a reply."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process
        self._buffer = b""
        assert process.stdout is not None
        os.set_blocking(process.stdout.fileno(), False)

    def tell(self, line: str) -> None:
        """Send a line; its reply can be read later."""
        assert self.process.stdin is not None
        self.process.stdin.write(line.encode() + b"\n")
        self.process.stdin.flush()

    def answer(self, within_s: float = 60.0) -> str:
        """Run the event loop until the next line arrives, and return it."""
        until(self._has_line, "another process answers", within_s)
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line.decode()

    def _has_line(self) -> bool:
        assert self.process.stdout is not None
        part = self.process.stdout.read()
        if part == b"":
            raise SystemExit("another process of the benchmark has ended")
        self._buffer += part or b""
        return b"\n" in self._buffer


@contextmanager
def child(program: str, arguments: Sequence[str], master: str) -> Iterator[Child]:
    """Start a Python process that runs `program`; kill it at the end of the block."""
    environment = {**os.environ, "NEP_MASTER": master, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=environment,
    )
    try:
        yield Child(process)
    finally:
        process.kill()
        process.communicate()


def percentile(values: Sequence[float], percent: float) -> float:
    """Return the value below which `percent` of the values lie; 0.0 without values."""
    if not values:
        return 0.0
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(len(ordered) * percent / 100))]


@dataclass
class Row:
    """Results of one measurement: shares of one core, times in ms, memory in MB."""

    seconds: float
    gui: float
    ticks: float
    panels: float
    process: float
    late_p50: float
    late_p99: float
    late_max: float
    memory: float


@dataclass
class Meter:
    """Meter of the running window: processor time of the GUI thread, and the delay of a timer.

    `ticks` is the session's part of the tick, `panels` the panels' `refresh`. Both are part of `gui`,
    which also includes painting.
    """

    studio: Studio
    late: list[float] = field(default_factory=list)
    _parts: dict[str, float] = field(default_factory=lambda: {"tick": 0.0, "refresh": 0.0})

    def __post_init__(self) -> None:
        session, window = self.studio.session, self.studio.window
        session.tick = self._timed("tick", session.tick)  # type: ignore[method-assign]
        bench = window.bench
        if bench is not None:
            bench.refresh = self._timed("refresh", bench.refresh)  # type: ignore[method-assign]

    def _timed(self, part: str, does: Callable[..., None]) -> Callable[..., None]:
        def timed(**given: bool) -> None:
            began = time.thread_time()
            does(**given)
            self._parts[part] += time.thread_time() - began

        return timed

    def measure(self, seconds: float) -> Row:
        """Run the event loop for `seconds` and return what was measured."""
        gc.collect()
        self.late.clear()
        self._parts = dict.fromkeys(self._parts, 0.0)
        process = psutil.Process()
        timer = QTimer()
        timer.setTimerType(Qt.TimerType.PreciseTimer)
        timer.setInterval(TIMER_MS)
        expected = [time.perf_counter() + TIMER_MS / 1000]

        def came() -> None:
            now = time.perf_counter()
            self.late.append(max(0.0, (now - expected[0]) * 1000))
            expected[0] = now + TIMER_MS / 1000

        timer.timeout.connect(came)
        began, gui, used = time.perf_counter(), time.thread_time(), time.process_time()
        timer.start()
        run_for(seconds)
        timer.stop()
        took = time.perf_counter() - began
        return Row(
            took,
            (time.thread_time() - gui) / took,
            self._parts["tick"] / took,
            self._parts["refresh"] / took,
            (time.process_time() - used) / took,
            statistics.median(self.late) if self.late else 0.0,
            percentile(self.late, 99),
            max(self.late, default=0.0),
            process.memory_info().rss / 1e6,
        )


BARE = """
import sys, threading, time
pause = threading.Event()
print("ready", flush=True)
for line in sys.stdin:
    late, end = [], time.perf_counter() + float(line)
    while (began := time.perf_counter()) < end:
        pause.wait(0.01)
        late.append(max(0.0, (time.perf_counter() - began - 0.01) * 1000))
    late.sort()
    print(late[int(len(late) * 0.99)] if late else 0.0, flush=True)
"""
"""Program that repeatedly waits 10 ms and prints its delay (p99, in ms): the load of the computer itself."""


def verdict(reached: bool, bare_ms: float) -> int:
    """Print whether the run counts and every goal was reached; return the exit code, 0 only for both."""
    counts = bare_ms <= TRUSTED_MS
    print(
        f"a program that only waits was late by {bare_ms:.1f} ms (p99): "
        + ("this run counts" if counts else f"this run does NOT count (at most {TRUSTED_MS:g} ms would)")
    )
    print("every goal was reached" if reached else "NOT every goal was reached")
    return 0 if reached and counts else 1
