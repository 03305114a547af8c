"""Active alerts: problems with an id, a description and a next step. Resolved alerts are removed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from app.intents import Intent

SEVERITIES = ("error", "warn", "info")


@dataclass(frozen=True, slots=True)
class ActiveAlert:
    """One active problem.

    Attributes:
        title: Problem in one sentence.
        detail: Explanation of the problem; may be empty.
        button: Label of the button for the next step, or None.
        intent: Next step that the button carries out, or None.
        since_s: Time of the first occurrence, on the clock passed to `Alerts`.
        count: Number of occurrences since the alert was last resolved.
        for_developers: True if the alert is shown in the Developer layout only.
    """

    id: str
    severity: str
    title: str
    detail: str
    button: str | None
    intent: Intent | None
    since_s: float
    count: int
    for_developers: bool = False


class Alerts:
    """Active alerts, most severe first. Not thread-safe; use it from the main thread."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        self._clock = clock
        self._alerts: dict[str, ActiveAlert] = {}
        self._dismissed: set[str] = set()
        self._sorted: tuple[ActiveAlert, ...] | None = ()
        self.revision = 0

    @property
    def active(self) -> Sequence[ActiveAlert]:
        """All active alerts, sorted by severity (errors, warnings, infos) and then by age, oldest first."""
        if self._sorted is None:
            order = {severity: rank for rank, severity in enumerate(SEVERITIES)}
            self._sorted = tuple(
                sorted(self._alerts.values(), key=lambda alert: (order[alert.severity], alert.since_s))
            )
        return self._sorted

    def errors_and_warnings(self, *, for_developers: bool = False) -> Sequence[ActiveAlert]:
        """Return the active errors and warnings, most severe first.

        Args:
            for_developers: True to include alerts that are shown in the Developer layout only.
        """
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
        intent: Intent | None = None,
        count: int = 1,
        for_developers: bool = False,
    ) -> None:
        """Raise an alert, or update the active alert with the same id.

        Args:
            id: Id of the alert.
            severity: One of `SEVERITIES`.
            title: Problem in one sentence.
            detail: Explanation of the problem.
            button: Label of the button for the next step.
            intent: Next step that the button carries out.
            count: Number of new occurrences, added to the previous ones.
            for_developers: True to show the alert in the Developer layout only.

        Raises:
            ValueError: ``severity`` is not in `SEVERITIES`.
        """
        if severity not in SEVERITIES:
            raise ValueError(f"no severity '{severity}'; use one of {', '.join(SEVERITIES)}")
        old = self._alerts.get(id)
        if old is None:
            now = self._clock()
            new = ActiveAlert(id, severity, title, detail, button, intent, now, count, for_developers)
        else:
            new = replace(
                old,
                severity=severity,
                title=title,
                detail=detail,
                button=button,
                intent=intent,
                count=old.count + count,
                for_developers=for_developers,
            )
        if new != old:
            self._alerts[id] = new
            self._mark_changed()

    def resolve(self, id: str) -> None:
        """Remove an alert. Does nothing if the alert isn't active."""
        self._dismissed.discard(id)
        if self._alerts.pop(id, None) is not None:
            self._mark_changed()

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
        """Hide the banner of an alert until the alert is resolved; the alert remains in `active`."""
        if id in self._alerts and id not in self._dismissed:
            self._dismissed.add(id)
            self.revision += 1

    def is_dismissed(self, id: str) -> bool:
        """Return True if the banner of the alert is hidden; see `dismiss`."""
        return id in self._dismissed

    def _mark_changed(self) -> None:
        self._sorted = None
        self.revision += 1
