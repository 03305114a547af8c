"""JSON with deep nesting, such as a long stack of blocks, which Blockly nests in each other.

Python's json module supports about 1000 levels, which is a stack of 480 blocks. Values with more levels
are processed in a thread with a larger stack, up to `MAX_LEVELS` (less in early releases of Python 3.12).
Beyond that, RecursionError is raised as usual.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

MAX_LEVELS = 9_000
MAX_SHALLOW_LEVELS = 8_000
"""Number of brackets in a text up to which its nesting can't be too deep."""
STACK_BYTES = 255 * 1024 * 1024
"""Stack size of the thread in bytes. Python for Windows rejects 256 MiB."""

T = TypeVar("T")
_thread_lock = threading.Lock()


def loads(text: str | bytes) -> object:
    """Parse JSON. Bytes may be UTF-8, UTF-16 or UTF-32, with or without a BOM.

    Raises:
        ValueError: The text is not valid JSON.
        RecursionError: The nesting exceeds 9000 levels.
    """
    return run_deep(lambda: json.loads(text))


def dumps(value: object, indent: int | None = None, *, ascii: bool = False) -> str:
    """Format a value as JSON. Raises RecursionError beyond 9000 levels of nesting.

    Args:
        value: Value to format.
        indent: Number of spaces per level. A value with deep nesting is not indented, because its text
            would consist mostly of spaces.
        ascii: True to escape all characters that are not ASCII.
    """
    try:
        return json.dumps(value, indent=indent, ensure_ascii=ascii)
    except RecursionError:
        return run_deep(lambda: json.dumps(value, ensure_ascii=ascii))


def are_equal(value: object, other: object) -> bool:
    """Return True if two values are equal. Supports deep nesting."""
    return run_deep(lambda: value == other)


def start_deep(thread: threading.Thread) -> None:
    """Start a thread with a stack that is large enough for values with deep nesting."""
    with _thread_lock:
        size = threading.stack_size(STACK_BYTES)
        try:
            thread.start()
        finally:
            threading.stack_size(size)


def run_deep(function: Callable[[], T]) -> T:
    """Call ``function`` and return its result.

    After a RecursionError, call it again in a thread with a larger stack. ``function`` must not have side
    effects, because it may be called twice.
    """
    try:
        return function()
    except RecursionError:
        pass
    results: list[T] = []
    errors: list[Exception] = []

    def run() -> None:
        try:
            results.append(function())
        except (ValueError, RecursionError) as error:
            errors.append(error)

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
    if errors:
        raise errors[0]
    return results[0]
