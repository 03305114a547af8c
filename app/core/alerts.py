"""Present problems, each with an id, a sentence and a next step; removed when cured."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

SEVERITIES = ("error", "warn", "info")


@dataclass(frozen=True, slots=True)
class ActiveAlert:
    """One present problem.

    ``title`` says what is wrong, ``detail`` what it means, ``button`` and ``action`` the next step (words,
    and the name of a command of the window). ``since_s`` is on the clock that `Alerts` was given; ``count``
    is how often it happened since it was last cured. ``for_developers``: only the Developer layout tells it.
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
    """The present problems, worst first. One thread uses it (the window's)."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        """Start with no problem; ``clock`` gives epoch seconds."""
        self._clock = clock
        self._alerts: dict[str, ActiveAlert] = {}
        self._dismissed: set[str] = set()
        self._sorted: tuple[ActiveAlert, ...] | None = ()
        self.revision = 0

    @property
    def active(self) -> Sequence[ActiveAlert]:
        """All present problems: errors, then warnings, then infos; the oldest first among equals."""
        if self._sorted is None:
            order = {severity: place for place, severity in enumerate(SEVERITIES)}
            self._sorted = tuple(
                sorted(self._alerts.values(), key=lambda alert: (order[alert.severity], alert.since_s))
            )
        return self._sorted

    def to_tell(self, *, for_developers: bool = False) -> Sequence[ActiveAlert]:
        """Return errors and warnings, worst first; those for developers only when asked for."""
        return [
            alert
            for alert in self.active
            if alert.severity != "info" and (for_developers or not alert.for_developers)
        ]

    def put(
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
        """Say that a problem is present. Said again, its words are renewed and ``count`` is added."""
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
        """The problem is gone; nothing happens when there was none."""
        self._dismissed.discard(id)
        if self._alerts.pop(id, None) is not None:
            self._changed()

    def resolve_all(self, prefix: str) -> None:
        """Cure every problem whose id begins with ``prefix``."""
        for id in [id for id in self._alerts if id.startswith(prefix)]:
            self.resolve(id)

    def has(self, id: str) -> bool:
        """Whether this problem is present."""
        return id in self._alerts

    def get(self, id: str) -> ActiveAlert | None:
        """Return the problem of this id; None when it is not present."""
        return self._alerts.get(id)

    def dismiss(self, id: str) -> None:
        """Hide it in the banner until it is cured and comes back; it stays among `active`."""
        if id in self._alerts and id not in self._dismissed:
            self._dismissed.add(id)
            self.revision += 1

    def dismissed(self, id: str) -> bool:
        """Whether a person closed its banner."""
        return id in self._dismissed

    def _changed(self) -> None:
        self._sorted = None
        self.revision += 1
