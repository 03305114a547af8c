"""Alarms in plain words: "when /robot/camera is silent for 2 s, show a banner".

`rule` has what an alarm is told, `rule_file` reads and writes it, `sentences` say it. `evaluator` looks at
messages and at the graph and tells what came on and went off; `alarms` does what is to be done then and keeps
the `history`; `commands` calls services and sends. `nep watch` and Studio are made of these.
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
