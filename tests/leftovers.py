"""Detection of resources that a test leaks: threads, and open descriptors by kind and target."""

from __future__ import annotations

import gc
import os
import re
import socket
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

FOREIGN = "Dummy-"
"""Name prefix that Python gives to threads started by other libraries, such as Qt and libzmq."""
LIBRARIES = ("zmq.", "execnet.", "xdist.", "pytest_timeout", "hypothesis.")
"""Prefixes of modules whose threads live as long as the process."""
KEPT = re.compile(
    r"/usr/|/proc/|/dev/(null|u?random|tty|dri/)|/dev/shm/|/memfd:|"
    + "|".join(re.escape(prefix) for prefix in {sys.prefix, sys.base_prefix})
)
"""Paths that libraries keep open: files of Python and of the system, and shared memory."""
FIRST_USES = {"anon_inode:": 8, "unnamed socket": 3, "pipe:": 2}
"""Maximum number of unnamed descriptors per kind that libraries keep open after their first use.

Examples are libzmq's context, and Qt's file dialog and network. The limit is for the whole process.
"""
POOL_THREAD = "Thread (pooled)"
"""System name of the threads in Qt's thread pools.

They are started for large images and exit after an idle time. Each has one descriptor, which tests can't
close.
"""
_POOL_DESCRIPTOR = "anon_inode:[eventfd]"
PAGE = "QtWebEngineProcess"
_FD = "/proc/self/fd"
_CLOSED_SOON_S = 0.3
_TRIES = 20


def threads() -> set[threading.Thread]:
    """Return the running threads that were started by Python, without those of test libraries."""
    return {
        each
        for each in threading.enumerate()
        if not each.name.startswith(FOREIGN) and not type(each).__module__.startswith(LIBRARIES)
    }


def descriptors() -> dict[int, str]:
    """Return the target of each open descriptor (``socket:[4711]``, ``/tmp/x``) by its number.

    Systems without /proc report only listening sockets.
    """
    if not sys.platform.startswith("linux"):
        listening = [each for each in _connections() if each.status == psutil.CONN_LISTEN]
        return {hash(each.laddr): f"listening {each.laddr}" for each in listening}
    found = {}
    for name in os.listdir(_FD):  # noqa: PTH208 - runs after every test; pathlib takes three times as long
        try:
            found[int(name)] = os.readlink(f"{_FD}/{name}")  # noqa: PTH115 - see above
        except OSError:
            continue  # the descriptor of `listdir` itself, or one closed meanwhile
    return found


def _connections() -> list[Any]:
    """Return this process's connections.

    Retries, because psutil raises when Windows' table grows during the query.
    """
    for _ in range(_TRIES):
        try:
            return psutil.Process().net_connections(kind="inet")
        except RuntimeError:  # the only exception that psutil raises for this
            continue
    return psutil.Process().net_connections(kind="inet")


def describe(number: int, target: str) -> str:
    """Return a description of a descriptor (socket address or file path), or "" when it is closed."""
    if not target.startswith("socket:"):
        return target
    try:
        with socket.socket(fileno=os.dup(number)) as copy:
            address = copy.getsockname()
            if _is_unnamed(copy.family.name, address):
                return "unnamed socket"
            listens = "listening " if copy.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN) else ""
            return f"{listens}socket {address!r}"
    except OSError:
        return target if descriptors().get(number) == target else ""


def _is_unnamed(family: str, address: object) -> bool:
    """Return whether a socket has no explicit address: one of a pair, of the kernel, or autobound."""
    chosen = isinstance(address, bytes) and re.fullmatch(rb"\0[0-9a-f]{5}", address)
    return family == "AF_NETLINK" or (family == "AF_UNIX" and (not address or bool(chosen)))


class Grace:
    """Time for threads to end and descriptors to close after a test.

    It is shorter after a leak in the same file: a leak takes the whole time, and one mistake often
    makes all tests of a file leak.
    """

    def __init__(self, first_s: float, later_s: float) -> None:
        self._first_s = first_s
        self._later_s = min(first_s, later_s)
        self._leaky: set[Path] = set()

    def seconds(self, file: Path) -> float:
        """Return the time in seconds for the next test of a file."""
        return self._later_s if file in self._leaky else self._first_s

    def add_leak(self, file: Path) -> None:
        """Record that a test of the file leaked."""
        self._leaky.add(file)


class Allowances:
    """Descriptors that may stay open after a test. One object for each test process."""

    def __init__(self) -> None:
        self._left = Counter(FIRST_USES)

    def leaked(self, before: dict[int, str], deadline: float) -> list[str]:
        """Return descriptions of the descriptors that were opened since ``before`` and must not stay open.

        libzmq and Qt close descriptors in their own threads, which is slow on a busy computer: wait
        until ``deadline`` (monotonic seconds) for descriptors with a name.
        """
        if not _opened(before):
            return []
        unnamed = _unnamed(before)
        if unnamed and _has_page():
            unnamed = set()
        elif unnamed or _named(before):
            gc.collect()  # closes descriptors held only by reference cycles
        _wait(lambda: not _named(before), deadline)
        if unnamed:
            _wait(lambda: not _unnamed(before), min(deadline, time.monotonic() + _CLOSED_SOON_S))
            # Kinds without remaining allowance get the full deadline: a busy computer closes late.
            _wait(lambda: all(self._left[kind] > 0 for kind in _unnamed(before)), deadline)
            for kind in (unnamed := _unnamed(before)):
                self._left[kind] -= 1
        spent = {kind for kind in unnamed if self._left[kind] < 0}
        return _named(before) + [each for each in _opened(before) if each.startswith(tuple(spent))]


def _wait(done: Callable[[], bool], deadline: float) -> None:
    pause = threading.Event()
    while not done() and time.monotonic() < deadline:
        pause.wait(0.02)


def _opened(before: dict[int, str]) -> list[str]:
    """Return descriptions of the descriptors opened since, without those that libraries keep open."""
    opened = [
        describe(number, target) for number, target in descriptors().items() if before.get(number) != target
    ]
    left = sorted(each for each in opened if each and not KEPT.match(each))
    if _POOL_DESCRIPTOR in left:
        for _thread in range(_pooled_threads()):
            if _POOL_DESCRIPTOR in left:
                left.remove(_POOL_DESCRIPTOR)
    return left


def _pooled_threads() -> int:
    """Return the number of threads in Qt's pools; 0 on systems without /proc."""
    found = 0
    for name in Path("/proc/self/task").glob("*/comm"):
        with suppress(OSError):  # the thread has just ended
            found += name.read_text().strip() == POOL_THREAD
    return found


def _named(before: dict[int, str]) -> list[str]:
    return [each for each in _opened(before) if not each.startswith(tuple(FIRST_USES))]


def _unnamed(before: dict[int, str]) -> set[str]:
    """Return the kinds of open descriptors without a name."""
    return {kind for kind in FIRST_USES for each in _opened(before) if each.startswith(kind)}


def _has_page() -> bool:
    """Return whether a web page is open; Chromium opens and closes descriptors at any time."""
    try:
        return any(PAGE in each.name() for each in psutil.Process().children(recursive=True))
    except psutil.Error:
        return False
