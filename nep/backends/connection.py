"""Connection settings: through a master (`Hybrid`) or to a fixed address (`Direct`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.text import quotable

Mode = Literal["one2many", "many2one", "many2many"]

_MODES: dict[str, Mode] = {"one2many": "one2many", "many2one": "many2one", "many2many": "many2many"}


@dataclass(frozen=True)
class Hybrid:
    """Connection through a master. Created by `Node.hybrid`.

    Any number of publishers and subscribers can connect.

    Attributes:
        master: Address of the master.
        mode: Ignored; exists for compatibility with the original NEP.
    """

    master: str
    mode: Mode = "many2many"


@dataclass(frozen=True)
class Direct:
    """Connection to a fixed address without a master. Created by `Node.direct`.

    Attributes:
        ip: IP address or host name.
        port: Port, 1 to 65535.
        mode: Side that binds the port: the publisher (one2many), the subscriber (many2one), or neither
            (many2many). With many2many, publishers connect to `port` and subscribers to `port + 1` of a proxy
            of the original NEP.
        generation: Frame format on the "original" wire: "A" (`topic {…}`) or "B" (`{…}`).
        wire: "original", "native", or "tcp" (service calls only).
    """

    ip: str
    port: int
    mode: Mode
    generation: Literal["A", "B"] = "A"
    wire: Literal["original", "native", "tcp"] = "original"


Configuration = Hybrid | Direct
"""Connection settings of a publisher, subscriber, server or client. Default: the node's own master."""


def require_topic_support(configuration: Configuration) -> Configuration:
    """Return `configuration` if it supports topics. Raises `NepError` if it supports only calls."""
    if isinstance(configuration, Direct) and configuration.wire == "tcp":
        raise NepError(_("plain TCP supports only service calls; omit wire='tcp' for a topic"))
    return configuration


def validate_mode(mode: str) -> Mode:
    """Validate a mode and return it. Raises `NepError`, whose message lists the valid modes."""
    try:
        return _MODES[mode]
    except KeyError:
        raise NepError(
            _("unknown mode '{mode}'; {did_you_mean}").format(
                mode=quotable(str(mode)), did_you_mean=did_you_mean(mode, tuple(_MODES))
            )
        ) from None


def parse_port(port: str | int) -> int:
    """Parse a port number. Raises `NepError` if it is not from 1 to 65535."""
    text = str(port)
    if not text.isascii() or not text.isdigit() or len(text) > 5 or not 1 <= int(text) <= 65535:
        raise NepError(_("'{port}' isn't a port; use a number from 1 to 65535").format(port=quotable(text)))
    return int(text)
