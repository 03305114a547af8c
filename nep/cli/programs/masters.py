"""`nep master`: run the master."""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.alert_printer import AlertLog, AlertPrinter
from nep.cli.options import MasterOption
from nep.cli.screen import console, print_status
from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.masters.master import Attachment, Master, is_running
from nep.system.addresses import ANY_HOST, host_of, is_loopback, master_address, own_addresses
from nep.system.descriptors import raise_open_file_limit
from nep.system.lazy_import import lazy_module
from nep.system.terminal import Terminal, log_to

if TYPE_CHECKING:
    from nep.programs import doctor
    from nep.programs.doctor import collect
    from nep.programs.gateway import attachment
else:  # imported on use, to keep the other commands fast
    doctor, collect = lazy_module("nep.programs.doctor"), lazy_module("nep.programs.doctor.collect")
    attachment = lazy_module("nep.programs.gateway.attachment")


_ListenOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar=_("ADDRESS"),
        help=_(
            "Also accept connections from other computers at this address of this computer; 0.0.0.0 means "
            "all. There is no password: anyone on that network can read and send all messages."
        ),
        show_default=False,
    ),
]
_OwnerOption = Annotated[
    int | None,
    typer.Option(
        metavar="PID",
        help=_("Exit when this process has exited and no node is registered."),
        show_default=False,
    ),
]


def master(
    master: MasterOption = None,
    port: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65535,
            help=_("Port (default: that of --master or NEP_MASTER, or 7780)."),
            show_default=False,
        ),
    ] = None,
    listen: _ListenOption = None,
    owner_pid: _OwnerOption = None,
    gateway: Annotated[
        bool,
        typer.Option(
            "--gateway/--no-gateway",
            envvar="NEP_GATEWAY",
            help=_("Allow programs of the original NEP to join."),
        ),
    ] = True,
) -> None:
    """Run the master until Ctrl+C: nodes register there and find each other.

    Messages never pass through it; connected nodes keep exchanging messages while it is down.
    """
    address = _address(master, port)
    with Terminal(sys.stderr) as terminal:  # a blocked terminal must not stop the master
        log_to(terminal, logging.WARNING)
        running_master = _start(address, owner_pid, terminal, has_gateway=gateway)
        try:
            running_master.listen(listen or ())
            _show_address(running_master.address, terminal, has_gateway=gateway)
            problem = collect.loopback_problem()
            if problem:
                print_status(
                    _(
                        "programs on this computer can't reach the master: {problem}; run 'nep doctor' "
                        "for details"
                    ).format(problem=problem),
                    terminal,
                )
            _show_remote_addresses(running_master.address, listen or (), terminal)
            interrupts.exit_on_termination()
            running_master.wait()
        finally:
            running_master.close()


def _start(address: str, owner_pid: int | None, terminal: Terminal, *, has_gateway: bool) -> Master:
    raise_open_file_limit()
    attachments: list[Attachment] = [AlertPrinter(terminal), AlertLog()]
    if has_gateway:
        attachments.insert(0, attachment.GatewayAttachment())
    try:
        return Master(address, attachments=attachments, owner_pid=owner_pid).start()
    except AddressInUseError as error:
        if is_running(address):
            raise NepError(
                _("a master is already running at '{address}'; use it, or choose another --port").format(
                    address=address
                )
            ) from error
        blocker = doctor.start_blocker(address)
        if blocker is None:
            raise
        raise NepError(blocker.error_message) from error


def _address(master: str | None, port: int | None) -> str:
    address = master_address(master)
    if port is not None:
        address = f"{host_of(address)}:{port}"
    if not is_loopback(address):
        raise NepError(
            _(
                "a master always listens on 127.0.0.1; use that address, and add --listen {host} to accept "
                "other computers"
            ).format(host=host_of(address))
        )
    return address


def _show_address(address: str, terminal: Terminal, *, has_gateway: bool) -> None:
    out = console(out=terminal)
    out.print(_("[bold green]●[/] master at [bold]{address}[/]").format(address=address))
    if has_gateway:
        out.print(_("  programs of the original NEP can join"), style="dim")
    out.print(_("  press Ctrl+C to stop"), style="dim")


def _show_remote_addresses(address: str, hosts: Sequence[str], terminal: Terminal) -> None:
    out = console(out=terminal)
    port = address.rpartition(":")[2]
    reachable_hosts = [own_address.host for own_address in own_addresses()] if ANY_HOST in hosts else hosts
    for host in reachable_hosts:
        out.print(
            _("[bold yellow]●[/] other computers connect with [bold]NEP_MASTER={host}:{port}[/]").format(
                host=host, port=port
            )
        )
    if hosts:
        out.print(
            _("  anyone on that network can read and send all messages: there is no password"), style="yellow"
        )
