"""Time limits of the self-test in seconds; generous, so that slow computers pass too."""

from __future__ import annotations

STEP_TIMEOUTS_S: dict[str, float] = {
    "program": 120.0,
    "window": 60.0,
    "master": 60.0,
    "robot": 90.0,
    "behaviour": 30.0,
    "editor": 120.0,
    "run": 60.0,
    "moves": 60.0,
    "stop": 20.0,
    "picture": 30.0,
    "close": 60.0,
    "processes": 20.0,
}
"""Time limit of each step by its name in the report, in order."""
TOTAL_TIMEOUT_S = 480.0
"""Time limit of all steps together."""
GRACE_S = 10.0
"""Time between a time limit and the moment when the watchdog kills the process.

A window that still responds reports the failure itself within this time.
"""
EXIT_TIMEOUT_S = 30.0
"""Time that the process has to exit after the report was completed successfully."""
