"""Options that several commands share."""

from __future__ import annotations

from typing import Annotated

import typer

from nep.addresses import DEFAULT_MASTER

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
