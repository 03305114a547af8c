"""Time limits of the self-test in seconds, long enough for slow computers."""

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
"""Time limit of each step, by name of the step in the report, in the order of execution."""
TOTAL_TIMEOUT_S = 480.0
"""Time limit of all steps together."""
GRACE_S = 10.0
"""Time between the end of a time limit and the moment at which the watchdog kills the process.

A window that still responds reports the failure itself within this time.
"""
EXIT_TIMEOUT_S = 30.0
"""Time limit for the process to exit after the test has succeeded."""
