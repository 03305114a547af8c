"""Texts about the web server: status bar, addresses, rejected connections, and the terminal command."""

from __future__ import annotations

import datetime as dt
import shlex
import subprocess
import sys
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from app.core.network.web_pages import DEFAULT_PORT, WebPages
from nep.i18n import _, ngettext, number
from nep.system.addresses import OwnAddress, master_address

if TYPE_CHECKING:
    from nep.programs.web.context import ConnectedPage, Rejection

_WIRELESS_PREFIXES = ("wl", "wi-fi", "wifi")
NextStep = Literal["", "allow origin", "choose robots", "let in"]


@dataclass(frozen=True, slots=True)
class PageNode:
    """Web page as shown in the graph.

    Attributes:
        title: Title of the page.
        location: Address and browser.
        icon: Name of the icon.
    """

    title: str
    location: str
    icon: str


@dataclass(frozen=True, slots=True)
class WebNotice:
    """Notice about a rejected connection or a slow page.

    Attributes:
        key: Identifier of the problem, equal for all notices about the same problem.
        next_step: Action of the button; "" for a notice without a button.
        value: Argument of the action: an origin, a robot or the id of a page; "" if it has none.
    """

    key: tuple[str, ...]
    status: Literal["error", "warn"]
    message: str
    next_step: NextStep = ""
    value: str = ""


def is_wireless(address: OwnAddress) -> bool:
    """Return True if an address belongs to a Wi-Fi interface, judged by the name of the interface."""
    return address.interface.casefold().startswith(_WIRELESS_PREFIXES)


def address_text(address: OwnAddress) -> str:
    """Format an address of this computer, such as "Wi-Fi 192.168.1.20" or "192.168.1.20 (eth0)"."""
    if is_wireless(address):
        return _("Wi-Fi {address}").format(address=address.host)
    return f"{address.host} ({address.interface})" if address.interface else address.host


def host_text(web: WebPages) -> str:
    """Format the address at which other computers connect; "" if other computers can't connect."""
    if not web.host:
        return ""
    address = next((each for each in web.addresses() if each.host == web.host), OwnAddress(web.host, ""))
    return address_text(address)


def web_status(web: WebPages, network: str) -> tuple[str, str, str | None]:
    """Return the icon, the text and the status for the status bar; the text is "" while the server is off.

    Args:
        web: Web server of Studio.
        network: Cached result of `host_text` for the current address.
    """
    if web.state != "on":
        return "", "", None
    count = len(web.connected)
    pages = ngettext("{count} page", "{count} pages", count).format(count=count) if count else ""
    if not web.host:
        access_text = _("Web: this computer only")
        return "globe", ", ".join(filter(None, (access_text, pages))), None
    access_text = _("Web: open to {network}").format(network=network or web.host)
    return "globe", ", ".join(filter(None, (access_text, pages))), "warn"


def page_name(page: ConnectedPage) -> str:
    """Return the display name of a page.

    This is its title, or else the library in use, the origin, or the name of its node.
    """
    is_named = page.title and page.title != page.name
    return page.title if is_named else page.client or page.origin or page.name


def location_text(page: ConnectedPage) -> str:
    """Format the address and the browser of a page, such as "192.168.1.30, Chrome"."""
    client = page.client if page.client != page_name(page) else ""
    return ", ".join(filter(None, (page.address, client)))


def page_icon(page: ConnectedPage) -> str:
    """Return the name of the icon for a page: tablet, phone, browser or program."""
    if page.device:
        return "smartphone" if page.device == "phone" else "tablet"
    return "monitor" if page.origin else "terminal"


def page_nodes(web: WebPages) -> dict[str, PageNode]:
    """Return the connected pages as shown in the graph, by the name of their node."""
    return {
        page.name: PageNode(page_name(page), location_text(page), page_icon(page)) for page in web.connected
    }


def terminal_command(web: WebPages, platform: str = sys.platform) -> str:
    """Return the terminal command that starts a server with the same settings without Studio."""
    arguments = ["nep", "web"]
    if web.port != DEFAULT_PORT:
        arguments += ["--port", str(web.port)]
    if web.host:
        arguments += ["--listen", web.host]
    for origin in web.origins:
        arguments += ["--origin", origin]
    for robot in web.robots:
        arguments += ["--allow-moving", robot]
    if "foxglove" in web.protocols:
        arguments.append("--foxglove")
    if web.master != master_address():
        arguments += ["--master", web.master]
    return subprocess.list2cmdline(arguments) if platform == "win32" else shlex.join(arguments)


def notices(web: WebPages, dismissed: Collection[tuple[str, ...]] = ()) -> tuple[WebNotice, ...]:
    """Return the notices to show: rejected connections, newest first, then slow pages.

    A connection that has been allowed since has no notice.

    Args:
        web: Web server of Studio.
        dismissed: Keys of notices that the user closed.
    """
    notices_by_key: dict[tuple[str, ...], WebNotice] = {}
    for notice in (*_rejection_notices(web), *_slow_notices(web)):
        if notice.key not in dismissed:
            notices_by_key.setdefault(notice.key, notice)
    return tuple(notices_by_key.values())


def _rejection_notices(web: WebPages) -> Iterator[WebNotice]:
    for rejection in reversed(web.rejections):
        if rejection.kind == "kept out":
            yield from _blocked_notices(web, rejection)
            continue
        if rejection.origin and rejection.origin in web.origins:
            continue
        if rejection.kind == "robot" and rejection.robot in web.robots:
            continue
        yield _create_notice(rejection)


def _blocked_notices(web: WebPages, rejection: Rejection) -> Iterator[WebNotice]:
    for page in web.blocked_pages.values():
        if rejection.client in {page.origin, page.address}:
            message = _("{page} tried to connect again at {time} and was rejected.").format(
                page=page_name(page), time=_clock_text(rejection.time_s)
            )
            yield WebNotice(("kept out", str(page.id)), "error", message, "let in", str(page.id))


def _create_notice(rejection: Rejection) -> WebNotice:
    key = (rejection.kind, rejection.client, rejection.robot)
    client, time_text = rejection.client, _clock_text(rejection.time_s)
    if rejection.kind == "robot" and rejection.robot:
        message = _("A page tried to move {robot}. The command was rejected.").format(robot=rejection.robot)
        return WebNotice(("robot", rejection.robot), "error", message, "choose robots", rejection.robot)
    if rejection.kind == "origin" or rejection.origin:
        message = _("{origin} was rejected at {time}. Its origin isn't allowed.")
        step: NextStep = "allow origin" if rejection.origin else ""
        return WebNotice(key, "error", message.format(origin=client, time=time_text), step, rejection.origin)
    if rejection.kind == "token":
        message = _("{address} was rejected at {time}: wrong token.")
        return WebNotice(key, "error", message.format(address=client, time=time_text))
    message = _("{address} was rejected at {time}: {reason}.")
    return WebNotice(key, "error", message.format(address=client, time=time_text, reason=rejection.reason))


def _slow_notices(web: WebPages) -> Iterator[WebNotice]:
    for slow_topic in web.slow_topics:
        message = _("{page} can't keep up with {topic}. {share} of the messages were dropped.").format(
            page=page_name(slow_topic.page),
            topic=slow_topic.topic,
            share=share_text(slow_topic.dropped_share),
        )
        yield WebNotice(("slow", slow_topic.page.name, slow_topic.topic), "warn", message)


def share_text(share: float) -> str:
    """Format a share as a percentage, such as "0.3 %", or "under 0.1 %" for a smaller share above zero."""
    if 0 < share < 0.0005:
        return _("under {share}").format(share=number(0.001, ".1%").replace("%", " %"))
    return number(share, ".1%").replace("%", " %")


def _clock_text(time_s: float) -> str:
    local_time = dt.datetime.fromtimestamp(time_s).astimezone()
    return f"{local_time.hour}:{local_time.minute:02d}"
