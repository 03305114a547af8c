"""The command `nep`.

`app` puts the commands together; each is one module, such as `echo` for `nep topic echo`.
"""

from __future__ import annotations

import sys

__all__ = ["main"]

INTERRUPTED = 130
"""The exit code of a program that Ctrl+C ended."""


def main() -> None:
    """Run the command line and leave with its exit code. Ctrl+C ends it quietly at any moment."""
    try:
        from nep.cli import interrupts  # noqa: PLC0415 - a traceback could be seen only before this line

        interrupts.end_at_once()
        code = _run()
    except KeyboardInterrupt:
        code = INTERRUPTED
    sys.exit(code)


def _run() -> int:
    from nep.cli import interrupts  # noqa: PLC0415 - see `main`
    from nep.i18n import begin  # noqa: PLC0415
    from nep.system.streams import buffer_output, close_streams, prepare_streams  # noqa: PLC0415

    prepare_streams()
    buffer_output()
    begin()  # before the modules whose help texts are made when they are imported
    try:
        from nep.cli.app import run  # noqa: PLC0415 - typer and ZeroMQ are heavy

        interrupts.ask_first()
        interrupts.leave_when_told(interrupts.TERMINATED)
        return run()
    finally:
        interrupts.end_at_once()
        close_streams()
