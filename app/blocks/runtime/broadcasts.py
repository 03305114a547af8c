"""Broadcasts: messages within a program, which start the scripts that receive them.

A script that is still running when its broadcast is sent again is restarted, as in Scratch. No locks are
needed, because only the script whose turn it is accesses the broadcasts (`app.blocks.runtime.scheduler`).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from app.blocks.runtime.scheduler import EndScript, Scheduler, Script


class Delivery:
    """Delivery of a broadcast to one script.

    Attributes:
        done: True after the script has run, or when it will not run for this broadcast.
    """

    def __init__(self, on_end: Callable[[], None]) -> None:
        self.done = False
        self._on_end = on_end

    def finish(self) -> None:
        """Mark the delivery as done: the script has run, or a newer delivery replaced this one."""
        if not self.done:
            self.done = True
            self._on_end()


class Receiver:
    """Script that receives a broadcast.

    Attributes:
        name: Name of the broadcast.
        script: Function to run.
        pending: Delivery that waits for the script, or None.
        scheduler_script: Script of the scheduler in which `serve` runs; None before.
    """

    def __init__(self, name: str, script: Callable[[], None]) -> None:
        self.name, self.script = name, script
        self.pending: Delivery | None = None
        self.scheduler_script: Script | None = None

    def serve(self, scheduler: Scheduler) -> None:
        """Run the script for each broadcast until the program ends."""
        self.scheduler_script = scheduler.current_script()
        while True:
            scheduler.wait_for(lambda: self.pending is not None, idle=True)
            delivery: Delivery | None = None
            try:
                with suppress(EndScript):
                    scheduler.start_run()
                    # Read after getting the turn: the broadcast may have been sent again meanwhile.
                    delivery, self.pending = self.pending, None
                    self.script()
            finally:
                if delivery is not None:
                    delivery.finish()
            scheduler.finish_run()
            scheduler.wake_scripts()


class Broadcasts:
    """Receivers of broadcasts in one program.

    Args:
        scheduler: Scheduler of the program.
        on_begin: Called when a delivery starts.
        on_end: Called when a delivery is done.
    """

    def __init__(
        self, scheduler: Scheduler, on_begin: Callable[[], None], on_end: Callable[[], None]
    ) -> None:
        self._scheduler, self._on_begin, self._on_end = scheduler, on_begin, on_end
        self.receivers: list[Receiver] = []

    def send(self, name: str) -> tuple[Delivery, ...]:
        """Start or restart every script that receives a broadcast, and return the deliveries.

        Args:
            name: Name of the broadcast.
        """
        return tuple(self._deliver(each) for each in self.receivers if each.name == name)

    def _deliver(self, receiver: Receiver) -> Delivery:
        self._on_begin()
        delivery = Delivery(self._on_end)
        if receiver.pending is not None:
            receiver.pending.finish()
        receiver.pending = delivery
        if receiver.scheduler_script is not None:
            self._scheduler.end_run(receiver.scheduler_script)
        self._scheduler.wake_scripts()
        return delivery
