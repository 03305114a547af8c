"""Command-line program `nep`.

`app` assembles the commands. Each module contains one command, such as `echo` (`nep topic echo`), or a
command group, such as `parameters` (`nep param`).
"""

from __future__ import annotations

import sys

__all__ = ["main"]

INTERRUPTED_EXIT_CODE = 130
"""Exit code of a program stopped by Ctrl+C."""


def main() -> None:
    """Run the command line and exit with its exit code. Ctrl+C never prints a traceback."""
    try:
        from nep.cli import interrupts  # noqa: PLC0415 - imported here so that Ctrl+C during the import is handled

        interrupts.exit_on_interrupt()
        code = _run()
    except KeyboardInterrupt:
        code = INTERRUPTED_EXIT_CODE
    sys.exit(code)


def _run() -> int:
    from nep.cli import interrupts  # noqa: PLC0415 - see `main`
    from nep.i18n import set_initial_language  # noqa: PLC0415
    from nep.system.streams import buffer_output, flush_streams, prepare_streams  # noqa: PLC0415

    prepare_streams()
    buffer_output()
    set_initial_language()  # before importing modules that translate their help texts at import
    try:
        from nep.cli.app import run  # noqa: PLC0415 - typer and ZeroMQ are slow to import

        interrupts.raise_on_interrupt()
        interrupts.exit_on_termination(interrupts.TERMINATED_EXIT_CODE)
        return run()
    finally:
        interrupts.exit_on_interrupt()
        flush_streams()
