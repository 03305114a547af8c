"""Options shared by several commands."""

from __future__ import annotations

from typing import Annotated

import typer

from nep.i18n import _
from nep.system.addresses import DEFAULT_MASTER

MasterOption = Annotated[
    str | None,
    typer.Option(
        "--master",
        metavar=_("ADDRESS"),
        envvar="NEP_MASTER",
        help=_("Address of the master (default: {address}).").format(address=DEFAULT_MASTER),
        show_default=False,
    ),
]
AllowMovingOption = Annotated[
    list[str] | None,
    typer.Option(
        "--allow-moving",
        metavar=_("ROBOT"),
        help=_(
            "Allow this robot, virtual or real, to be moved; can be repeated. The name of a topic "
            "allows all robots that it moves. Make sure that nobody is in the way."
        ),
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help=_("Print JSON."))]


def check_duration(duration_s: float | None) -> float | None:
    """Return a duration in seconds unchanged; raise `typer.BadParameter` if it is negative or NaN.

    None is valid, too: the option was not given.
    """
    if duration_s is not None and not duration_s >= 0.0:  # rejects NaN, too
        raise typer.BadParameter(
            _("{given:g} isn't a valid duration; use a number of seconds, 0 or greater").format(
                given=duration_s
            )
        )
    return duration_s


TimeoutOption = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        metavar=_("SECONDS"),
        help=_("Exit with an error if no message arrives for this long."),
        show_default=False,
        callback=check_duration,
    ),
]
