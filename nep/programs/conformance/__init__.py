"""The conformance tester: judges a client of the native wire, rule by rule. See docs/wire-check.md.

`check` starts an adapter, a small program that does with the client's library what it is told, and plays
master and peers for it.
"""

from nep.programs.conformance import rules as _rules  # noqa: F401 - importing them registers them
from nep.programs.conformance.adapter import Adapter, AdapterError, AdapterProcess, AdapterStreams
from nep.programs.conformance.check import Outcome, check, chosen_rules
from nep.programs.conformance.rule import RULES, Rule

__all__ = [
    "RULES",
    "Adapter",
    "AdapterError",
    "AdapterProcess",
    "AdapterStreams",
    "Outcome",
    "Rule",
    "check",
    "chosen_rules",
]
