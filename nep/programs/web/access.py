"""Access control by the page's origin, the token, or rosbridge's ``auth``. Performs no I/O.

Any web page shown in a browser on this computer can open a WebSocket to 127.0.0.1. The browser sends the
page's origin, so only pages of this computer and explicitly allowed origins are accepted. Programs send no
origin; if other computers can connect, the token is required.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import parse_qs, quote, urlsplit

from nep.errors import NepError
from nep.i18n import _
from nep.programs.web.messages.operations import Auth
from nep.text import quotable

_CLOCK_TOLERANCE_S = 5
"""Maximum difference between the clocks of server and client in seconds, as in rosauth."""
_MAX_USED_MACS = 1_000
_DEFAULT_PORTS = {"http": 80, "https": 443}


def new_token() -> str:
    """Return a new random token that can be part of a URL."""
    return secrets.token_urlsafe(24)


def path_with_token(token: str) -> str:
    """Return the path and query of a URL with a token ("/?token=..."); "/" if the token is ""."""
    return f"/?token={quote(token, safe='')}" if token else "/"


def is_local_host(host: str) -> bool:
    """Return True if a host name refers to this computer.

    That is localhost, a name below it such as "app.localhost", or a loopback address.
    """
    if host == "localhost" or host.endswith(".localhost"):
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def checked_origin(origin: str) -> str:
    """Return an origin in the form that browsers send. Raises `NepError` if the origin is invalid.

    "null" is the origin of pages opened as files, and of every sandboxed frame. "file://" is the origin
    of desktop programs such as Lichtblick.
    """
    if origin in {"null", "file://"}:
        return origin
    try:
        parts = urlsplit(origin if origin.isascii() and origin.isprintable() else "")  # urlsplit removes tabs
        port = parts.port
    except ValueError:
        parts, port = urlsplit(""), None
    is_origin = parts.scheme in _DEFAULT_PORTS and bool(parts.hostname) and parts.path in {"", "/"}
    if not is_origin or parts.query or parts.fragment or parts.username:
        raise NepError(
            _("'{origin}' isn't a valid origin; use an origin such as 'http://192.168.1.5:8000'").format(
                origin=quotable(origin)
            )
        )
    is_default_port = port is None or port == _DEFAULT_PORTS[parts.scheme]
    host = f"[{parts.hostname}]" if ":" in (parts.hostname or "") else parts.hostname
    return f"{parts.scheme}://{host}" if is_default_port else f"{parts.scheme}://{host}:{port}"


@dataclass(frozen=True)
class Access:
    """Rules that decide which pages and programs may connect.

    Attributes:
        origins: Allowed origins of pages, in addition to the pages of this computer.
        token: Token required from pages and programs; "" if none is required.
    """

    origins: Collection[str] = ()
    token: str = ""

    def origin_rejection_reason(self, origin: str | None, own_origin: str = "") -> str:
        """Return the reason why a page with this origin may not connect; "" if the page may connect.

        Args:
            origin: Origin of the page; None for a program.
            own_origin: Origin of the server's own pages: the address and port at which the connection
                arrived.
        """
        if origin is None:
            return ""
        try:
            normalized = checked_origin(origin)
            if (
                normalized == own_origin
                or normalized in self.origins
                or is_local_host(urlsplit(normalized).hostname or "")
            ):
                return ""
        except NepError:
            pass
        return _("pages from '{origin}' aren't allowed to connect; allow them with --origin {option}").format(
            origin=quotable(origin), option=quotable(origin)
        )

    def check_token(self, path: str, authorization: str | None) -> bool | None:
        """Return True if a handshake contains the valid token, False if it is wrong, None if there is none.

        Args:
            path: Path of the URL, with a query such as ``/?token=TOKEN``.
            authorization: Authorization header, such as ``Bearer TOKEN``, or None.
        """
        tokens = [*parse_qs(urlsplit(path).query, keep_blank_values=True).get("token", ())]
        scheme, _space, value = (authorization or "").partition(" ")
        if scheme.lower() == "bearer" and value:
            tokens.append(value.strip())
        if not tokens:
            return None
        return sum(map(self._is_valid_token, tokens)) > 0

    def _is_valid_token(self, token: str) -> bool:
        return hmac.compare_digest(token.encode("utf-8", "replace"), self.token.encode())


class AuthVerifier:
    """Validator of rosbridge's ``auth`` operations, each of which is valid once and for a few seconds.

    Args:
        token: Required token.
        clock: Clock in seconds since 1970.
    """

    def __init__(self, token: str, clock: Callable[[], float] = time.time) -> None:
        self._token = token
        self._clock = clock
        self._used_macs: dict[str, None] = {}

    def verify(self, auth: Auth) -> bool:
        """Return True if the credentials match the token, are not expired, and were not used before."""
        parts = (self._token, auth.client, auth.dest, auth.rand, auth.time_s, auth.level, auth.end_s)
        text = "".join(map(str, parts)).encode("utf-8", "replace")
        mac = hashlib.sha512(text).hexdigest()
        is_valid_mac = hmac.compare_digest(mac.encode(), auth.mac.lower().encode("utf-8", "replace"))
        now = self._clock()
        is_current = abs(now - auth.time_s) <= _CLOCK_TOLERANCE_S and auth.end_s > now
        if not (is_valid_mac and is_current) or mac in self._used_macs:
            return False
        self._used_macs[mac] = None
        while len(self._used_macs) > _MAX_USED_MACS:
            del self._used_macs[next(iter(self._used_macs))]
        return True
