"""Connection doctor: diagnoses why programs can't find each other and suggests fixes.

`collect_facts` inspects processes, ports, the master's graph and this Python; `findings` derives findings
from these facts. `diagnose` does both, optionally for a topic whose messages don't arrive (`topic_findings`).
"""

from nep.programs.doctor.collect import collect_facts, start_blocker
from nep.programs.doctor.diagnose import ProgressCallback, diagnose
from nep.programs.doctor.diagnosis import exit_code, findings, report_text, sort_findings, to_plain
from nep.programs.doctor.facts import Facts, TopicFacts
from nep.programs.doctor.finding import Finding, Severity
from nep.programs.doctor.listen import collect_topic
from nep.programs.doctor.topics import closest_topic, topic_findings

__all__ = [
    "Facts",
    "Finding",
    "ProgressCallback",
    "Severity",
    "TopicFacts",
    "closest_topic",
    "collect_facts",
    "collect_topic",
    "diagnose",
    "exit_code",
    "findings",
    "report_text",
    "sort_findings",
    "start_blocker",
    "to_plain",
    "topic_findings",
]
