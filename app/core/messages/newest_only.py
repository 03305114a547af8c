"""Background thread that processes the newest job and discards older pending ones."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")


class NewestJobWorker(Generic[Job, Result]):
    """Background thread that processes one job at a time. A newer job replaces a pending one. Thread-safe.

    The first job starts the thread.
    """

    def __init__(self, process_job: Callable[[Job], Result], name: str) -> None:
        # `process_job` is called in the thread and must not raise.
        self._process_job, self._name = process_job, name
        self._wake = threading.Condition()
        self._pending_jobs: list[Job] = []  # at most one
        self._running_jobs: list[Job] = []
        self._results: list[Result] = []
        self._is_closing = False
        self._thread: threading.Thread | None = None

    @property
    def is_busy(self) -> bool:
        """True if a job is running or pending."""
        with self._wake:
            return bool(self._pending_jobs or self._running_jobs)

    def submit(self, job: Job) -> None:
        """Set the next job, replacing a pending one."""
        with self._wake:
            self._pending_jobs = [job]
            if self._thread is None and not self._is_closing:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()
            self._wake.notify()

    def pop_result(self) -> Result | None:
        """Return and clear the last result; None if there is none."""
        with self._wake:
            results, self._results = self._results, []
        return results[0] if results else None

    def clear(self) -> None:
        """Discard the pending job, the finished result, and the result of a running job."""
        with self._wake:
            self._pending_jobs, self._running_jobs, self._results = [], [], []

    def close(self) -> None:
        """Stop the thread; waits at most one second for a running job."""
        with self._wake:
            self._is_closing = True
            self._pending_jobs, self._running_jobs, self._results = [], [], []
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(1.0)

    def _run(self) -> None:
        while True:
            with self._wake:
                while not self._pending_jobs and not self._is_closing:
                    self._wake.wait()
                if self._is_closing:
                    return
                taken = self._running_jobs = self._pending_jobs
                self._pending_jobs = []
            result = self._process_job(taken[0])
            with self._wake:
                if self._running_jobs is taken:  # otherwise it was discarded
                    self._results, self._running_jobs = [result], []
