"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer

from nep.system.addresses import DEFAULT_MASTER

MasterOption = Annotated[
    str | None,
    typer.Option(
        "--master",
        metavar="ADDRESS",
        envvar="NEP_MASTER",
        help=f"Where the master is; {DEFAULT_MASTER} when nothing is said.",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Write JSON, for programs.")]


def _time(given: float | None) -> float | None:
    if given is not None and not given >= 0.0:  # also what is not a number
        raise typer.BadParameter(f"{given:g} is no time; give seconds, 0 or more")
    return given


TimeoutOption = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        metavar="SECONDS",
        help="End when no message came for so long.",
        show_default=False,
        callback=_time,
    ),
]
