"""Checks of masters, their ports, and the programs in the network."""

from __future__ import annotations

from collections.abc import Iterator

from nep.i18n import _, ngettext, number
from nep.programs.doctor.facts import Facts, ProcessFact
from nep.programs.doctor.finding import Finding, duration_text, with_process
from nep.system.addresses import host_of, is_loopback

SLOW_REPLY_S = 0.5
UNSUPPORTED_VERSIONS = ("0.5.4.6", "0.5.4.7")
_NATIVE_GENERATIONS = {"native", "gateway"}


def loopback_findings(facts: Facts) -> Iterator[Finding]:
    """Check that programs on this computer can reach each other."""
    if facts.loopback_problem:
        yield Finding(
            "loopback",
            "error",
            _("Programs on this computer can't reach each other: {problem}.").format(
                problem=facts.loopback_problem
            ),
            _("Turn on the loopback interface. A firewall or a sandbox may have turned it off."),
            command="ip link set lo up" if facts.platform == "linux" else "",
        )
    else:
        yield Finding("loopback", "ok", _("Programs on this computer can reach each other (127.0.0.1)."))


def master_findings(facts: Facts) -> Iterator[Finding]:
    """Check that exactly one master is running and replies."""
    port = facts.master_port
    holder = port.holder if port is not None else None
    if facts.view is not None:
        yield _running_finding(facts, holder)
        yield from _version_mismatch_findings(facts, holder)
    elif not facts.is_host_known:
        yield _unknown_host_finding(facts)
    elif facts.replying_address:
        yield _loopback_only_finding(facts)
    elif holder is not None and holder.is_master:
        yield _hung_finding(facts, holder)
    elif port is not None and port.is_taken:
        yield _port_taken_finding(facts, holder)
    elif facts.reach_failure is not None:
        yield _unreachable_finding(facts)
    elif not is_loopback(facts.address):
        yield _not_loopback_finding(facts)
    else:
        yield _not_running_finding(facts)
    yield from _multiple_masters_findings(facts)


def _unknown_host_finding(facts: Facts) -> Finding:
    return Finding(
        "master:unknown",
        "error",
        _("Can't find a computer named “{host}”, so the master can't be reached.").format(
            host=host_of(facts.address)
        ),
        _("Check the spelling, or use the IP address."),
    )


def _loopback_only_finding(facts: Facts) -> Finding:
    return Finding(
        "master:closed",
        "error",
        _("The master at {own} accepts only this computer, so it can't be reached at {address}.").format(
            own=facts.replying_address, address=facts.address
        ),
        _(
            "Allow other computers to connect in the settings of the Studio that started the master, "
            "or set NEP_MASTER to {own} for the programs on this computer."
        ).format(own=facts.replying_address),
    )


def _hung_finding(facts: Facts, holder: ProcessFact) -> Finding:
    return Finding(
        "master:hung",
        "error",
        _("The master at {master} doesn't reply; it is hung or suspended.").format(
            master=_master_text(facts, holder)
        ),
        _(
            "Stop the master and start a new one. Programs that are already connected keep exchanging "
            "messages."
        ),
        command=_kill_command(facts, holder),
    )


def _port_taken_finding(facts: Facts, holder: ProcessFact | None) -> Finding:
    port = facts.address.rpartition(":")[2]
    other = _other_port(port)
    return Finding(
        "master:foreign",
        "error",
        _("{program} uses port {number} but isn't a master.").format(
            number=port, program=_holder_text(holder)
        ),
        _(
            "Close that program, or start the master on port {other} and set "
            "NEP_MASTER=127.0.0.1:{other} for all programs."
        ).format(other=other),
        command=f"nep master --port {other}",
    )


def _not_running_finding(facts: Facts) -> Finding:
    port = facts.address.rpartition(":")[2]
    return Finding(
        "master:none",
        "error",
        _("No master is running at {address}, so new programs can't find each other.").format(
            address=facts.address
        ),
        _("Start a master."),
        command="nep master" if port == "7780" else f"nep master --port {port}",
    )


def _not_loopback_finding(facts: Facts) -> Finding:
    local_address = f"127.0.0.1:{facts.address.rpartition(':')[2]}"
    return Finding(
        "master:network",
        "error",
        _("No master is running at {address}. A new one will start at {own}, for this computer only.").format(
            address=facts.address, own=local_address
        ),
        _(
            "Set NEP_MASTER to {own} for the programs on this computer, and allow other computers to "
            "connect in the settings of Studio."
        ).format(own=local_address),
    )


def _unreachable_finding(facts: Facts) -> Finding:
    host, _colon, port = facts.address.rpartition(":")
    if facts.reach_failure == "timeout":
        message = _("{address} doesn't respond, so the master can't be reached.")
        fix = _(
            "{host} is off, is on another network, or has a firewall that blocks the connection. Allow "
            "NEP Studio (Python) in its firewall."
        )
    elif facts.reach_failure == "refused":
        message = _("{host} can be reached, but accepts no connections from other computers on port {port}.")
        fix = _("Start NEP Studio on that computer and allow other computers to connect in its settings.")
    elif facts.reach_failure:
        message = _("This computer has no route to {address}, so the master can't be reached.")
        fix = _("Check that both computers are on the same network.")
    else:
        message = _("{host} responds on port {port}, but the master doesn't.")
        fix = _(
            "NEP Studio isn't responding there, or another program uses that port. Restart NEP Studio "
            "on that computer."
        )
    fields = {"address": facts.address, "host": host, "port": port}
    return Finding("master:unreached", "error", message.format(**fields), fix.format(**fields))


def _running_finding(facts: Facts, holder: ProcessFact | None) -> Finding:
    view = facts.view
    counts_text = ""
    if view is not None:
        # skip nep's own topics that have only subscribers, such as log records
        topic_names = [
            name for name, info in view.topics.items() if info.publishers or not name.startswith("/nep/")
        ]
        nodes = ngettext("{count} node", "{count} nodes", len(view.nodes)).format(count=len(view.nodes))
        topics = ngettext("{count} topic", "{count} topics", len(topic_names)).format(count=len(topic_names))
        counts_text = f"{nodes}, {topics}"
    if holder is not None and holder.started_s is not None:
        uptime_text = duration_text(facts.now_s - holder.started_s)
        template = _("A master has been running at {master} for {since}: {people}")
    else:
        uptime_text = ""
        template = _("A master is running at {master}: {people}")
    message = template.format(master=_master_text(facts, holder), since=uptime_text, people=counts_text)
    if facts.reply_time_s is not None and facts.reply_time_s > SLOW_REPLY_S:
        return Finding(
            "master:slow",
            "warning",
            _("{sentence}. It took {seconds} s to reply.").format(
                sentence=message, seconds=number(facts.reply_time_s, ".1f")
            ),
            _("This computer is very busy. Check which program uses its processor."),
        )
    return Finding("master", "ok", f"{message}.")


def _version_mismatch_findings(facts: Facts, holder: ProcessFact | None) -> Iterator[Finding]:
    install, own_version = facts.master_install, facts.versions.get("NEP Studio", "")
    if install is None or holder is None or not own_version[:1].isdigit():
        return
    if install.version != own_version:
        template = _(
            "The master at {master} belongs to NEP Studio {version} ({place}); this is {own}. New "
            "features and fixes may not work with it."
        )
    elif holder.started_s is not None and holder.started_s < install.installed_s:
        template = _(
            "The master at {master} was started before NEP Studio {own} was installed, so it is an "
            "older version. New features and fixes may not work with it."
        )
    else:
        return
    yield Finding(
        "master:version",
        "warning",
        template.format(
            master=_master_text(facts, holder),
            version=install.version,
            place=install.location,
            own=own_version,
        ),
        _(
            "Stop that master. If Studio is open, it starts a new one; otherwise, run “nep master”. "
            "Programs that are already connected keep exchanging messages."
        ),
        command=_kill_command(facts, holder),
    )


def _kill_command(facts: Facts, holder: ProcessFact) -> str:
    return f"kill {holder.pid}" if facts.platform != "win32" else f"taskkill /F /PID {holder.pid}"


def _multiple_masters_findings(facts: Facts) -> Iterator[Finding]:
    if len(facts.masters) < 2:
        return
    addresses = ", ".join(
        (_("port {port} (process {pid})") if port else _("process {pid}")).format(port=port, pid=process.pid)
        for process, port in facts.masters
    )
    yield Finding(
        "master:several",
        "warning",
        _(
            "{count} masters are running on this computer: {places}. Programs connected to different "
            "masters can't see each other."
        ).format(count=len(facts.masters), places=addresses),
        _("Stop all but one, or set the same NEP_MASTER for every program."),
    )


def original_program_findings(facts: Facts) -> Iterator[Finding]:
    """Report programs of the original NEP, including versions that the gateway can't serve."""
    if facts.view is None:
        return
    nodes = [node for node in facts.view.nodes.values() if node.generation not in _NATIVE_GENERATIONS]
    for node in nodes:
        if node.generation in UNSUPPORTED_VERSIONS:
            yield unsupported_finding(f"original:{node.id}", node.name, node.generation)
    supported_nodes = [node for node in nodes if node.generation not in UNSUPPORTED_VERSIONS]
    if supported_nodes:
        names = ", ".join(f"{node.name} ({_wire_name(node.generation)})" for node in supported_nodes)
        template = ngettext(
            "{count} program of the original NEP: {names}.",
            "{count} programs of the original NEP: {names}.",
            len(supported_nodes),
        )
        yield Finding("originals", "info", template.format(count=len(supported_nodes), names=names))


def alert_findings(facts: Facts) -> Iterator[Finding]:
    """Report the alerts of the master, except those about ports, which `port_findings` checks."""
    if facts.view is None:
        return
    for alert in facts.view.alerts:
        if not alert.id.startswith("port:"):
            message = alert.sentence if alert.sentence.endswith(".") else f"{alert.sentence}."
            yield Finding(alert.id, "warning", message, alert.hint)


def remote_clock_findings(facts: Facts) -> Iterator[Finding]:
    """Report computers whose clocks are ahead of this computer's clock."""
    for clock in facts.clocks:
        yield Finding(
            f"clock:{clock.host}",
            "warning",
            _("The clock of {host} is {seconds} s ahead, so the ages of its messages are wrong.").format(
                host=clock.host, seconds=number(clock.ahead_s, ".1f")
            ),
            _("Turn on automatic time (NTP) on both computers."),
        )


def _wire_name(generation: str) -> str:
    return {"A": _("up to 0.5.4.5"), "B": "0.5.4.8"}.get(generation, generation)


def _master_text(facts: Facts, holder: ProcessFact | None) -> str:
    return with_process(facts.address, holder.pid if holder is not None else None)


def _holder_text(holder: ProcessFact | None) -> str:
    if holder is None:
        return _("An unknown program")
    return with_process(f"“{holder.name}”", holder.pid)


def _other_port(number: str) -> int:
    return int(number) + 1 if number.isdigit() and int(number) < 65535 else 7781


def unsupported_finding(finding_id: str, program: str, generation: str) -> Finding:
    """Return the finding for a program with an incompatible version of the original NEP.

    Args:
        finding_id: Id of the finding.
        program: Name of the program's node.
        generation: Version of the original NEP.
    """
    return Finding(
        finding_id,
        "error",
        _("“{program}” uses nep {generation}, which isn't compatible with any other version.").format(
            program=program, generation=generation
        ),
        _("Install nep 0.5.4.8 or 0.5.4.5 for this program."),
        command="pip install nep==0.5.4.8",
    )
