"""How a publisher or subscriber is connected: with a master (hybrid) or straight to an address (direct)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.text import quotable

__all__ = ["Configuration", "Direct", "Hybrid", "Mode", "checked_mode", "checked_port", "for_messages"]

Mode = Literal["one2many", "many2one", "many2many"]

_MODES: dict[str, Mode] = {"one2many": "one2many", "many2one": "many2one", "many2many": "many2many"}


@dataclass(frozen=True)
class Hybrid:
    """Connected through the master at `master`. Any number on both sides, whatever the mode says.

    `mode`: as the original NEP has it. `Node.hybrid` makes one.
    """

    master: str
    mode: Mode = "many2many"


@dataclass(frozen=True)
class Direct:
    """Connected without a master, at `ip:port`. `Node.direct` makes one.

    `ip`: an address, or a name of a computer. `port`: 1 to 65535. `mode`: who binds the port, see below.
    `wire`: "original" frames of `generation` "A" (`topic {…}`) or "B" (`{…}`), the "native" wire, or plain
    "tcp" (calls only).

    one2many: the publisher binds the port. many2one: the subscriber does. many2many: both connect, publishers
    to `port`, subscribers to `port + 1`, and a proxy of the original NEP has to run there.
    """

    ip: str
    port: int
    mode: Mode
    generation: Literal["A", "B"] = "A"
    wire: Literal["original", "native", "tcp"] = "original"


Configuration = Hybrid | Direct
"""How a publisher, subscriber, server or client is connected; left out it is the node's own master."""


def for_messages(configuration: Configuration) -> Configuration:
    """`configuration` itself when it carries messages. Raises `NepError`."""
    if isinstance(configuration, Direct) and configuration.wire == "tcp":
        raise NepError(_("plain TCP carries calls of services only; leave out wire='tcp' for a topic"))
    return configuration


def checked_mode(mode: str) -> Mode:
    """`mode` as a `Mode`. Raises `NepError` with the names there are."""
    try:
        return _MODES[mode]
    except KeyError:
        raise NepError(
            _("no mode '{mode}'; {did_you_mean}").format(
                mode=quotable(str(mode)), did_you_mean=did_you_mean(mode, tuple(_MODES))
            )
        ) from None


def checked_port(port: str | int) -> int:
    """`port` as a number from 1 to 65535. Raises `NepError`."""
    text = str(port)
    if not text.isascii() or not text.isdigit() or len(text) > 5 or not 1 <= int(text) <= 65535:
        raise NepError(_("'{port}' is no port; use a number from 1 to 65535").format(port=quotable(text)))
    return int(text)
