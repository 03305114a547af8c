"""Checks of the fixed ports of the original NEP."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from nep.i18n import _, format_list, ngettext
from nep.programs.doctor.facts import Facts, PortFact, ProcessFact
from nep.programs.doctor.finding import Finding, with_process

KILL_PORT = 12345
AIRPLAY_PORT = 7000
_AIRPLAY_PROCESSES = ("ControlCe", "AirPlay", "rapportd")


def port_findings(facts: Facts) -> Iterator[Finding]:
    """Report the use of the ports to which programs of the original NEP connect."""
    if not facts.is_gateway_enabled:
        yield Finding(
            "ports",
            "info",
            _("Programs of the original NEP can't connect because the gateway is off (NEP_GATEWAY=0)."),
        )
        return
    checked_ports = [port for port in facts.ports if port.port != KILL_PORT]
    own_ports = [port for port in checked_ports if port.is_taken and _belongs_to_master(facts, port)]
    conflicts = [port for port in checked_ports if port.is_taken and port not in own_ports]
    airplay_ports = [port for port in conflicts if _is_airplay(facts, port)]
    yield from map(_airplay_finding, airplay_ports)
    yield from _taken_findings([port for port in conflicts if port not in airplay_ports])
    yield from _free_findings(
        [port for port in checked_ports if not port.is_taken and facts.view is not None]
    )
    if own_ports:
        template = ngettext(
            "The master uses port {ports}, which programs of the original NEP connect to.",
            "The master uses ports {ports}, which programs of the original NEP connect to.",
            len(own_ports),
        )
        yield Finding("ports", "ok", template.format(ports=_port_list(own_ports)))
    yield from (_kill_port_finding(port) for port in facts.ports if port.port == KILL_PORT and port.is_taken)


def _belongs_to_master(facts: Facts, port: PortFact) -> bool:
    view, master_port = facts.view, facts.master_port
    if master_port is None or (
        view is not None and any(each.id == f"port:{port.port}" for each in view.alerts)
    ):
        return False
    if port.holder is not None and master_port.holder is not None:
        return port.holder.pid == master_port.holder.pid
    # no process is reported: a master with a gateway and without a port alert holds its ports
    return view is not None and any(node.generation == "gateway" for node in view.nodes.values())


def _is_airplay(facts: Facts, port: PortFact) -> bool:
    name = port.holder.name if port.holder is not None else ""
    is_airplay_port = facts.platform == "darwin" and port.port == AIRPLAY_PORT
    return is_airplay_port and (not name or name.startswith(_AIRPLAY_PROCESSES))


def _airplay_finding(port: PortFact) -> Finding:
    return Finding(
        "ports:airplay",
        "warning",
        _("The AirPlay Receiver uses port 7000, {purpose}.").format(purpose=_(port.purpose)),
        _("Turn off AirPlay Receiver in System Settings, under General > AirDrop & Handoff."),
    )


def _taken_findings(ports: Sequence[PortFact]) -> Iterator[Finding]:
    if not ports:
        return
    holder_texts = [_holder_text(port.holder) for port in ports]
    if len(ports) == 1:
        message = _("Port {port}, {purpose}, is in use by {program}.").format(
            port=ports[0].port, purpose=_(ports[0].purpose), program=holder_texts[0]
        )
    elif len(set(holder_texts)) == 1:
        message = _(
            "Ports {ports}, which programs of the original NEP need, are in use by {program}."
        ).format(ports=_port_list(ports), program=holder_texts[0])
    else:
        each = [
            _("{port} ({program})").format(port=port.port, program=holder_text)
            for port, holder_text in zip(ports, holder_texts, strict=True)
        ]
        message = _("Ports that programs of the original NEP need are in use: {each}.").format(
            each=format_list(each)
        )
    yield Finding(
        "ports:taken",
        "warning",
        message,
        _("Close that program to let programs of the original NEP connect. Nothing else needs these ports."),
    )


def _free_findings(ports: Sequence[PortFact]) -> Iterator[Finding]:
    if ports:
        template = ngettext(
            "The gateway for programs of the original NEP isn't running: port {ports} isn't in use.",
            "The gateway for programs of the original NEP isn't running: ports {ports} aren't in use.",
            len(ports),
        )
        reason = _("The master was started without its gateway.")
        yield Finding("ports:free", "info", template.format(ports=_port_list(ports)), reason)


def _kill_port_finding(port: PortFact) -> Finding:
    return Finding(
        f"port:{KILL_PORT}",
        "info",
        _(
            "Port 12345, where programs of the original NEP listen for the shutdown message, is in use by "
            "{program}."
        ).format(program=_holder_text(port.holder)),
    )


def _port_list(ports: Sequence[PortFact]) -> str:
    return format_list([str(port.port) for port in ports])


def _holder_text(holder: ProcessFact | None) -> str:
    if holder is None:
        return _("another program")
    return with_process(_("another master") if holder.is_master else f"“{holder.name}”", holder.pid)
