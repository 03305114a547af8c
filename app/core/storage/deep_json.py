"""JSON as deep as a long stack of blocks: Blockly nests every block in the one above it.

Python's json gives up at about 1000 levels, which is a stack of 480 blocks. What is deeper is read and
written in a thread of its own with a larger stack, up to `LEVELS` (less in early releases of Python 3.12);
beyond that it is a RecursionError as ever.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

LEVELS = 9_000
SHALLOW = 8_000
"""So many brackets can't be nested too deep."""
STACK_BYTES = 255 * 1024 * 1024
"""Python for Windows refuses 256 MiB: less, it says, are valid."""

T = TypeVar("T")
_one_at_a_time = threading.Lock()


def loads(text: str | bytes) -> object:
    """Return the value of a JSON text; bytes may be UTF-8, UTF-16 or UTF-32, with or without a mark.

    ValueError for what is no JSON, RecursionError beyond 9000 levels.
    """
    return deeply(lambda: json.loads(text))


def dumps(value: object, indent: int | None = None, *, ascii: bool = False) -> str:
    """The JSON text of a value; with ``ascii`` all else is escaped. RecursionError beyond 9000 levels.

    A deep value is not indented: its text would be mostly spaces.
    """
    try:
        return json.dumps(value, indent=indent, ensure_ascii=ascii)
    except RecursionError:
        return deeply(lambda: json.dumps(value, ensure_ascii=ascii))


def same(one: object, other: object) -> bool:
    """Whether two values are equal, however deep."""
    return deeply(lambda: one == other)


def start_deep(thread: threading.Thread) -> None:
    """Start a thread that may go as deep as a long stack of blocks."""
    with _one_at_a_time:
        size = threading.stack_size(STACK_BYTES)
        try:
            thread.start()
        finally:
            threading.stack_size(size)


def deeply(work: Callable[[], T]) -> T:
    """What `work` gives, which may go as deep as a long stack of blocks; it is tried twice, so it is pure."""
    try:
        return work()
    except RecursionError:
        pass
    made: list[T] = []
    failed: list[Exception] = []

    def run() -> None:
        try:
            made.append(work())
        except (ValueError, RecursionError) as error:
            failed.append(error)

    # the limit is the whole process's, and the stack's size is that of the next thread: one at a time
    with _one_at_a_time:
        limit, size = sys.getrecursionlimit(), threading.stack_size(STACK_BYTES)
        sys.setrecursionlimit(max(limit, LEVELS))
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
    return made[0]
