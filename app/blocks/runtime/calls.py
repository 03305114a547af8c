"""Functions while they run: how deep they call each other, and where the script is after one of them."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.scheduler import Scheduler, Stopped
from nep.i18n import _

MOST_DEEP = 200
_FRAMES = 6000  # Python's own limit: a call of ours with its values takes up to a dozen of its calls


class EndScript(Stopped):
    """Raised by "stop this script" inside a function: the script ends, the others go on."""


def stop_script() -> None:
    """End the script from inside a function."""
    raise EndScript


class Calls:
    """Runs the functions of one program."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._mine = threading.local()

    def begin(self) -> None:
        """Let Python go as deep as functions may; for the whole process, which is the program's."""
        sys.setrecursionlimit(max(sys.getrecursionlimit(), _FRAMES))

    def run(self, block: str, name: str, call: Callable[[], object]) -> object:
        """Call; BehaviourError when functions call each other too deep."""
        depth = int(getattr(self._mine, "depth", 0))
        if depth >= MOST_DEEP:
            raise BehaviourError(
                _("“{name}” uses itself more than {count} times, one inside the other.").format(
                    name=name, count=MOST_DEEP
                ),
                block,
            )
        self._mine.depth = depth + 1
        before = self._scheduler.block()
        try:
            result = call()
        finally:
            self._mine.depth = depth
        self._scheduler.return_to(before)
        return result
