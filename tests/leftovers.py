"""What a test leaves behind in its process: threads, and open descriptors by kind and target."""

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
"""How Python calls threads that others have started: Qt's, libzmq's."""
LIBRARIES = ("zmq.", "execnet.", "xdist.", "pytest_timeout", "hypothesis.")
"""Modules whose threads live as long as the process."""
KEPT = re.compile(
    r"/usr/|/proc/|/dev/(null|u?random|tty|dri/)|/dev/shm/|/memfd:|"
    + "|".join(re.escape(prefix) for prefix in {sys.prefix, sys.base_prefix})
)
"""Files that libraries keep open: their own, the system's, and memory that processes share."""
FIRST_USES = {"anon_inode:": 8, "unnamed socket": 3, "pipe:": 2}
"""What libraries keep from a first use without a name (libzmq's context, Qt's file dialog, its network): so
many tests of a process may end with more of it than they began with, and not one more."""
POOLED = "Thread (pooled)"
"""How the system calls a thread of Qt's pools, which come with large pictures and go when they idle for long:
each has one descriptor, again and again, and no test can end it."""
_OF_POOLED = "anon_inode:[eventfd]"
PAGE = "QtWebEngineProcess"
_FD = "/proc/self/fd"
_CLOSED_SOON_S = 0.3
_TRIES = 20


def threads() -> set[threading.Thread]:
    """Every thread that Python has started, by whomever, and that has not ended."""
    return {
        each
        for each in threading.enumerate()
        if not each.name.startswith(FOREIGN) and not type(each).__module__.startswith(LIBRARIES)
    }


def descriptors() -> dict[int, str]:
    """What each open descriptor of this process is (``socket:[4711]``, ``/tmp/x``), by its number.

    Where the system does not tell (there is no /proc), only what listens is known.
    """
    if not sys.platform.startswith("linux"):
        listening = [each for each in _connections() if each.status == psutil.CONN_LISTEN]
        return {hash(each.laddr): f"listening {each.laddr}" for each in listening}
    found = {}
    for name in os.listdir(_FD):  # noqa: PTH208 - after every test: paths take three times as long
        try:
            found[int(name)] = os.readlink(f"{_FD}/{name}")  # noqa: PTH115 - see above
        except OSError:
            continue  # the descriptor of this very look, or one that was closed meanwhile
    return found


def _connections() -> list[Any]:
    """This process's; asked again where Windows' table grew between its length and its content."""
    for _ in range(_TRIES):
        try:
            return psutil.Process().net_connections(kind="inet")
        except RuntimeError:  # psutil has no other word for it
            continue
    return psutil.Process().net_connections(kind="inet")


def told(number: int, target: str) -> str:
    """One descriptor in words: a socket with its address, a file with its path; "" if it is closed by now."""
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
    """Whether nobody gave a socket its address: one of a pair, of the kernel, or named by the system."""
    chosen = isinstance(address, bytes) and re.fullmatch(rb"\0[0-9a-f]{5}", address)
    return family == "AF_NETLINK" or (family == "AF_UNIX" and (not address or bool(chosen)))


class Grace:
    """Time for threads to end and descriptors to close after a test: short once a test of the file leaked.

    A leak costs the whole grace, and one mistake often makes all tests of a file leak.
    """

    def __init__(self, first_s: float, later_s: float) -> None:
        self._first_s = first_s
        self._later_s = min(first_s, later_s)
        self._leaky: set[Path] = set()

    def seconds(self, file: Path) -> float:
        """Return the grace for the next test of a file."""
        return self._later_s if file in self._leaky else self._first_s

    def add_leak(self, file: Path) -> None:
        """Note that a test of the file leaked."""
        self._leaky.add(file)


class Allowances:
    """What may be there after a test that was not before it. One for each process of tests."""

    def __init__(self) -> None:
        self._left = Counter(FIRST_USES)

    def refused(self, before: dict[int, str], deadline: float) -> list[str]:
        """In words what was opened since ``before``, is not closed soon and may not be left behind.

        libzmq and Qt close in threads of their own, which a busy computer lets wait: until ``deadline``
        (monotonic seconds) for what has a name.
        """
        if not _opened(before):
            return []
        unnamed = _unnamed(before)
        if unnamed and _has_page():
            unnamed = set()
        elif unnamed or _named(before):
            gc.collect()  # what only a cycle holds is closed now
        _wait(lambda: not _named(before), deadline)
        if unnamed:
            _wait(lambda: not _unnamed(before), min(deadline, time.monotonic() + _CLOSED_SOON_S))
            # What may not stay has all the time that there is: a busy computer closes late.
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
    """In words what was opened since, but for what libraries keep by its name."""
    opened = [
        told(number, target) for number, target in descriptors().items() if before.get(number) != target
    ]
    left = sorted(each for each in opened if each and not KEPT.match(each))
    if _OF_POOLED in left:
        for _thread in range(_pooled_threads()):
            if _OF_POOLED in left:
                left.remove(_OF_POOLED)
    return left


def _pooled_threads() -> int:
    """How many threads of Qt's pools there are; 0 where the system does not tell."""
    found = 0
    for name in Path("/proc/self/task").glob("*/comm"):
        with suppress(OSError):  # it has just ended
            found += name.read_text().strip() == POOLED
    return found


def _named(before: dict[int, str]) -> list[str]:
    return [each for each in _opened(before) if not each.startswith(tuple(FIRST_USES))]


def _unnamed(before: dict[int, str]) -> set[str]:
    """The kinds of what has no name."""
    return {kind for kind in FIRST_USES for each in _opened(before) if each.startswith(kind)}


def _has_page() -> bool:
    """Whether a web page lives on between tests: Chromium opens and closes what it likes."""
    try:
        return any(PAGE in each.name() for each in psutil.Process().children(recursive=True))
    except psutil.Error:
        return False
