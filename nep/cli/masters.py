"""`nep master`: the program that knows who publishes and who subscribes."""

from __future__ import annotations

import logging
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.alert_printer import AlertLog, AlertPrinter
from nep.cli.options import MasterOption
from nep.cli.screen import console, say
from nep.errors import AddressInUseError, NepError
from nep.i18n import _
from nep.masters.master import Attachment, Master, is_running
from nep.system.addresses import ANY, host_of, is_loopback, master_address, own_addresses
from nep.system.descriptors import allow_many
from nep.system.lazy_import import lazy_module
from nep.system.terminal import Terminal, log_to

if TYPE_CHECKING:
    from nep.programs import doctor
    from nep.programs.doctor import collect
    from nep.programs.gateway import attachment
else:  # the other commands need not wait for them
    doctor, collect = lazy_module("nep.programs.doctor"), lazy_module("nep.programs.doctor.collect")
    attachment = lazy_module("nep.programs.gateway.attachment")


_ListenOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar=_("ADDRESS"),
        help=_(
            "Serve other computers, too, at this address of this one; 0.0.0.0 is all of them. "
            "There is no password: whoever is in that network can read and command everything."
        ),
        show_default=False,
    ),
]
_OwnerOption = Annotated[
    int | None,
    typer.Option(
        metavar="PID",
        help=_("End when this process is gone and no program needs the master."),
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
            help=_("The port; else that of --master or NEP_MASTER, else 7780."),
            show_default=False,
        ),
    ] = None,
    listen: _ListenOption = None,
    owner_pid: _OwnerOption = None,
    gateway: Annotated[
        bool,
        typer.Option(
            "--gateway/--no-gateway", envvar="NEP_GATEWAY", help=_("Join programs of the original NEP.")
        ),
    ] = True,
) -> None:
    """Run the master: it knows who publishes and who subscribes. Ctrl+C ends it.

    Messages never pass through it; while it is away, programs that have found each other go on.
    """
    address = _address(master, port)
    with Terminal(sys.stderr) as terminal:  # one that takes nothing must not stop the master
        log_to(terminal, logging.WARNING)
        running = _started(address, owner_pid, terminal, joins_originals=gateway)
        try:
            running.listen(listen or ())
            _say_running(running.address, terminal, joins_originals=gateway)
            problem = collect.loopback_problem()
            if problem:
                say(
                    _(
                        "but programs of this computer cannot reach it: {problem}; 'nep doctor' says more"
                    ).format(problem=problem),
                    terminal,
                )
            _warn_of_others(running.address, listen or (), terminal)
            interrupts.leave_when_told()
            running.wait()
        finally:
            running.close()


def _started(address: str, owner_pid: int | None, terminal: Terminal, *, joins_originals: bool) -> Master:
    """Raises `NepError` with the reason why it can't be started."""
    allow_many()
    attachments: list[Attachment] = [AlertPrinter(terminal), AlertLog()]
    if joins_originals:
        attachments.insert(0, attachment.GatewayAttachment())
    try:
        return Master(address, attachments=attachments, owner_pid=owner_pid).start()
    except AddressInUseError as error:
        if is_running(address):
            raise NepError(
                _("a master already runs at '{address}'; use it, or choose another --port").format(
                    address=address
                )
            ) from error
        hindered = doctor.start_obstacle(address)
        if hindered is None:
            raise
        raise NepError(hindered.as_error) from error


def _address(master: str | None, port: int | None) -> str:
    address = master_address(master)
    if port is not None:
        address = f"{host_of(address)}:{port}"
    if not is_loopback(address):
        raise NepError(
            _(
                "a master answers at 127.0.0.1; use that and add --listen {host_of} for other computers"
            ).format(host_of=host_of(address))
        )
    return address


def _say_running(address: str, terminal: Terminal, *, joins_originals: bool) -> None:
    out = console(out=terminal)
    out.print(_("[bold green]●[/] master at [bold]{address}[/]").format(address=address))
    if joins_originals:
        out.print(_("  programs of the original NEP join it too"), style="dim")
    out.print(_("  Ctrl+C ends it"), style="dim")


def _warn_of_others(address: str, hosts: Sequence[str], terminal: Terminal) -> None:
    """Say that others can connect, and what they type."""
    out = console(out=terminal)
    port = address.rpartition(":")[2]
    chosen = [own.host for own in own_addresses()] if ANY in hosts else hosts
    for host in chosen:
        out.print(
            _("[bold yellow]●[/] other computers connect with [bold]NEP_MASTER={host}:{port}[/]").format(
                host=host, port=port
            )
        )
    if hosts:
        out.print(
            _("  whoever is in that network can read and command everything: no password"), style="yellow"
        )
