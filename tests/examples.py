"""Number of examples of property tests: a fifth of them in every run, all of them with ``--long``."""

from __future__ import annotations

DEFAULT_EXAMPLES = 100
"""Number of examples of a property test that doesn't set it."""
_QUICK_SHARE = 5
_MIN_EXAMPLES = 10

is_long = False
"""True with ``--long``; tests/conftest.py sets it before it imports tests."""


def examples(count: int) -> int:
    """Return the number of examples for this run.

    Args:
        count: Number of examples with ``--long``.
    """
    return count if is_long else min(count, max(_MIN_EXAMPLES, count // _QUICK_SHARE))
