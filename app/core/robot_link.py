"""One robot as Studio sees it now, and what a person tried with it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from app.core.watches import Watch
from app.robots.description import Robot
from nep.pubsub import Publisher

FINAL_STATES = frozenset({"succeeded", "failed", "canceled"})

Payload = Mapping[str, object]


@dataclass(slots=True, eq=False)
class Invocation:
    """One action that a person tried: its state is a robot's answer (``sent`` until the first one)."""

    id: str
    action: str
    state: str = "sent"
    feedback: Payload = field(default_factory=dict)
    output: Payload = field(default_factory=dict)
    error: str | None = None
    started_s: float = 0.0
    ended_s: float | None = None
    clock: Callable[[], float] = time.monotonic

    @property
    def running(self) -> bool:
        """Whether the robot has not finished it."""
        return self.state not in FINAL_STATES

    @property
    def elapsed_s(self) -> float:
        """Seconds since it was sent, at most until it ended."""
        return (self.ended_s if self.ended_s is not None else self.clock()) - self.started_s


@dataclass(slots=True, eq=False)
class RobotLink:
    """One robot as Studio sees it now.

    ``values`` has the newest value of each sensor while somebody looks.
    """

    name: str
    robot: Robot
    connected: bool = True
    silent: str | None = None
    values: dict[str, object] = field(default_factory=dict)
    drawing: Payload | None = None
    invocations: dict[str, Invocation] = field(default_factory=dict)
    last_stop: str | None = None
    publisher: Publisher | None = None
    world: Publisher | None = None
    watch: Watch | None = None

    @property
    def virtual(self) -> bool:
        """Whether it exists only on this computer."""
        return self.robot.virtual

    @property
    def can_confirm_stop(self) -> bool:
        """Whether it answers a stop; robots of RIZE do not."""
        return self.robot.safe_stop.confirmed

    @property
    def state(self) -> str:
        """``away``, ``silent``, ``busy`` or ``ready``."""
        if not self.connected:
            return "away"
        if self.silent is not None:
            return "silent"
        return "busy" if any(invocation.running for invocation in self.invocations.values()) else "ready"

    @property
    def chip(self) -> str:
        """The words of its chip: ``virtual, ready``."""
        words = self.silent if self.silent is not None and self.connected else self.state
        return f"virtual, {words}" if self.virtual else words
