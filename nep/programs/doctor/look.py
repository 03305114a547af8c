"""One look of the doctor: everything, and first of all the topic that somebody misses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from nep.programs.doctor.collect import collect_facts
from nep.programs.doctor.diagnosis import findings, in_order
from nep.programs.doctor.finding import Finding
from nep.programs.doctor.listen import collect_topic
from nep.programs.doctor.topics import topic_findings

__all__ = ["look"]


def look(
    address: str | None = None, topic: str = "", folders: Sequence[tuple[str, Path]] = ()
) -> tuple[Finding, ...]:
    """Everything that is found, the worst first; takes some seconds. `folders` as for `collect_facts`.

    What is found of `topic`, when there is one, stands before what is as bad, and in place of what is told
    under the same id in general.
    """
    facts = collect_facts(address, folders=folders)
    missed = collect_topic(topic, address) if topic and facts.view is not None else None
    about = topic_findings(missed) if missed is not None else ()
    told = {each.id for each in about}
    return in_order([*about, *(each for each in findings(facts) if each.id not in told)])
