"""The connection doctor: why programs do not find each other, and what to do about it.

`gather` collects facts (processes, ports, the master's graph, this Python); `findings` judges them and is a
function of the facts alone.
"""

from nep.doctor.collect import gather, hindrance
from nep.doctor.facts import Facts
from nep.doctor.judge import findings, report, to_plain, worst
from nep.doctor.verdict import Finding, Severity

__all__ = ["Facts", "Finding", "Severity", "findings", "gather", "hindrance", "report", "to_plain", "worst"]
