"""Conformance tester for client libraries of the native wire. See docs/wire-check.md.

`check` starts an adapter, a small program that executes requests with the client library, and simulates the
master and peers of that program.
"""

from nep.programs.conformance import rules as _rules  # noqa: F401 - importing them registers them
from nep.programs.conformance.adapter import Adapter, AdapterError, AdapterProcess, AdapterStreams
from nep.programs.conformance.check import Outcome, check, select_rules
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
    "select_rules",
]
