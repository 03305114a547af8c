"""How long the self-test may take, in seconds: generous, because a slow computer is no failure."""

from __future__ import annotations

STEP_S: dict[str, float] = {
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
"""Each step, by its name in the report, in the order in which they are taken."""
ALL_S = 480.0
"""All steps together."""
GRACE_S = 10.0
"""How much later the watch ends the process: a window that still answers says itself what it lacks."""
END_S = 30.0
"""How long the process may take to end after the report says that all is well."""
