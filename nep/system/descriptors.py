"""Check for free file descriptors before sockets are opened, because libzmq aborts the process without them.

libzmq 4.3 aborts when it can't get a descriptor for a signaler, a poller or the list of addresses. The check
leaves a reserve for descriptors that are opened later: accepted connections, and files of the program.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import threading

from nep.errors import TooManyFilesError
from nep.system.forks import call_in_child

RESERVED_DESCRIPTORS = 32
"""Number of descriptors reserved for accepted connections and files of the program."""
_TARGET_LIMIT = 8192
_DESCRIPTOR_FOLDER = "/proc/self/fd" if sys.platform == "linux" else "/dev/fd"
_NO_DESCRIPTOR_ERRNOS = frozenset({errno.EMFILE, errno.ENFILE})


def is_descriptor_shortage(number: int | None) -> bool:
    """Return True if an errno means that the process or the system has too many open files."""
    return number in _NO_DESCRIPTOR_ERRNOS


def open_descriptor_count() -> int | None:
    """Return the number of open descriptors of this process, or None if unknown."""
    try:
        return len(os.listdir(_DESCRIPTOR_FOLDER))  # noqa: PTH208 - half the time of pathlib; called for each socket
    except OSError as error:
        return (
            descriptor_limit() if is_descriptor_shortage(error.errno) else None
        )  # listing the folder needs a descriptor, too


def descriptor_limit() -> int | None:
    """Return the soft limit of open descriptors, or None if there is none."""
    if sys.platform == "win32":
        return None
    import resource  # noqa: PLC0415 - not on Windows

    soft = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return None if soft == resource.RLIM_INFINITY else soft


class _DescriptorCheck:
    """Fast check for free descriptors (5 µs), based on the highest descriptor numbers.

    The system assigns the lowest free number first. Only if some of the highest numbers are in use, all open
    descriptors are counted, which takes 0.1 ms per few hundred.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._polled_limit: int | None = None
        self._pollers: dict[int, select.poll] = {}

    def check(self, needed: int, purpose: str) -> None:
        limit = descriptor_limit()
        if limit is not None and not self.has_free(needed + RESERVED_DESCRIPTORS):
            raise TooManyFilesError(purpose, open_descriptor_count(), limit)

    def has_free(self, needed: int) -> bool:
        limit = descriptor_limit()
        if limit is None or self._count_free_at_end(limit, needed) >= needed:
            return True
        count = open_descriptor_count()
        return count is None or limit - count >= needed

    def _count_free_at_end(self, limit: int, needed: int) -> int:
        with self._lock:
            if self._polled_limit != limit:
                self._polled_limit = limit
                self._pollers.clear()
            poller = self._pollers.get(needed)
            if poller is None:
                poller = self._pollers[needed] = select.poll()
                for number in range(max(0, limit - needed), limit):
                    poller.register(number, 0)
            return sum(event == select.POLLNVAL for _number, event in poller.poll(0))


_descriptor_check = _DescriptorCheck()


def check_free_descriptors(needed: int, purpose: str) -> None:
    """Raise `TooManyFilesError` if fewer than `RESERVED_DESCRIPTORS` would be left.

    Args:
        needed: Number of descriptors to be opened.
        purpose: Purpose of the descriptors, for the error message.
    """
    _descriptor_check.check(needed, purpose)


def has_free_descriptors(needed: int) -> bool:
    """Return True if this process may open `needed` more descriptors."""
    return _descriptor_check.has_free(needed)


def _reset_after_fork() -> None:
    # In a forked child the lock may be held for ever.
    global _descriptor_check  # noqa: PLW0603 - one per process
    _descriptor_check = _DescriptorCheck()


call_in_child(_reset_after_fork)


def raise_open_file_limit() -> None:
    """Raise the soft limit of open files up to 8192. Call this in programs, not in libraries.

    The default on macOS, 256, is enough for only a dozen topics of the original NEP.
    """
    if sys.platform == "win32":
        return
    import resource  # noqa: PLC0415 - not on Windows

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    target = _TARGET_LIMIT if hard == resource.RLIM_INFINITY else min(_TARGET_LIMIT, hard)
    if soft != resource.RLIM_INFINITY and soft < target:
        resource.setrlimit(resource.RLIMIT_NOFILE, (target, hard))
