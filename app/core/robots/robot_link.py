"""One robot as Studio sees it now, and what a person tried with it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from app.core.network.watches import Watch
from app.core.robots.reported_count import ReportedCount
from app.robots.description.description import Robot, RobotTopics
from app.robots.identity import Identity, may_move
from nep.i18n import _, lazy
from nep.nodes.publisher import Publisher

SENDER = "studio"
"""Who the commands of try-outs are from."""
TRIES_KEPT = 40
MAX_AWAY = 200
"""Robots that went away and are remembered: a whole room may go at once, when its access point fails."""
NOT_STOPPED = "not stopped"
CONNECTING = "connecting"
STOPPING = "stopping"
FINAL_STATES = frozenset({"succeeded", "failed", "canceled"})
STATE_WORDS = {
    NOT_STOPPED: lazy("not stopped"),
    STOPPING: lazy("stopping"),
    "away": lazy("not running"),
    CONNECTING: lazy("connecting"),
    "silent": lazy("not responding"),
    "busy": lazy("busy"),
    "ready": lazy("ready"),
}
"""What people read for each `RobotLink.state`."""

Payload = Mapping[str, object]


@dataclass(slots=True, eq=False)
class Invocation:
    """One action that a person tried: its state is a robot's answer (``sent`` until the first one).

    While it is ``accepted`` it may wait for the actions ``waits_for``; it ended those of ``replaces``.
    ``timeout_s`` counts from the moment in which the robot began. ``at_s`` is the time of day (epoch).
    """

    id: str
    action: str
    state: str = "sent"
    feedback: Payload = field(default_factory=dict)
    output: Payload = field(default_factory=dict)
    error: str | None = None
    started_s: float = 0.0
    ended_s: float | None = None
    clock: Callable[[], float] = time.monotonic
    given: Payload = field(default_factory=dict)
    timeout_s: float | None = None
    begun_s: float | None = None
    waits_for: tuple[str, ...] = ()
    replaces: tuple[str, ...] = ()
    at_s: float = 0.0

    @property
    def left_s(self) -> float | None:
        """Seconds until it takes too long; None when it has no limit or has not begun."""
        if self.timeout_s is None or self.begun_s is None:
            return None
        return self.begun_s + self.timeout_s - self.clock()

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

    ``values`` has the newest value of each sensor while somebody looks. ``tried`` are the last tries, the
    newest at the end. ``mute`` says that it did not answer a command; ``heard_s`` is when it last answered
    anything or was asked, ``answered_s`` when it last answered, ``gone_s`` since when it is away.
    ``not_stopped`` says why the last stop is not proven ("Arm may still move: the brake does not answer"),
    ``goes_on`` what it says itself about actions that it could not end, ``may_move`` that it was told to move
    and is not heard any more (`MovedRobots`); they are empty when all is well.
    ``stop_began_s`` is since when the answer to a stop is waited for, ``stopping`` whether that is long
    enough to be said. ``is_reached`` says that a stop would arrive now.
    ``identity`` is the program that it is, ``topics_before`` are the topics of its earlier descriptions.
    ``rejected`` counts messages that its driver did not handle, ``errors`` exceptions that it survived.
    ``was_real`` says that it has not always been virtual, ``has_proven_stop`` that its program once did.
    """

    name: str
    robot: Robot
    connected: bool = True
    silent: str | None = None
    values: dict[str, object] = field(default_factory=dict)
    drawing: Payload | None = None
    invocations: dict[str, Invocation] = field(default_factory=dict)
    tried: deque[Invocation] = field(default_factory=lambda: deque(maxlen=TRIES_KEPT))
    mute: bool = False
    heard_s: float = 0.0
    answered_s: float | None = None
    gone_s: float | None = None
    last_stop: str | None = None
    last_stop_status: str = "error"
    not_stopped: str = ""
    goes_on: str = ""
    may_move: str = ""
    has_proven_stop: bool = False
    stop_began_s: float | None = None
    stopping: bool = False
    is_reached: bool = True
    identity: Identity | None = None
    topics_before: tuple[RobotTopics, ...] = ()
    is_opening: bool = False
    rejected: ReportedCount = field(default_factory=ReportedCount)
    errors: ReportedCount = field(default_factory=ReportedCount)
    was_real: bool = False
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
        """``not stopped``, ``stopping``, ``away``, ``connecting``, ``silent``, ``busy`` or ``ready``.

        One that has not stopped, or has not answered yet, may still move when it is away.
        """
        if self.not_stopped or self.may_move or (self.connected and self.goes_on):
            return NOT_STOPPED
        if self.stopping:
            return STOPPING
        if not self.connected:
            return "away"
        if not self.is_reached:
            return CONNECTING
        if self.silent is not None or self.mute:
            return "silent"
        return "busy" if self.running else "ready"

    @property
    def running(self) -> tuple[Invocation, ...]:
        """The tries that have not ended."""
        known = {made.id: made for made in (*self.tried, *self.invocations.values())}
        return tuple(made for made in known.values() if made.running)

    @property
    def state_words(self) -> str:
        """How it is, as people read it: ``ready``, ``may still move``, ``does not answer``."""
        state = self.state
        if self.connected and self.mute and state == NOT_STOPPED and not self.not_stopped:
            return _("not responding")
        if state == NOT_STOPPED and (
            self.may_move or may_move(self.name, self.goes_on) or may_move(self.name, self.not_stopped)
        ):
            return _("may still move")
        if self.connected and state == "silent":
            return _("not responding") if self.mute else self.silent or _(STATE_WORDS[state])
        return _(STATE_WORDS[state])

    @property
    def chip(self) -> str:
        """The words of its chip: ``virtual, ready``."""
        words = self.state_words
        return _("virtual, {state}").format(state=words) if self.virtual else words


def excess_away(links: Iterable[RobotLink], in_use: Collection[str]) -> Sequence[RobotLink]:
    """Return the robots to forget: those away beyond `MAX_AWAY`, as any program can invent new names.

    Robots that never answered come first, then those that are away longest. Robots ``in_use``, robots that
    have ever proven a Stop, and robots whose Stop is pending or failed are neither counted nor returned.
    """
    away = [
        link
        for link in links
        if not (link.connected or link.has_proven_stop or link.not_stopped or link.name in in_use)
        and link.stop_began_s is None
    ]
    excess = max(0, len(away) - MAX_AWAY)
    return sorted(away, key=lambda link: (link.answered_s is not None, link.gone_s or 0.0))[:excess]


def topics_of(robot: Robot) -> list[str]:
    """Where it tells what happens to it: its sensors, events and state, no pictures."""
    topics = [sensor.topic for sensor in robot.sensors if sensor.topic and not sensor.is_image]
    topics += [event.topic for event in robot.events if event.topic]
    if robot.topics.state is not None:
        topics.append(robot.topics.state)
    return list(dict.fromkeys(topics))
