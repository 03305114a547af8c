"""The command `nep`."""

from __future__ import annotations

import sys

from nep.streams import buffer_output, close_streams, prepare_streams

__all__ = ["main"]

INTERRUPTED = 130
"""The exit code of a program that Ctrl+C ended."""


def main() -> None:
    """Run the command line and leave with its exit code. Ctrl+C ends it at once, from the first import on."""
    prepare_streams()
    buffer_output()
    try:
        from nep.cli.app import run  # noqa: PLC0415 - typer is heavy: Ctrl+C must work while it loads

        code = run()
    except KeyboardInterrupt:
        code = INTERRUPTED
    finally:
        close_streams()
    sys.exit(code)
