"""Alarms: rules that run actions when a condition on messages, nodes or rates becomes true.

An example of a rule is "when /robot/camera is silent for 2 s, show a banner". `rule` defines rules,
`rule_file` reads and writes them, and `sentences` formats them. `evaluator` evaluates rules against messages,
the graph and time; `alarms` runs the actions and records the `history`; `commands` calls services and
publishes. The package is used by `nep watch` and Studio.
"""

from nep.programs.alarms.alarms import Alarms
from nep.programs.alarms.evaluator import AlarmEvaluator, AlarmEvent, AlarmState
from nep.programs.alarms.rule import AlarmAction, AlarmCondition, AlarmRule
from nep.programs.alarms.rule_file import AlarmFile, read_alarms

__all__ = [
    "AlarmAction",
    "AlarmCondition",
    "AlarmEvaluator",
    "AlarmEvent",
    "AlarmFile",
    "AlarmRule",
    "AlarmState",
    "Alarms",
    "read_alarms",
]
