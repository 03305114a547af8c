"""Background worker: a thread that runs the newest job of each owner and discards older pending jobs."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from app.blocks.model.deep_json import start_deep

T = TypeVar("T")
JOIN_TIMEOUT_S = 2.0
"""Maximum time in seconds to wait for a job, for example if a disk doesn't respond."""


class BackgroundWorker(Generic[T]):
    """Worker with one thread. The first job starts the thread; `close` stops it.

    Only `finish` and `close` block.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._changed = threading.Condition()
        self._pending: dict[str, Callable[[], T]] = {}
        self._current_owner: str | None = None
        self._results: dict[str, T] = {}
        self._errors: dict[str, Exception] = {}
        self._thread: threading.Thread | None = None
        self._is_closed = False

    def submit(self, owner: str, job: Callable[[], T]) -> None:
        """Queue a job for an owner; a pending job of the same owner is discarded."""
        with self._changed:
            self._pending[owner] = job
            if self._thread is None and not self._is_closed:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                start_deep(self._thread)
            self._changed.notify_all()

    def pop_result(self, owner: str) -> T | None:
        """Return and clear the result of the owner's last job; None if there is no result.

        Raises the exception of a failed job.
        """
        with self._changed:
            error = self._errors.pop(owner, None)
            if error is not None:
                raise error
            return self._results.pop(owner, None)

    def finish(self, owner: str) -> bool:
        """Wait at most 2 s until the owner has no pending or running job; return False on timeout."""
        with self._changed:
            return self._changed.wait_for(
                lambda: self._is_closed or (owner not in self._pending and self._current_owner != owner),
                JOIN_TIMEOUT_S,
            )

    def discard(self, owner: str) -> None:
        """Discard the owner's pending job and result."""
        with self._changed:
            self._pending.pop(owner, None)
            self._results.pop(owner, None)
            self._errors.pop(owner, None)

    def close(self) -> None:
        """Stop the thread after the current job; waits at most 2 s."""
        with self._changed:
            self._is_closed = True
            self._pending.clear()
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(JOIN_TIMEOUT_S)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._current_owner = None
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._is_closed or bool(self._pending))
                if self._is_closed:
                    return
                owner = self._current_owner = next(iter(self._pending))
                job = self._pending.pop(owner)
            try:
                result = job()
            except Exception as error:  # noqa: BLE001  raised in the thread that takes the result
                with self._changed:
                    self._results.pop(owner, None)
                    self._errors[owner] = error
                continue
            with self._changed:
                self._errors.pop(owner, None)
                self._results[owner] = result
