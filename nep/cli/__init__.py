"""Command-line program `nep`.

`app` assembles the commands; each command is one module, such as `echo` for `nep topic echo`.
"""

from __future__ import annotations

import sys

__all__ = ["main"]

INTERRUPTED = 130
"""Exit code of a program stopped by Ctrl+C."""


def main() -> None:
    """Run the command line and exit with its exit code. Ctrl+C never prints a traceback."""
    try:
        from nep.cli import interrupts  # noqa: PLC0415 - imported here so that Ctrl+C during the import is handled

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
    begin()  # before importing modules that translate their help texts at import
    try:
        from nep.cli.app import run  # noqa: PLC0415 - typer and ZeroMQ are slow to import

        interrupts.ask_first()
        interrupts.leave_when_told(interrupts.TERMINATED)
        return run()
    finally:
        interrupts.end_at_once()
        close_streams()
