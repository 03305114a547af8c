"""Active alerts, each with an id, a sentence and a next step. Alerts are removed when resolved."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

SEVERITIES = ("error", "warn", "info")


@dataclass(frozen=True, slots=True)
class ActiveAlert:
    """One active problem.

    Attributes:
        title: The problem, in one sentence.
        detail: What the problem means.
        button: Label of the button for the next step.
        action: Name of the window command that the button runs.
        since_s: Time of the first occurrence, on the clock given to `Alerts`.
        count: Number of occurrences since the alert was last resolved.
        for_developers: True if only the Developer layout shows the alert.
    """

    id: str
    severity: str
    title: str
    detail: str
    button: str | None
    action: str | None
    since_s: float
    count: int
    for_developers: bool = False


class Alerts:
    """Active alerts, worst first. Not thread-safe: use it from the window's thread."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._alerts: dict[str, ActiveAlert] = {}
        self._dismissed: set[str] = set()
        self._sorted: tuple[ActiveAlert, ...] | None = ()
        self.revision = 0

    @property
    def active(self) -> Sequence[ActiveAlert]:
        """All active alerts: errors, then warnings, then infos; the oldest first within a severity."""
        if self._sorted is None:
            order = {severity: place for place, severity in enumerate(SEVERITIES)}
            self._sorted = tuple(
                sorted(self._alerts.values(), key=lambda alert: (order[alert.severity], alert.since_s))
            )
        return self._sorted

    def errors_and_warnings(self, *, for_developers: bool = False) -> Sequence[ActiveAlert]:
        """Return errors and warnings, worst first. Alerts for developers are included only on request."""
        return [
            alert
            for alert in self.active
            if alert.severity != "info" and (for_developers or not alert.for_developers)
        ]

    def raise_alert(
        self,
        id: str,
        severity: str,
        title: str,
        detail: str = "",
        *,
        button: str | None = None,
        action: str | None = None,
        count: int = 1,
        for_developers: bool = False,
    ) -> None:
        """Raise or update an alert; on an update, ``count`` is added to its occurrences.

        Raises: ValueError: ``severity`` is not in `SEVERITIES`.
        """
        if severity not in SEVERITIES:
            raise ValueError(f"no severity '{severity}'; use one of {', '.join(SEVERITIES)}")
        old = self._alerts.get(id)
        if old is None:
            now = self._clock()
            new = ActiveAlert(id, severity, title, detail, button, action, now, count, for_developers)
        else:
            new = replace(
                old,
                severity=severity,
                title=title,
                detail=detail,
                button=button,
                action=action,
                count=old.count + count,
                for_developers=for_developers,
            )
        if new != old:
            self._alerts[id] = new
            self._changed()

    def resolve(self, id: str) -> None:
        """Remove an alert; no effect when it isn't active."""
        self._dismissed.discard(id)
        if self._alerts.pop(id, None) is not None:
            self._changed()

    def resolve_all(self, prefix: str) -> None:
        """Resolve every alert whose id starts with ``prefix``."""
        for id in [id for id in self._alerts if id.startswith(prefix)]:
            self.resolve(id)

    def has(self, id: str) -> bool:
        """Return True if the alert is active."""
        return id in self._alerts

    def get(self, id: str) -> ActiveAlert | None:
        """Return the active alert with this id, or None."""
        return self._alerts.get(id)

    def dismiss(self, id: str) -> None:
        """Hide the banner of an alert until the alert is raised again; the alert remains in `active`."""
        if id in self._alerts and id not in self._dismissed:
            self._dismissed.add(id)
            self.revision += 1

    def is_dismissed(self, id: str) -> bool:
        """Return True if the user closed the banner of the alert."""
        return id in self._dismissed

    def _changed(self) -> None:
        self._sorted = None
        self.revision += 1
