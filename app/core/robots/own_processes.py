"""Which programs on the network are virtual robots of this person, by their processes on this computer."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Collection
from contextlib import suppress

from app.robots.identity import Identity

RUNS_MODULE = ("-m", "--module")
MOST_KNOWN = 1000


class Processes:
    """Looks at processes of this computer. One thread uses it; what was found out about one is kept."""

    def __init__(self, modules: Collection[str], started: Callable[[], Collection[int]] = tuple) -> None:
        """``modules`` are those of our virtual robots, ``started`` the ids of processes started here."""
        self._modules = frozenset(modules)
        self._started = started
        self._known: dict[Identity, bool] = {}

    def is_ours(self, identity: Identity) -> bool:
        """Whether this program is a virtual robot that this Studio started, or another of this person.

        That is this process or one that was started here (or its child, as a frozen build makes one), or a
        process of the same user on this computer that runs the module of one of our virtual robots.
        """
        if identity.pid is None or identity.host != platform.node():
            return False
        if identity.pid == os.getpid():
            return True
        if identity not in self._known:
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            self._known[identity] = self._look(identity.pid)
        return self._known[identity]

    def has_ended(self, identity: Identity) -> bool:
        """Whether it is sure that this program runs no more; never of one on another computer."""
        if identity.pid is None or identity.host != platform.node():
            return False
        import psutil  # noqa: PLC0415 (heavy: the window shows before there is a robot)

        with suppress(psutil.Error):
            return psutil.Process(identity.pid).status() == psutil.STATUS_ZOMBIE
        return not psutil.pid_exists(identity.pid)

    def _look(self, pid: int) -> bool:
        import psutil  # noqa: PLC0415 (heavy, see above)

        started = set(self._started())
        try:
            process = psutil.Process(pid)
            if pid in started or any(parent.pid in started for parent in process.parents()):
                return True
            return process.username() == psutil.Process().username() and self._is_virtual(process.cmdline())
        except psutil.Error:
            return False

    def _is_virtual(self, command: list[str]) -> bool:
        """Whether a command runs one of the modules; what stands behind other words is no option."""
        return len(command) > 2 and command[1] in RUNS_MODULE and command[2] in self._modules
