"""JSON with deep nesting, as for a long stack of blocks, where Blockly nests each block in the previous one.

Python's json supports about 1000 levels, which is a stack of 480 blocks. Values with deeper nesting are
processed in a thread with a larger stack, up to `LEVELS` (less in early releases of Python 3.12). Beyond
that, RecursionError is raised as usual.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

MAX_LEVELS = 9_000
MAX_SHALLOW_LEVELS = 8_000
"""Number of brackets up to which a text can't be nested too deeply."""
STACK_BYTES = 255 * 1024 * 1024
"""Size of the stack in bytes; Python for Windows rejects 256 MiB."""

T = TypeVar("T")
_thread_lock = threading.Lock()


def loads(text: str | bytes) -> object:
    """Parse JSON; bytes may be UTF-8, UTF-16 or UTF-32, with or without a BOM.

    Raises ValueError for invalid JSON, RecursionError beyond 9000 levels.
    """
    return run_deep(lambda: json.loads(text))


def dumps(value: object, indent: int | None = None, *, ascii: bool = False) -> str:
    """Format a value as JSON, with escaped characters if ``ascii``. Raises RecursionError beyond 9000 levels.

    A value with deep nesting is not indented, because its text would consist mostly of spaces.
    """
    try:
        return json.dumps(value, indent=indent, ensure_ascii=ascii)
    except RecursionError:
        return run_deep(lambda: json.dumps(value, ensure_ascii=ascii))


def are_equal(one: object, other: object) -> bool:
    """Return True if two values are equal, independent of their depth."""
    return run_deep(lambda: one == other)


def start_deep(thread: threading.Thread) -> None:
    """Start a thread whose stack is large enough for values with deep nesting."""
    with _thread_lock:
        size = threading.stack_size(STACK_BYTES)
        try:
            thread.start()
        finally:
            threading.stack_size(size)


def run_deep(work: Callable[[], T]) -> T:
    """Return the result of ``work``, called in a thread with a larger stack if necessary.

    ``work`` may be called twice, so it must not have side effects.
    """
    try:
        return work()
    except RecursionError:
        pass
    results: list[T] = []
    failed: list[Exception] = []

    def run() -> None:
        try:
            results.append(work())
        except (ValueError, RecursionError) as error:
            failed.append(error)

    # the recursion limit is global, and the stack size applies to the next thread: one at a time
    with _thread_lock:
        limit, size = sys.getrecursionlimit(), threading.stack_size(STACK_BYTES)
        sys.setrecursionlimit(max(limit, MAX_LEVELS))
        try:
            thread = threading.Thread(target=run, name="deep json")
            thread.start()
            threading.stack_size(size)
            thread.join()
        finally:
            threading.stack_size(size)
            sys.setrecursionlimit(limit)
    if failed:
        raise failed[0]
    return results[0]
