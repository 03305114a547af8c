"""One look of the doctor: everything, and first of all the topic that somebody misses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from nep.programs.doctor.collect import collect_in_steps
from nep.programs.doctor.diagnosis import PARTS, in_order
from nep.programs.doctor.facts import Facts
from nep.programs.doctor.finding import Finding
from nep.programs.doctor.listen import collect_topic
from nep.programs.doctor.topics import topic_findings

__all__ = ["Tell", "look"]

Tell = Callable[[tuple[Finding, ...], int, int], object]
"""What is found so far, the worst first; how many things were looked at, of how many."""


def look(
    address: str | None = None,
    topic: str = "",
    folders: Sequence[tuple[str, Path]] = (),
    tell: Tell | None = None,
) -> tuple[Finding, ...]:
    """Everything that is found, the worst first; takes some seconds. `folders` as for `collect_facts`.

    What is found of `topic`, when there is one, stands before what is as bad, and in place of what is told
    under the same id in general. `tell` is called meanwhile, after each step.
    """
    found: dict[str, tuple[Finding, ...]] = {}
    facts: Facts | None = None
    count = len(PARTS) + bool(topic)
    for names, facts in collect_in_steps(address, folders=folders):
        found.update((name, tuple(PARTS[name](facts))) for name in names)
        if tell is not None:
            tell(_all(found), len(found), count)
    missed = collect_topic(topic, address) if topic and facts is not None and facts.view is not None else None
    result = _all(found, topic_findings(missed) if missed is not None else ())
    if tell is not None:
        tell(result, count, count)
    return result


def _all(found: dict[str, tuple[Finding, ...]], about: Sequence[Finding] = ()) -> tuple[Finding, ...]:
    told = {each.id for each in about}
    general = [each for name in PARTS for each in found.get(name, ()) if each.id not in told]
    return in_order([*about, *general])
