"""Rarely: the one rule for logging what happens again and again: the first, the tenth, the hundredth, ..."""

from __future__ import annotations

import logging
from contextlib import suppress
from types import TracebackType

__all__ = ["SurvivedErrors", "is_logged"]

_TOLD = frozenset(10**n for n in range(20))


def is_logged(count: int) -> bool:
    """Whether to log it, when it is the `count`th time."""
    return count in _TOLD


class SurvivedErrors:
    """Context manager around one item of work in a thread that must go on: no exception leaves it.

    Exceptions are counted and logged at increasing intervals; also SystemExit, which a callback may raise and
    which would end the thread.
    """

    def __init__(self, logger: logging.Logger, what: str) -> None:
        """`what` begins the log record: "`what` failed"."""
        self.count = 0
        self._logger, self._what = logger, what

    def add(self, error: BaseException) -> None:
        """Count an exception, and log it if it is its turn."""
        self.count += 1
        if is_logged(self.count):
            with suppress(Exception):  # also without memory or stack for a record
                self._logger.error("%s failed (%d so far)", self._what, self.count, exc_info=error)

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if error is not None:
            self.add(error)
        return True
