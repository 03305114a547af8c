"""The connection doctor: why programs do not find each other, and what to do about it.

`collect_facts` looks at processes, ports, the master's graph and this Python; `findings` judges these facts,
and is a function of them alone. `look` does both, also about a topic that somebody misses (`topic_findings`).
"""

from nep.programs.doctor.collect import collect_facts, start_obstacle
from nep.programs.doctor.diagnosis import findings, in_order, report, to_plain, worst
from nep.programs.doctor.facts import Facts, TopicFacts
from nep.programs.doctor.finding import Finding, Severity
from nep.programs.doctor.listen import collect_topic
from nep.programs.doctor.look import Tell, look
from nep.programs.doctor.topics import meant_topic, topic_findings

__all__ = [
    "Facts",
    "Finding",
    "Severity",
    "Tell",
    "TopicFacts",
    "collect_facts",
    "collect_topic",
    "findings",
    "in_order",
    "look",
    "meant_topic",
    "report",
    "start_obstacle",
    "to_plain",
    "topic_findings",
    "worst",
]
