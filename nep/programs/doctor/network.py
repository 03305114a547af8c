"""Part of the diagnosis about masters, their ports and the programs in the network."""

from __future__ import annotations

from collections.abc import Iterator

from nep.i18n import _, ngettext, number
from nep.programs.doctor.facts import Facts, ProcessFact
from nep.programs.doctor.finding import Finding, ago, with_process
from nep.system.addresses import host_of, is_loopback

__all__ = ["clocks", "loopback", "master_alerts", "masters", "originals"]

SLOW_S = 0.5
NOT_SERVED = ("0.5.4.6", "0.5.4.7")
_NATIVE = {"native", "gateway"}


def loopback(facts: Facts) -> Iterator[Finding]:
    """Check whether programs of this computer can reach each other."""
    if facts.loopback:
        yield Finding(
            "loopback",
            "error",
            _("Programs of this computer cannot reach each other: {problem}.").format(problem=facts.loopback),
            _("Switch the loopback interface on; a firewall or a sandbox may have switched it off."),
            command="ip link set lo up" if facts.platform == "linux" else "",
        )
    else:
        yield Finding("loopback", "ok", _("Programs of this computer can reach each other (127.0.0.1)."))


def masters(facts: Facts) -> Iterator[Finding]:
    """Check whether exactly one master is running and replies."""
    port = facts.master_port
    holder = port.holder if port is not None else None
    if facts.view is not None:
        yield _running(facts, holder)
        yield from _version_mismatch(facts, holder)
    elif not facts.is_known:
        yield _unknown_host(facts)
    elif facts.answers_at:
        yield _loopback_only(facts)
    elif holder is not None and holder.is_master:
        yield _hung(facts, holder)
    elif port is not None and port.is_taken:
        yield _port_taken(facts, holder)
    elif facts.reach is not None:
        yield _unreached(facts)
    elif not is_loopback(facts.address):
        yield _not_loopback(facts)
    else:
        yield _not_running(facts)
    yield from _multiple_masters(facts)


def _unknown_host(facts: Facts) -> Finding:
    return Finding(
        "master:unknown",
        "error",
        _("No computer is called “{host}” here, so no master is found.").format(host=host_of(facts.address)),
        _("Look for a typing error, or write its address in numbers."),
    )


def _loopback_only(facts: Facts) -> Finding:
    return Finding(
        "master:closed",
        "error",
        _("The master at {own} serves this computer only, so nobody reaches it at {address}.").format(
            own=facts.answers_at, address=facts.address
        ),
        _(
            "Let other computers connect, in the settings of the Studio that started it, or use {own} in "
            "programs of this computer (NEP_MASTER)."
        ).format(own=facts.answers_at),
    )


def _hung(facts: Facts, holder: ProcessFact) -> Finding:
    return Finding(
        "master:hung",
        "error",
        _("The master at {master} does not answer; it hangs or is halted.").format(
            master=_master(facts, holder)
        ),
        _("End it and start a new one; programs that have found each other go on meanwhile."),
        command=_kill(facts, holder),
    )


def _port_taken(facts: Facts, holder: ProcessFact | None) -> Finding:
    number = facts.address.rpartition(":")[2]
    other = _other_port(number)
    return Finding(
        "master:foreign",
        "error",
        _("Port {number} is held by {program}, which is no master.").format(
            number=number, program=_holder_text(holder)
        ),
        _(
            "End that program, or start the master on port {other} and tell it to all programs "
            "(NEP_MASTER=127.0.0.1:{other})."
        ).format(other=other),
        command=f"nep master --port {other}",
    )


def _not_running(facts: Facts) -> Finding:
    number = facts.address.rpartition(":")[2]
    return Finding(
        "master:none",
        "error",
        _("No master runs at {address}, so new programs cannot find each other.").format(
            address=facts.address
        ),
        _("Start one."),
        command="nep master" if number == "7780" else f"nep master --port {number}",
    )


def _not_loopback(facts: Facts) -> Finding:
    own = f"127.0.0.1:{facts.address.rpartition(':')[2]}"
    return Finding(
        "master:network",
        "error",
        _("No master runs at {address}: one begins at {own}, for this computer.").format(
            address=facts.address, own=own
        ),
        _(
            "Use {own} in programs of this computer (NEP_MASTER), and let other computers connect in the "
            "settings of Studio."
        ).format(own=own),
    )


def _unreached(facts: Facts) -> Finding:
    host, _colon, port = facts.address.rpartition(":")
    if facts.reach == "timeout":
        sentence = _("Nothing answers at {address}, so no master is found.")
        fix = _(
            "{host} is switched off, in another network, or its firewall keeps programs out. Let NEP Studio "
            "(Python) through the firewall there."
        )
    elif facts.reach == "refused":
        sentence = _("{host} is there, but nobody listens at its port {port} for other computers.")
        fix = _("Start NEP Studio on that computer, and let other computers connect in its settings.")
    elif facts.reach:
        sentence = _("There is no way to {address}, so no master is found.")
        fix = _("Look whether both computers are in the same network.")
    else:
        sentence = _("{host} answers at port {port}, but no master does.")
        fix = _("It hangs, or another program holds that port. Start NEP Studio anew on that computer.")
    holes = {"address": facts.address, "host": host, "port": port}
    return Finding("master:unreached", "error", sentence.format(**holes), fix.format(**holes))


def _running(facts: Facts, holder: ProcessFact | None) -> Finding:
    view = facts.view
    people = ""
    if view is not None:
        # skip nep's own topics that have only subscribers, such as log records
        live = [name for name, info in view.topics.items() if info.publishers or not name.startswith("/nep/")]
        nodes = ngettext("{count} node", "{count} nodes", len(view.nodes)).format(count=len(view.nodes))
        topics = ngettext("{count} topic", "{count} topics", len(live)).format(count=len(live))
        people = f"{nodes}, {topics}"
    if holder is not None and holder.since_s is not None:
        since = ago(facts.now_s - holder.since_s)
        words = _("A master runs at {master} for {since}: {people}")
    else:
        since = ""
        words = _("A master runs at {master}: {people}")
    sentence = words.format(master=_master(facts, holder), since=since, people=people)
    if facts.answered_s is not None and facts.answered_s > SLOW_S:
        return Finding(
            "master:slow",
            "warning",
            _("{sentence}. It took {seconds} s to answer.").format(
                sentence=sentence, seconds=number(facts.answered_s, ".1f")
            ),
            _("This computer is very busy; look for the program that is."),
        )
    return Finding("master", "ok", f"{sentence}.")


def _version_mismatch(facts: Facts, holder: ProcessFact | None) -> Iterator[Finding]:
    install, own = facts.master_install, facts.versions.get("NEP Studio", "")
    if install is None or holder is None or not own[:1].isdigit():
        return
    if install.version != own:
        words = _(
            "The master at {master} is of NEP Studio {version} ({place}); this is {own}. "
            "What is new or mended may not work with it."
        )
    elif holder.since_s is not None and holder.since_s < install.since_s:
        words = _(
            "The master at {master} has run since before NEP Studio {own} was installed, so it is of the one "
            "before. What is new or mended may not work with it."
        )
    else:
        return
    yield Finding(
        "master:version",
        "warning",
        words.format(master=_master(facts, holder), version=install.version, place=install.place, own=own),
        _(
            "End it: an open Studio starts a new one, else type “nep master”. Programs that have "
            "found each other go on."
        ),
        command=_kill(facts, holder),
    )


def _kill(facts: Facts, holder: ProcessFact) -> str:
    return f"kill {holder.pid}" if facts.platform != "win32" else f"taskkill /F /PID {holder.pid}"


def _multiple_masters(facts: Facts) -> Iterator[Finding]:
    if len(facts.masters) < 2:
        return
    places = ", ".join(
        (_("port {port} (process {pid})") if port else _("process {pid}")).format(port=port, pid=process.pid)
        for process, port in facts.masters
    )
    yield Finding(
        "master:several",
        "warning",
        _(
            "{count} masters run on this computer: {places}. Programs of one don't see those of the other."
        ).format(count=len(facts.masters), places=places),
        _("End all but one, or give every program the same NEP_MASTER."),
    )


def originals(facts: Facts) -> Iterator[Finding]:
    """Report programs of the original NEP, and those that can't be served."""
    if facts.view is None:
        return
    nodes = [node for node in facts.view.nodes.values() if node.generation not in _NATIVE]
    for node in nodes:
        if node.generation in NOT_SERVED:
            yield not_served(f"original:{node.id}", node.name, node.generation)
    served = [node for node in nodes if node.generation not in NOT_SERVED]
    if served:
        names = ", ".join(f"{node.name} ({_wire(node.generation)})" for node in served)
        words = ngettext(
            "{count} program of the original NEP: {names}.",
            "{count} programs of the original NEP: {names}.",
            len(served),
        )
        yield Finding("originals", "info", words.format(count=len(served), names=names))


def master_alerts(facts: Facts) -> Iterator[Finding]:
    """Report the master's alerts, except those about ports, which are checked here."""
    if facts.view is None:
        return
    for alert in facts.view.alerts:
        if not alert.id.startswith("port:"):
            sentence = alert.sentence if alert.sentence.endswith(".") else f"{alert.sentence}."
            yield Finding(alert.id, "warning", sentence, alert.hint)


def clocks(facts: Facts) -> Iterator[Finding]:
    """Report computers whose clocks are ahead of this one's."""
    for clock in facts.clocks:
        yield Finding(
            f"clock:{clock.host}",
            "warning",
            _("The clock of {host} is {seconds} s ahead, so ages of its messages are wrong.").format(
                host=clock.host, seconds=number(clock.ahead_s, ".1f")
            ),
            _("Let both computers set their clocks by the network."),
        )


def _wire(generation: str) -> str:
    return {"A": _("up to 0.5.4.5"), "B": "0.5.4.8"}.get(generation, generation)


def _master(facts: Facts, holder: ProcessFact | None) -> str:
    return with_process(facts.address, holder.pid if holder is not None else None)


def _holder_text(holder: ProcessFact | None) -> str:
    if holder is None:
        return _("a program that the system does not name")
    return with_process(f"“{holder.name}”", holder.pid)


def _other_port(number: str) -> int:
    return int(number) + 1 if number.isdigit() and int(number) < 65535 else 7781


def not_served(finding_id: str, program: str, generation: str) -> Finding:
    """Return the finding for a program with an incompatible version of the original NEP."""
    return Finding(
        finding_id,
        "error",
        _("“{program}” uses nep {generation}, which no other version understands.").format(
            program=program, generation=generation
        ),
        _("Install 0.5.4.8 or 0.5.4.5 for this program."),
        command="pip install nep==0.5.4.8",
    )
