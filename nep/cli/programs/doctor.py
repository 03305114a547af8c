"""`nep doctor`: diagnose why programs can't connect, and show how to fix it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import console, show_json
from nep.i18n import _
from nep.system.lazy_import import lazy_module
from nep.text import escaped

if TYPE_CHECKING:
    from nep.programs import doctor as doctors
else:  # imported on use, to keep the other commands fast
    doctors = lazy_module("nep.programs.doctor")

SilentTopicArgument = Annotated[
    str, typer.Argument(help=_("Topic whose messages don't arrive."), metavar=_("TOPIC"), show_default=False)
]

_STYLES = {"error": "bold red", "warning": "bold yellow", "info": "dim", "ok": "green"}
_SYMBOLS = dict(zip(_STYLES, "✗!·✓", strict=True))
_ASCII_SYMBOLS = dict(zip(_STYLES, "x!-+", strict=True))
"""ASCII symbols for output whose encoding lacks the Unicode symbols (often on Windows)."""


def doctor(master: MasterOption = None, as_json: JsonOption = False, topic: SilentTopicArgument = "") -> None:
    """Check why programs can't find each other, and print how to fix it.

    With a topic, also check why its messages don't arrive: a misspelled name, a publisher that sends nothing,
    can't be reached, or sends messages that can't be decoded.

    Exit code: 0 if all checks passed, 1 with warnings, 2 with errors.
    """
    findings = doctors.diagnose(master, topic)
    if as_json:
        show_json(doctors.to_plain(findings))
    else:
        _show_findings(findings)
    raise typer.Exit(doctors.exit_code(findings))


def _show_findings(findings: tuple[doctors.Finding, ...]) -> None:
    from rich.text import Text  # noqa: PLC0415 - see `nep.cli.screen.console`

    out = console()
    is_unicode = (out.encoding or "").lower().startswith("utf")
    symbols, arrow = (_SYMBOLS, "→") if is_unicode else (_ASCII_SYMBOLS, "->")
    for finding in findings:
        out.print(
            Text.assemble(
                (f"{symbols[finding.severity]} ", _STYLES[finding.severity]), escaped(finding.sentence)
            )
        )
        if finding.fix:
            out.print(Text.assemble(f"  {arrow} ", escaped(finding.fix)))
        if finding.command:
            out.print(Text.assemble("    ", (escaped(finding.command), "cyan")))
