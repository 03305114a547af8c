"""Descriptors: whether this process may open more files. libzmq ends the whole program where it may not.

libzmq 4.3 aborts when it cannot have a descriptor for a signal, a poll or the list of this computer's
addresses. So room is looked for before a socket is made, with some to spare for what comes later by itself:
connections that are accepted, and whatever else the program opens.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import threading

from nep.errors import TooManyFilesError
from nep.system.forks import in_child

__all__ = ["SPARE", "allow_many", "check_room", "has_room", "is_lack", "limit", "opened"]

SPARE = 32
"""So many descriptors are left to the rest of the program and to connections that come."""
_WANTED = 8192
_FOLDER = "/proc/self/fd" if sys.platform == "linux" else "/dev/fd"
_LACKS = frozenset({errno.EMFILE, errno.ENFILE})


def is_lack(number: int | None) -> bool:
    """Whether an error of this number says that this process, or this computer, has too many files open."""
    return number in _LACKS


def opened() -> int | None:
    """How many descriptors this process has; None where the system does not tell."""
    try:
        return len(os.listdir(_FOLDER))  # noqa: PTH208 - half the time: it is done while sockets are made
    except OSError as error:
        return limit() if is_lack(error.errno) else None  # listing takes one, too


def limit() -> int | None:
    """How many descriptors this process may have; None: no limit."""
    if sys.platform == "win32":
        return None
    import resource  # noqa: PLC0415 - not on Windows

    soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return None if soft == resource.RLIM_INFINITY else soft


class _Room:
    """Looks at the highest numbers that a descriptor may have, which are given out last: that takes 5 µs.

    Only when some of them are taken it counts all, which takes 0.1 ms for each few hundred.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._most: int | None = None
        self._last: dict[int, select.poll] = {}

    def check(self, needed: int, what: str) -> None:
        most = limit()
        if most is not None and not self.has(needed + SPARE):
            raise TooManyFilesError(what, opened(), most)

    def has(self, needed: int) -> bool:
        most = limit()
        if most is None or self._free_at_the_end(most, needed) >= needed:
            return True
        count = opened()
        return count is None or most - count >= needed

    def _free_at_the_end(self, most: int, needed: int) -> int:
        with self._lock:
            if self._most != most:
                self._most = most
                self._last.clear()
            last = self._last.get(needed)
            if last is None:
                last = self._last[needed] = select.poll()
                for number in range(max(0, most - needed), most):
                    last.register(number, 0)
            return sum(event == select.POLLNVAL for _number, event in last.poll(0))


_room = _Room()


def check_room(needed: int, what: str) -> None:
    """Raises `TooManyFilesError` when `needed` more descriptors, for `what`, would not leave `SPARE`."""
    _room.check(needed, what)


def has_room(needed: int) -> bool:
    """Whether this process may open so many files more."""
    return _room.has(needed)


def _forked() -> None:
    """In a child: count anew, whoever held the lock."""
    global _room  # noqa: PLW0603 - there is one a process
    _room = _Room()


in_child(_forked)


def allow_many() -> None:
    """Let this process open as many files as the system allows, up to 8192. For programs, not for libraries.

    macOS starts programs with 256, which is a dozen topics of the original NEP.
    """
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 - not on Windows

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _WANTED if hard == resource.RLIM_INFINITY else min(_WANTED, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
