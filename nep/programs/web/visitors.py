"""Display names of connected pages: client, kind of device and title, from the handshake. No I/O."""

from __future__ import annotations

import re
from typing import Literal
from urllib.parse import parse_qs, unquote, urlsplit

from nep.text import escaped

Device = Literal["", "phone", "tablet"]
MAX_SHOWN_LENGTH = 60
_MAX_READ_LENGTH = 2_000
_CLIENTS = (
    ("Lichtblick", "Lichtblick"),
    ("Foxglove", "Foxglove"),
    ("Autobahn", "roslibpy"),
    ("Firefox/", "Firefox"),
    ("FxiOS/", "Firefox"),
    ("SamsungBrowser/", "Samsung Internet"),
    ("OPR/", "Opera"),
    ("Edg", "Edge"),
    ("QtWebEngine/", "Qt WebEngine"),
    ("CriOS/", "Chrome"),
    ("Chrome/", "Chrome"),
    ("Safari/", "Safari"),
)
"""Substrings of User-Agents and client names, in order of priority.

Most browsers also claim to be Chrome and Safari.
"""
_PRODUCT = re.compile(r"[A-Za-z][\w.+-]*")


def client_name(user_agent: str, *, is_foxglove: bool = False) -> str:
    """Return the name of the client program; "" if unknown.

    Args:
        user_agent: User-Agent header, which is untrusted. A program's own name is bounded in length.
        is_foxglove: True if the client uses Foxglove's protocol; "Foxglove" is then the default name.
    """
    given = user_agent[:_MAX_READ_LENGTH]
    if is_foxglove:
        return "Lichtblick" if "lichtblick" in given.lower() else "Foxglove"
    for mark, name in _CLIENTS:
        if mark in given:
            return name
    product = _PRODUCT.match(given)
    return "" if product is None or product[0] == "Mozilla" else product[0][:MAX_SHOWN_LENGTH]


def device_kind(user_agent: str) -> Device:
    """Return the kind of device according to a User-Agent; "" for a computer or an unknown device."""
    given = user_agent[:_MAX_READ_LENGTH]
    if "iPhone" in given or ("Android" in given and "Mobile" in given):
        return "phone"
    return "tablet" if any(mark in given for mark in ("iPad", "Android", "Tablet")) else ""


def page_title(path: str, referer: str, origin: str) -> str:
    """Return a short title for a page, such as "buttons.html"; "" if there is none.

    Args:
        path: Path of the WebSocket URL. Its parameter ``title`` has priority.
        referer: URL of the page, which few browsers send; its last path segment is used next.
        origin: Origin of the page, which every browser sends; its host and port are used last.
    """
    for title in (_title_parameter(path), _last_part(referer), _host(origin)):
        if shown := escaped(title.strip())[:MAX_SHOWN_LENGTH]:
            return shown
    return ""


def _title_parameter(path: str) -> str:
    try:
        return parse_qs(urlsplit(path[:_MAX_READ_LENGTH]).query).get("title", [""])[0]
    except ValueError:
        return ""


def _last_part(url: str) -> str:
    try:
        return unquote(urlsplit(url[:_MAX_READ_LENGTH]).path.rpartition("/")[2])
    except ValueError:
        return ""


def _host(origin: str) -> str:
    try:
        return urlsplit(origin[:_MAX_READ_LENGTH]).netloc
    except ValueError:
        return ""
