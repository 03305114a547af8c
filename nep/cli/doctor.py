"""`nep doctor`: why programs do not find each other, and what to do."""

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
else:  # the other commands need not wait for it
    doctors = lazy_module("nep.programs.doctor")

MissedArgument = Annotated[
    str, typer.Argument(help=_("The topic that you miss."), metavar=_("TOPIC"), show_default=False)
]

_STYLES = {"error": "bold red", "warning": "bold yellow", "info": "dim", "ok": "green"}
_SIGNS = dict(zip(_STYLES, "✗!·✓", strict=True))
_PLAIN_SIGNS = dict(zip(_STYLES, "x!-+", strict=True))
"""For terminals and files that are not Unicode, as Windows has them."""


def doctor(master: MasterOption = None, as_json: JsonOption = False, topic: MissedArgument = "") -> None:
    """Look for what keeps programs from finding each other, and say what to do about it.

    With a topic also why nothing is seen of it: a name that is written otherwise, a publisher that is silent,
    that cannot be reached or sends what cannot be read.

    Ends with 0 when all is well, 1 with a warning, 2 when something is wrong.
    """
    found = doctors.look(master, topic)
    if as_json:
        show_json(doctors.to_plain(found))
    else:
        _show(found)
    raise typer.Exit(doctors.worst(found))


def _show(found: tuple[doctors.Finding, ...]) -> None:
    from rich.text import Text  # noqa: PLC0415 - see `nep.cli.screen.console`

    out = console()
    is_unicode = (out.encoding or "").lower().startswith("utf")
    signs, arrow = (_SIGNS, "→") if is_unicode else (_PLAIN_SIGNS, "->")
    for each in found:
        out.print(Text.assemble((f"{signs[each.severity]} ", _STYLES[each.severity]), escaped(each.sentence)))
        if each.mend:
            out.print(Text.assemble(f"  {arrow} ", escaped(each.mend)))
        if each.command:
            out.print(Text.assemble("    ", (escaped(each.command), "cyan")))
