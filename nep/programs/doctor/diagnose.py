"""`diagnose`: complete diagnosis, optionally for one topic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from nep.programs.doctor.collect import collect_in_steps
from nep.programs.doctor.diagnosis import CHECKS, sort_findings
from nep.programs.doctor.facts import Facts
from nep.programs.doctor.finding import Finding
from nep.programs.doctor.listen import collect_topic
from nep.programs.doctor.topics import topic_findings

ProgressCallback = Callable[[tuple[Finding, ...], int, int], object]
"""Progress callback.

The arguments are the findings so far (worst first), the number of completed checks, and the number of
all checks.
"""


def diagnose(
    address: str | None = None,
    topic: str = "",
    folders: Sequence[tuple[str, Path]] = (),
    on_progress: ProgressCallback | None = None,
) -> tuple[Finding, ...]:
    """Run all checks and return the findings, worst first. Takes some seconds.

    Args:
        address: Address of the master (default: NEP_MASTER or the default address).
        topic: Topic whose messages don't arrive; "" for none. Its findings come first among the
            findings of the same severity, and replace general findings with the same id.
        folders: Further folders that must be writable, as (purpose, path).
        on_progress: Called after each step with the findings so far, the number of completed checks and
            the number of all checks.
    """
    findings_by_check: dict[str, tuple[Finding, ...]] = {}
    facts: Facts | None = None
    check_count = len(CHECKS) + bool(topic)
    for names, facts in collect_in_steps(address, folders=folders):
        findings_by_check.update((name, tuple(CHECKS[name](facts))) for name in names)
        if on_progress is not None:
            on_progress(_merge_findings(findings_by_check), len(findings_by_check), check_count)
    topic_facts = (
        collect_topic(topic, address) if topic and facts is not None and facts.view is not None else None
    )
    result = _merge_findings(
        findings_by_check, topic_findings(topic_facts) if topic_facts is not None else ()
    )
    if on_progress is not None:
        on_progress(result, check_count, check_count)
    return result


def _merge_findings(
    findings_by_check: dict[str, tuple[Finding, ...]], about_topic: Sequence[Finding] = ()
) -> tuple[Finding, ...]:
    topic_ids = {each.id for each in about_topic}
    general = [
        each for name in CHECKS for each in findings_by_check.get(name, ()) if each.id not in topic_ids
    ]
    return sort_findings([*about_topic, *general])
