"""The command `nep`."""

from __future__ import annotations

import sys

__all__ = ["main"]

INTERRUPTED = 130
"""The exit code of a program that Ctrl+C ended."""


def main() -> None:
    """Run the command line and leave with its exit code. Ctrl+C ends it at once, from the first import on."""
    try:
        from nep.cli.app import run  # noqa: PLC0415 - typer is heavy: Ctrl+C must work while it loads

        sys.exit(run())
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
