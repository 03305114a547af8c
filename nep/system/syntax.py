"""Thread-safe parsing of Python source.

CPython 3.11 keeps the recursion depth of its AST constructor per process: two threads that parse at the same
time can end in a SystemError ("AST constructor recursion depth mismatch", see python/cpython#106905).
"""

from __future__ import annotations

import ast
import os
import threading

_lock = threading.Lock()
if hasattr(os, "register_at_fork"):
    # Another thread may be parsing when the process forks.
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release)


def parse_module(source: str) -> ast.Module:
    """Parse a module and return its syntax tree. Thread-safe; raises the exceptions of `ast.parse`."""
    with _lock:
        return ast.parse(source)


def parse_expression(source: str) -> ast.Expression:
    """Parse one expression and return its syntax tree. Thread-safe; raises the exceptions of `ast.parse`."""
    with _lock:
        return ast.parse(source, mode="eval")
