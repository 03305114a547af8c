"""Display names of connected pages, from their handshakes: client, device and title. Performs no I/O."""

from __future__ import annotations

import re
from typing import Literal
from urllib.parse import parse_qs, unquote, urlsplit

from nep.text import escaped

Device = Literal["", "phone", "tablet"]
MAX_DISPLAYED_LENGTH = 60
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
"""Client names by the substring of the User-Agent that identifies them, in order of priority.

The order matters because most browsers also claim to be Chrome and Safari.
"""
_PRODUCT_TOKEN = re.compile(r"[A-Za-z][\w.+-]*")


def client_name(user_agent: str, *, is_foxglove: bool = False) -> str:
    """Return the name of the client program; "" if unknown.

    Args:
        user_agent: User-Agent header, which is untrusted. Names of programs are shortened.
        is_foxglove: True if the client uses Foxglove's protocol, for which "Foxglove" is the default name.
    """
    agent = user_agent[:_MAX_READ_LENGTH]
    if is_foxglove:
        return "Lichtblick" if "lichtblick" in agent.lower() else "Foxglove"
    for substring, name in _CLIENTS:
        if substring in agent:
            return name
    product = _PRODUCT_TOKEN.match(agent)
    return "" if product is None or product[0] == "Mozilla" else product[0][:MAX_DISPLAYED_LENGTH]


def device_kind(user_agent: str) -> Device:
    """Return the kind of device according to a User-Agent; "" for a computer or an unknown device."""
    agent = user_agent[:_MAX_READ_LENGTH]
    if "iPhone" in agent or ("Android" in agent and "Mobile" in agent):
        return "phone"
    return "tablet" if any(substring in agent for substring in ("iPad", "Android", "Tablet")) else ""


def page_title(path: str, referer: str, origin: str) -> str:
    """Return a short title for a page, such as "buttons.html"; "" if there is none.

    Args:
        path: Path of the WebSocket URL. Its parameter ``title`` has the highest priority.
        referer: URL of the page, which few browsers send. Its last path segment has the second priority.
        origin: Origin of the page, which every browser sends. Its host and port have the lowest priority.
    """
    for title in (_title_parameter(path), _last_part(referer), _host(origin)):
        if display_title := escaped(title.strip())[:MAX_DISPLAYED_LENGTH]:
            return display_title
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
