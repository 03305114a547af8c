"""Logging of repeated events at increasing intervals: the 1st, 10th, 100th and so on."""

from __future__ import annotations

import logging
from contextlib import suppress
from types import TracebackType

_LOGGED_COUNTS = frozenset(10**n for n in range(20))


def is_logged(count: int) -> bool:
    """Return True if the `count`-th occurrence of an event is to be logged."""
    return count in _LOGGED_COUNTS


class SuppressedErrors:
    """Context manager that suppresses, counts and logs exceptions, for threads that must keep running.

    Exceptions are logged at increasing intervals. All exceptions are suppressed, also SystemExit, which
    a callback may raise and which would end the thread.
    """

    def __init__(self, logger: logging.Logger, operation: str) -> None:
        """Initialize the context manager.

        Args:
            logger: Logger for the exceptions.
            operation: Name of the work, which begins the log message "OPERATION failed (N so far)".
        """
        self.count = 0
        self._logger, self._operation = logger, operation

    def add(self, error: BaseException) -> None:
        """Count an exception and log it at increasing intervals."""
        self.count += 1
        if is_logged(self.count):
            with suppress(Exception):  # logging may fail without memory or stack
                self._logger.error("%s failed (%d so far)", self._operation, self.count, exc_info=error)

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if error is not None:
            self.add(error)
        return True
