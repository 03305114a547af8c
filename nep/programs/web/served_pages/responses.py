"""Responses to HTTP requests that are not WebSocket handshakes. Reads no files except the pages.

Pages load no external files, and have a Content-Security-Policy with the hashes of their scripts and styles.
Pages are served only for a Host header from which a page could also connect, because a host name of another
site can resolve to this computer (DNS rebinding).
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping
from functools import lru_cache
from http import HTTPStatus
from pathlib import Path
from typing import NamedTuple

from nep.errors import NepError
from nep.i18n import _, language
from nep.programs.web.access import Access, checked_origin, path_with_token

_METHODS = frozenset({"GET", "HEAD"})
_PLACEHOLDER = re.compile(r"\{\{(\w+)\}\}")
_INLINE_ELEMENT = re.compile(r"<(script|style)>(.*?)</\1>", re.DOTALL)
_HTML_TYPE = "text/html; charset=utf-8"
_TEXT_TYPE = "text/plain; charset=utf-8"
_HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class PageRequest(NamedTuple):
    """HTTP request.

    Attributes:
        method: HTTP method.
        path: Path with query.
        hosts: Values of the Host headers.
        own_origin: Origin of the server's pages at the address of the connection.
        authorization: Value of the Authorization header, if any.
    """

    method: str
    path: str
    hosts: tuple[str, ...]
    own_origin: str
    authorization: str | None = None


class PageResponse(NamedTuple):
    """HTTP response.

    Attributes:
        status: Status code.
        headers: Header fields.
        body: Content.
        is_token_rejected: True if the token was missing or wrong.
    """

    status: HTTPStatus
    headers: Mapping[str, str]
    body: bytes
    is_token_rejected: bool = False


def respond(request: PageRequest, access: Access) -> PageResponse:
    """Return the response to a request. Never raises because of the request's content.

    Args:
        request: HTTP request.
        access: Rules that decide which pages may connect.
    """
    path = request.path.partition("?")[0]
    if request.method not in _METHODS:
        return _text_response(
            HTTPStatus.METHOD_NOT_ALLOWED, _("only GET is supported"), {"Allow": "GET, HEAD"}
        )
    if path not in {"/", "/starter.html"}:
        return _text_response(HTTPStatus.NOT_FOUND, _("page not found; open {url}").format(url="/"))
    origin = _origin(request, access)
    if origin is None:
        template = _("this server replies only at its own address; open {url}")
        return _text_response(HTTPStatus.FORBIDDEN, template.format(url=f"{request.own_origin}/"))
    if access.token and not access.check_token(request.path, request.authorization):
        return _page_response(
            HTTPStatus.UNAUTHORIZED,
            _fill_template("refused.html", _rejected_page_texts()),
            "default-src 'none'; img-src data:",
        )._replace(is_token_rejected=True)
    host = origin.partition("://")[2]
    url = f"{'wss' if origin.startswith('https') else 'ws'}://{host}"
    if path == "/starter.html":
        page = starter_page(url + path_with_token(access.token))
        return _page_response(HTTPStatus.OK, page, f"default-src 'none'; connect-src {url}")
    policy = f"default-src 'none'; img-src data:; connect-src 'self' {url}"
    return _page_response(HTTPStatus.OK, _fill_template("test.html", _test_page_texts()), policy)


def starter_page(url: str) -> str:
    """Return the HTML of a template page that connects to a server and shows a topic.

    Args:
        url: WebSocket URL of the server, with the token if one is required.
    """
    return _read_template("starter.html").replace("{{address}}", _script_json(url))


def _origin(request: PageRequest, access: Access) -> str | None:
    """Return the origin of the served page in the browser; None if that page may not connect."""
    if len(request.hosts) != 1:
        return None
    for scheme in ("http", "https"):
        try:
            origin = checked_origin(f"{scheme}://{request.hosts[0]}")
        except NepError:
            return None
        if not access.origin_rejection_reason(origin, request.own_origin):
            return origin
    return None


# ---- responses


def _text_response(
    status: HTTPStatus, message: str, headers: Mapping[str, str] | None = None
) -> PageResponse:
    content_headers = {"Content-Type": _TEXT_TYPE, "Content-Security-Policy": "default-src 'none'"}
    return PageResponse(status, {**_HEADERS, **content_headers, **(headers or {})}, f"{message}\n".encode())


def _page_response(status: HTTPStatus, text: str, policy: str) -> PageResponse:
    hashes: dict[str, str] = {}
    for element, content in _INLINE_ELEMENT.findall(text):
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        hashes[element] = hashes.get(element, "") + f" 'sha256-{digest}'"
    inline = "".join(f"; {element}-src{each}" for element, each in hashes.items())
    policy += f"{inline}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    return PageResponse(
        status, {**_HEADERS, "Content-Type": _HTML_TYPE, "Content-Security-Policy": policy}, text.encode()
    )


@lru_cache
def _read_template(name: str) -> str:
    return Path(__file__).with_name(name).read_text("utf-8")


def _fill_template(name: str, texts: Mapping[str, str]) -> str:
    """Return a page with its placeholders replaced by texts.

    The placeholder "data" is replaced by JSON for the page's script; other texts are escaped.
    """

    def replacement(match: re.Match[str]) -> str:
        if match[1] == "data":
            return _script_json(texts)
        return html.escape(texts[match[1]])

    return _PLACEHOLDER.sub(replacement, _read_template(name))


def _script_json(value: object) -> str:
    """Encode a value as JSON that can be embedded in a script element."""
    return json.dumps(value).replace("<", "\\u003c")


# ---- texts


def _rejected_page_texts() -> dict[str, str]:
    return {
        "language": language(),
        "title": _("Token required"),
        "sentence": _(
            "This page needs the server's token. Open the address shown by 'nep web' or Studio, or "
            "scan its code."
        ),
    }


def _test_page_texts() -> dict[str, str]:
    return {
        "language": language(),
        "title": _("Test page"),
        "topics": _("Topics"),
        "no_topics": _("No topics yet. They appear here when a program publishes."),
        "publish_text": _("Publish text"),
        "topic": _("Topic"),
        "text": _("Text"),
        "hello": _("hello"),
        "publish": _("Publish"),
        "connect": _("Connect"),
        "starter": _("Template for your own page"),
        "connecting": _("Connecting…"),
        "connected": _("Connected to {address}"),
        "disconnected": _("Disconnected by the server."),
        "refused": _("The server's token has changed. Open its new address, or scan its code again."),
        "lost": _("Not connected. Trying again in {seconds} s."),
        "rate": _("{rate}/s, {bandwidth} kB/s"),
        "no_message": _("No message yet"),
        "newest": _("{count} received, latest at {time}"),
        "picture": _("Latest image of {topic}"),
        "needs_json": _("The type of this topic is {type}. Write the message as JSON."),
        "sent": _("Sent at {time}"),
        "not_sent": _("Not sent: the page isn't connected."),
    }
