"""How Studio starts one of its own modules as a process, also where it is frozen into one program."""

from __future__ import annotations

import sys


def module_command(module: str) -> list[str]:
    """The command that runs one of our modules as a process of its own, also from a frozen build."""
    if getattr(sys, "frozen", False):
        return [sys.executable, "--module", module]
    return [sys.executable, "-m", module]
