"""Connection doctor: diagnoses why programs can't find each other and suggests fixes.

`collect_facts` inspects processes, ports, the master's graph and this Python; `findings` derives findings
from these facts alone. `diagnose` does both, optionally for a topic whose messages don't arrive
(`topic_findings`).
"""

from nep.programs.doctor.collect import collect_facts, start_obstacle
from nep.programs.doctor.diagnose import Tell, diagnose
from nep.programs.doctor.diagnosis import findings, in_order, report, to_plain, worst
from nep.programs.doctor.facts import Facts, TopicFacts
from nep.programs.doctor.finding import Finding, Severity
from nep.programs.doctor.listen import collect_topic
from nep.programs.doctor.topics import meant_topic, topic_findings

__all__ = [
    "Facts",
    "Finding",
    "Severity",
    "Tell",
    "TopicFacts",
    "collect_facts",
    "collect_topic",
    "diagnose",
    "findings",
    "in_order",
    "meant_topic",
    "report",
    "start_obstacle",
    "to_plain",
    "topic_findings",
    "worst",
]
