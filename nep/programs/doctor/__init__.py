"""The connection doctor: why programs do not find each other, and what to do about it.

`collect_facts` looks at processes, ports, the master's graph and this Python; `findings` judges these facts,
and is a function of them alone.
"""

from nep.programs.doctor.collect import collect_facts, start_obstacle
from nep.programs.doctor.diagnosis import findings, report, to_plain, worst
from nep.programs.doctor.facts import Facts
from nep.programs.doctor.finding import Finding, Severity

__all__ = [
    "Facts",
    "Finding",
    "Severity",
    "collect_facts",
    "findings",
    "report",
    "start_obstacle",
    "to_plain",
    "worst",
]
