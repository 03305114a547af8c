"""Broadcasts: a message of a program to itself, which starts the scripts that receive its name.

A script that still runs when its message comes again begins anew, as in Scratch. All of this is done by the
script that has the turn (`app.blocks.runtime.scheduler`), so nothing here needs a lock.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from app.blocks.runtime.scheduler import EndScript, Scheduler, Script


class Delivery:
    """One message on its way to one script; `done` when the script has run for it, or never will."""

    def __init__(self, over: Callable[[], None]) -> None:
        self.done = False
        self._over = over

    def end(self) -> None:
        """It has had its effect, or another one took its place."""
        if not self.done:
            self.done = True
            self._over()


class Receiver:
    """A script that receives a name: what waits for it."""

    def __init__(self, name: str, script: Callable[[], None]) -> None:
        self.name, self.script = name, script
        self.waiting: Delivery | None = None
        self.runs_in: Script | None = None

    def serve(self, scheduler: Scheduler) -> None:
        """Run the script for each message that comes; only the program's end ends this."""
        self.runs_in = scheduler.me()
        while True:
            scheduler.wait_for(lambda: self.waiting is not None, idle=True)
            taken: Delivery | None = None
            try:
                with suppress(EndScript):
                    scheduler.begin()
                    # Now that it has the turn: the same message may have come again while it waited for it.
                    taken, self.waiting = self.waiting, None
                    self.script()
            finally:
                if taken is not None:
                    taken.end()
            scheduler.rest()
            scheduler.poke()


class Broadcasts:
    """The receivers of one program."""

    def __init__(self, scheduler: Scheduler, began: Callable[[], None], over: Callable[[], None]) -> None:
        """`began` and `over` are called for each message that is on its way to a script."""
        self._scheduler, self._began, self._over = scheduler, began, over
        self.receivers: list[Receiver] = []

    def send(self, name: str) -> tuple[Delivery, ...]:
        """Start every script that receives the name, or start it anew; how far they are."""
        return tuple(self._deliver(each) for each in self.receivers if each.name == name)

    def _deliver(self, receiver: Receiver) -> Delivery:
        self._began()
        delivery = Delivery(self._over)
        if receiver.waiting is not None:
            receiver.waiting.end()
        receiver.waiting = delivery
        if receiver.runs_in is not None:
            self._scheduler.end_run(receiver.runs_in)
        self._scheduler.poke()
        return delivery
