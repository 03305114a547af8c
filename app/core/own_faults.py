"""Studio's own faults: one alert while there is any, cured when what failed goes well again."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from app.core.alerts import Alerts
from app.core.faults import words_of

ALERT = "studio"
WELL_S = 5.0
"""So long must what failed have gone well: what fails now and then must not make the banner flicker."""
OVER_S = 60.0
"""What is not tried again (an event that came once) is over after so long; the log has it."""
MOST = 100

_log = logging.getLogger("studio")


@dataclass(slots=True)
class _Fault:
    """One thing that failed: what was said, when it last failed, whether it has gone well since."""

    said: str
    last_s: float
    is_well: bool = False


class OwnFaults:
    """What Studio could not do. One thread uses it (the window's)."""

    def __init__(self, alerts: Alerts, clock: Callable[[], float]) -> None:
        """``clock`` gives monotonic seconds."""
        self._alerts, self._clock = alerts, clock
        self._faults: dict[str, _Fault] = {}

    @contextmanager
    def surviving(self, what: str) -> Iterator[None]:
        """One thing: when it raises, the log and an alert say so, and the next has its turn.

        ``what`` completes the sentence "can't ...".
        """
        try:
            yield
        except Exception as error:  # noqa: BLE001  whatever it is: what comes after must still arrive
            _log.exception("can't %s", what)
            self._failed(what, f"It can't {what}: {words_of(error)}")
        else:
            if self._faults and what in self._faults:
                self._faults[what].is_well = True

    def check(self) -> None:
        """Once a second: forget what is over; without any fault the alert is cured."""
        now = self._clock()
        over = [
            what
            for what, fault in self._faults.items()
            if now - fault.last_s >= (WELL_S if fault.is_well else OVER_S)
        ]
        for what in over:
            del self._faults[what]
        if over and not self._faults:
            self._alerts.cure(ALERT)
        elif over:
            self._tell(next(iter(self._faults.values())), count=0)

    def _failed(self, what: str, said: str) -> None:
        is_new = what not in self._faults
        while is_new and len(self._faults) >= MOST:
            del self._faults[next(iter(self._faults))]
        self._faults[what] = _Fault(said, self._clock())
        if not self._alerts.has(ALERT):
            self._tell(self._faults[what], count=1)  # of others and of how often the log tells

    def _tell(self, fault: _Fault, *, count: int) -> None:
        title = "Studio has a fault and may show old values."
        self._alerts.put(
            ALERT, "error", title, fault.said, button="Show the log", action="help.log", count=count
        )
