"""`nep web`: server for web pages and programs with rosbridge's protocol and, on request, Foxglove's."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Annotated

import typer

from nep.cli import interrupts
from nep.cli.options import AllowMovingOption, MasterOption
from nep.cli.screen import console, print_status
from nep.errors import AddressInUseError, NepError
from nep.i18n import _, ngettext
from nep.masters.master import is_running
from nep.programs.web.access import Access, checked_origin, new_token, path_with_token
from nep.programs.web.server import DEFAULT_PORT, WebServer, WebSettings
from nep.recordings.formats.channels import LiveChannels
from nep.system.addresses import ANY_HOST, check_host, master_address, own_addresses
from nep.system.descriptors import raise_open_file_limit
from nep.system.terminal import Terminal, log_to

_WAIT_SLICE_S = 0.1
_MASTER_TIMEOUT_S = 0.5
_MIN_TOKEN_LENGTH, _MAX_TOKEN_BYTES = 16, 1_000

PortOption = Annotated[
    int, typer.Option("--port", "-p", min=1, max=65535, metavar="PORT", help=_("Port to listen on."))
]
ListenOption = Annotated[
    list[str] | None,
    typer.Option(
        "--listen",
        metavar=_("ADDRESS"),
        help=_(
            "Accept connections from other computers at this address of this computer; 0.0.0.0 means "
            "all. They need the token."
        ),
        show_default=False,
    ),
]
OriginOption = Annotated[
    list[str] | None,
    typer.Option(
        "--origin",
        metavar="ORIGIN",
        help=_(
            "Allow pages of this origin, such as http://192.168.1.5:8000. Can be repeated. Pages of this "
            "computer are always allowed. 'null' allows pages that were opened as files."
        ),
        show_default=False,
    ),
]
TokenOption = Annotated[
    Path | None,
    typer.Option(
        "--token",
        metavar=_("FILE"),
        help=_(
            "Require the token in this file from all clients. A missing file is created with a new token. "
            "Without this option, --listen generates a new token at each start."
        ),
        show_default=False,
    ),
]
FoxgloveOption = Annotated[
    bool,
    typer.Option(
        "--foxglove",
        help=_("Also serve Foxglove and Lichtblick, over Foxglove's WebSocket protocol."),
    ),
]


def web(
    port: PortOption = DEFAULT_PORT,
    listen: ListenOption = None,
    origin: OriginOption = None,
    token: TokenOption = None,
    allow_moving: AllowMovingOption = None,
    foxglove: FoxgloveOption = False,
    master: MasterOption = None,
) -> None:
    """Serve web pages and programs with roslib, roslibpy or Foxglove until Ctrl+C.

    This is a WebSocket server for the rosbridge v2 protocol. Each connected page is a node. Only this
    computer can connect unless you add --listen. Messages that move a robot are blocked unless you add
    --allow-moving. See docs/web.md for examples.
    """
    hosts = [check_host(each) for each in listen or ()]
    origins = frozenset(map(checked_origin, origin or ()))
    is_file_new = token is not None and not token.exists()
    secret = _read_or_create_token(token, is_needed=bool(hosts))
    settings = WebSettings(
        port=port,
        listen=tuple(hosts),
        access=Access(origins, secret),
        allow_moving=frozenset(allow_moving or ()),
        master=master,
        foxglove=LiveChannels() if foxglove else None,
    )
    raise_open_file_limit()
    with Terminal(sys.stderr) as terminal:
        log_to(terminal, logging.WARNING)
        server = WebServer(settings)
        try:
            _start(server)
            interrupts.exit_on_termination()
            _print_start_message(server, terminal, token_file=None if token is None or is_file_new else token)
            while not server.wait(_WAIT_SLICE_S):
                pass  # short waits: on Windows Ctrl+C does not interrupt a wait
            if server.problem is not None:
                raise NepError(
                    _("the web server stopped because of an error: {reason}").format(reason=server.problem)
                )
        finally:
            server.close()
            _print_summary(server, terminal)


def _start(server: WebServer) -> None:
    try:
        server.start()
    except AddressInUseError as error:
        raise NepError(
            _(
                "port {port} is in use, perhaps by rosbridge or another 'nep web'; stop that program or "
                "choose another port with --port"
            ).format(port=server.settings.port)
        ) from error


def _read_or_create_token(file: Path | None, *, is_needed: bool) -> str:
    """Return the token in `file`, which is created if it doesn't exist.

    Without a file, returns a new token, or "" if none is needed. Raises `NepError` if the file can't be
    used or contains no valid token.
    """
    if file is None:
        return new_token() if is_needed else ""
    try:
        if not file.exists():
            return _create_token_file(file)
        with file.open("rb") as stream:
            token = stream.read(_MAX_TOKEN_BYTES).decode("utf-8", "replace").strip()
    except OSError as error:
        raise NepError(
            _("can't use the token file '{file}': {reason}").format(file=file, reason=error.strerror)
        ) from error
    if len(token) < _MIN_TOKEN_LENGTH or not token.isascii() or not token.isprintable():
        raise NepError(
            _(
                "the token in '{file}' is shorter than {least} characters or not printable ASCII; delete the "
                "file to create a new one"
            ).format(file=file, least=_MIN_TOKEN_LENGTH)
        )
    return token


def _create_token_file(file: Path) -> str:
    """Create a file with a new token, readable by its owner only; return the token."""
    token = new_token()
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
        stream.write(token + "\n")
    return token


def _print_start_message(server: WebServer, terminal: Terminal, *, token_file: Path | None) -> None:
    """Print the URLs and the access rules, and report a missing master."""
    out = console(out=terminal)
    token = server.settings.access.token
    query = path_with_token(token) if token and token_file is None else ""
    out.print(_("[bold green]●[/] web pages connect to [bold]{url}[/]").format(url=server.url + query))
    for host in _network_hosts(server.settings.listen):
        url = f"ws://{host}:{server.port}{query}"
        out.print(_("[bold yellow]●[/] other computers connect to [bold]{url}[/]").format(url=url))
    hosts = [*_network_hosts(server.settings.listen), "127.0.0.1"]
    page_url = f"http://{hosts[0]}:{server.port}{query or '/'}"
    out.print(_("  test page: {url}").format(url=page_url), style="dim")
    if token_file is not None:
        message = _("  append /?token=TOKEN to the URL, where TOKEN is the token in {file}")
        out.print(message.format(file=token_file), style="dim")
    if not server.settings.access.origins:
        out.print(
            _("  pages from web servers on other computers require --origin"),
            style="dim",
        )
    address = master_address(server.settings.master)
    if not is_running(address, _MASTER_TIMEOUT_S):
        message = _("no master at '{address}'; start one with 'nep master'")
        print_status(message.format(address=address), terminal)
    out.print(_("  press Ctrl+C to stop"), style="dim")


def _network_hosts(listen: Collection[str]) -> list[str]:
    return [own_address.host for own_address in own_addresses()] if ANY_HOST in listen else list(listen)


def _print_summary(server: WebServer, terminal: Terminal) -> None:
    counts = server.counts
    if not (counts.opened or counts.turned_away):
        return
    summary = ngettext("{count} connection", "{count} connections", counts.opened).format(count=counts.opened)
    summary += _(
        ", {turned_away} rejected; {operations} operations, {rejected} rejected; {sent} messages "
        "sent, {dropped} dropped"
    ).format(**counts.as_map())
    print_status(summary, terminal)
