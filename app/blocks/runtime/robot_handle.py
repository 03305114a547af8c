"""A robot as a program sees it: do an action and wait for it, read a sensor, begin a script at an event.

A pause takes an action back; what is left of it is done when the program goes on. `StatusText` says meanwhile
what happens now: what a robot does for a block, else the block itself.
"""

from __future__ import annotations

import math
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from app.blocks.runtime import values
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.link import ProgramLink, RobotCall
from app.blocks.runtime.scheduler import EndScript, Scheduler
from app.robots.description.description import Action, Parameter, Robot
from app.robots.description.inputs import from_words
from app.robots.description.json_access import finite
from nep.i18n import _, listed

FIRST_ANSWER_S = 3.0
FIRST_VALUE_S = 2.0
LONGEST_S = 60.0
MARGIN_S = 2.0
LOOK_S = 0.25
"""How often a command that is waited for is looked at: has its robot fallen silent, has it begun?"""
BEATS_MISSED, SHORTEST_SILENCE_S = 4, 2.0
HOLD_S = 3.0
"""How long a robot may take to end what a pause takes back; its own kit answers within about a second."""
MOST_KEPT = 64
"""Commands that are remembered: a robot answers what it has ended before many others were given."""
REPLACES = "replace"
_PLACE = re.compile(r"%([A-Za-z_]\w*)")

Decorator = Callable[[Callable[..., None]], Callable[..., None]]

LEFT = "to_go"
"""The feedback with which an action says how much is left, in the unit of one of its parameters."""


class StatusText:
    """What happens now, in sentences for the run bar. Scripts tell, another thread reads."""

    def __init__(self, block: Callable[[], str | None], readings: Mapping[str, str]) -> None:
        """``block`` is where the calling script is, ``readings`` are the blocks in words."""
        self._block, self._readings = block, readings
        self._told: dict[str | None, str] = {}
        self._warned: dict[str | None, str] = {}

    def tell(self, sentence: str) -> None:
        """What a robot does now for the calling script's block; "" when it is done."""
        _keep(self._told, self._block(), sentence)

    def warn(self, sentence: str) -> None:
        """What a person should know while the calling script is held; "" when it goes on."""
        _keep(self._warned, self._block(), sentence)

    def says(self, blocks: Sequence[str]) -> str:
        """The sentence for the run bar: what a robot does now, else the first block in words."""
        return _first(self._told, blocks) or self.reading(blocks[0] if blocks else None)

    def warns(self, blocks: Sequence[str]) -> str:
        """What a person should know of one of these blocks; "" for nothing."""
        return _first(self._warned, blocks)

    def reading(self, block: str | None) -> str:
        """A block in words, "" for none."""
        return self._readings.get(block or "", "")


def _keep(sentences: dict[str | None, str], block: str | None, sentence: str) -> None:
    if sentence:
        sentences[block] = sentence
    else:
        sentences.pop(block, None)


def _first(sentences: Mapping[str | None, str], blocks: Sequence[str]) -> str:
    return next((sentences[block] for block in blocks if block in sentences), "")


@dataclass(frozen=True, slots=True)
class Replacement:
    """A block's command was ended by that of another script; ``count``: so often in this run."""

    block: str
    sentence: str
    count: int = 1


@dataclass(frozen=True, slots=True)
class _Command:
    call: RobotCall
    action: Action
    block: str | None
    script: int


class Replacements:
    """Whose command took the place of whose: scripts that fight for a part of a robot.

    The script that lost goes on with its next block (docs/blocks.md), and a person is told. Scripts tell, one
    at a time; another thread takes what is new.
    """

    def __init__(self) -> None:
        self._commands: deque[_Command] = deque(maxlen=MOST_KEPT)
        self._lock = threading.Lock()
        self._counts: dict[tuple[str, str], int] = {}
        self._news: dict[tuple[str, str], Replacement] = {}

    def asked(self, call: RobotCall, action: Action, block: str | None) -> None:
        """The calling script gave this command, in this block."""
        self._commands.append(_Command(call, action, block, threading.get_ident()))

    def ended(self, call: RobotCall, *, names_robot: bool) -> None:
        """The robot has ended this command before it was done, and neither a pause nor a stop wanted that.

        Nothing is told unless a later command of another script took its place. ``names_robot``: the
        sentence says which robot, because there are several.
        """
        loser = next((each for each in self._commands if each.call is call), None)
        if loser is None or loser.block is None:
            return
        later = list(self._commands)[self._commands.index(loser) + 1 :]
        winner = next((each for each in later if _takes_place(each, loser)), None)
        if winner is None or winner.script == loser.script:
            return
        words = _("“{action}” was replaced by “{other}”")
        if names_robot:
            words = _("{robot}: “{action}” was replaced by “{other}”")
        said = words.format(robot=call.robot, action=loser.action.title, other=winner.action.title)
        pair = (loser.block, winner.block or winner.action.name)
        with self._lock:
            count = self._counts[pair] = self._counts.get(pair, 0) + 1
            self._news[pair] = Replacement(loser.block, said, count)

    def take_news(self) -> tuple[Replacement, ...]:
        """What has happened since this was asked last; what happened several times only with its count."""
        with self._lock:
            news, self._news = tuple(self._news.values()), {}
        return news


def _takes_place(winner: _Command, loser: _Command) -> bool:
    return (
        winner.call.robot == loser.call.robot
        and winner.action.on_busy == REPLACES
        and bool(set(winner.action.uses) & set(loser.action.uses))
    )


class ProgramContext(Protocol):
    """What a robot's handle needs of the program that runs."""

    scheduler: Scheduler
    saying: StatusText
    replaced: Replacements

    @property
    def robot_count(self) -> int:
        """How many robots the program has."""
        ...

    def described(self, name: str) -> Robot:
        """The description of a robot that is there."""
        ...

    def linked(self) -> ProgramLink:
        """The network."""
        ...

    def write(self, value: object) -> None:
        """Write a line to the console."""
        ...

    def on_event(self, robot: str, event: str, filters: Mapping[str, object]) -> Decorator:
        """Begin a script at a robot's event."""
        ...

    def on_change(self, robot: str, sensor: str) -> Decorator:
        """Begin a script at a sensor's change."""
        ...

    def on_pass(self, robot: str, sensor: str, side: str, limit: float) -> Decorator:
        """Begin a script when a sensor passes a limit."""
        ...


class RobotHandle:
    """``robot("Pepper")``."""

    def __init__(self, name: str, runtime: ProgramContext) -> None:
        self._name = name
        self._runtime = runtime

    def do(self, action: str, /, **input: object) -> None:
        """Let the robot do an action and wait until it is done; BehaviourError with the robot's sentence."""
        self._invoke(action, input)

    def ask(self, action: str, field: str, /, **input: object) -> object:
        """The same for an action that answers: what it says in this field."""
        return self._invoke(action, input).output.get(field)

    def get(self, sensor: str, field: str | None = None) -> object:
        """A sensor's newest value, or one field of it; None while it is not known."""
        robot = self._runtime.described(self._name)
        link, scheduler = self._runtime.linked(), self._runtime.scheduler
        if robot.sensor(sensor) is None:
            raise BehaviourError(_("{name} has no sensor “{sensor}”.").format(name=self._name, sensor=sensor))
        if link.sensor(self._name, sensor) is None:
            # Sensors tell their value several times a second: the first one may still be under way.
            scheduler.wait_for(lambda: link.sensor(self._name, sensor) is not None, FIRST_VALUE_S)
        told = link.sensor(self._name, sensor)
        return told if field is None else values.part(told, field)

    def on(self, event: str, /, **filters: object) -> Decorator:
        """The script below runs each time this happens to the robot."""
        return self._runtime.on_event(self._name, event, filters)

    def on_change(self, sensor: str) -> Decorator:
        """The script below runs each time the sensor tells another value."""
        return self._runtime.on_change(self._name, sensor)

    def on_pass(self, sensor: str, side: str, limit: float) -> Decorator:
        """The script below runs each time the sensor passes the limit: "below" or "above" it."""
        return self._runtime.on_pass(self._name, sensor, side, limit)

    def _invoke(self, name: str, given: Mapping[str, object]) -> RobotCall:
        robot = self._runtime.described(self._name)
        action = robot.action(name)
        if action is None:
            raise BehaviourError(_("{name} can't “{name_2}”.").format(name=self._name, name_2=name))
        input = {key: _fitting(action, key, value) for key, value in given.items()}
        wrong = action.check(action.complete(input))
        if wrong:
            raise BehaviourError(_("{name} can't do this: {wrong}.").format(name=self._name, wrong=wrong[0]))
        words = sentence(robot, action, input)
        self._runtime.saying.tell(words)
        try:
            call = self._do(robot, action, action.complete(input), words)
        finally:
            self._runtime.saying.tell("")
        if call.state == "failed":
            why = call.error or _("“{action}” failed").format(action=action.title)
            raise BehaviourError(
                _ended(_("{robot}: {what_it_said}").format(robot=self._name, what_it_said=why))
            )
        return call

    def _do(self, robot: Robot, action: Action, input: Mapping[str, object], words: str) -> RobotCall:
        """One command, or several when a pause takes it back and what is left is done afterwards."""
        while True:
            call = self._runtime.linked().invoke(self._name, action.name, input)
            self._runtime.replaced.asked(call, action, self._runtime.scheduler.block())
            try:
                self._await(robot, action, call, words)
            except EndScript:  # the program goes on, the robot shall not
                self._runtime.linked().cancel(call)
                raise
            if call.state == "canceled" and not call.held:
                self._runtime.replaced.ended(call, names_robot=self._runtime.robot_count > 1)
            if not call.held or call.state != "canceled":
                return call
            self._stay(action, is_unknown(action, input, call))
            rest = rest_of(action, input, call)
            if rest is None:
                return call
            input = rest

    def _stay(self, action: Action, unknown: bool) -> None:
        """Until the pause ends; a person reads that the rest of a move will be left out, and that it was."""
        names = {"robot": self._name, "action": action.title}
        saying = self._runtime.saying
        ahead = _("{robot} doesn't report how much of “{action}” is left; Resume skips it")
        saying.warn(ahead.format(**names) if unknown else "")
        self._runtime.scheduler.hold()
        saying.warn("")
        if unknown:
            done = _("{robot} doesn't report how much of “{action}” is left, so it was skipped")
            self._runtime.write(done.format(**names))

    def _await(self, robot: Robot, action: Action, call: RobotCall, words: str) -> None:
        scheduler = self._runtime.scheduler
        if robot.dialect == "native" and not scheduler.wait_for(lambda: call.state != "sent", FIRST_ANSWER_S):
            raise BehaviourError(
                _("{name} is not responding. {check}").format(name=self._name, check=_check(robot))
            )
        can_hold = action.cancellable and robot.dialect == "native"
        limit = action.timeout_s or LONGEST_S
        until = time.monotonic() + limit + MARGIN_S
        waits = bool(call.waits_for) and call.state == "accepted"
        if waits:
            self._runtime.saying.tell(_waiting(robot, call))

        def ready() -> bool:
            return call.done or (can_hold and scheduler.holds())

        while not scheduler.wait_for(ready, min(LOOK_S, max(0.0, until - time.monotonic()))):
            if waits:  # its time limit begins with it
                until = time.monotonic() + limit + MARGIN_S
                waits = not call.began
                self._runtime.saying.tell(_waiting(robot, call) if waits else words)
            said = self._broken(robot, call)
            if said is None and time.monotonic() >= until:
                said = _("{name} did not finish “{title}” within {limit:g} s.").format(
                    name=self._name, title=action.title, limit=limit
                )
            if said is not None:
                self._runtime.linked().cancel(call)
                raise BehaviourError(said)
        if not call.done:
            self._hold(call)

    def _broken(self, robot: Robot, call: RobotCall) -> str | None:
        """The sentence when a robot that always tells that it lives does so no more."""
        if robot.beat_s is None:
            return None
        silence = time.monotonic() - call.heard_s
        if silence <= max(SHORTEST_SILENCE_S, BEATS_MISSED * robot.beat_s):
            return None
        return _("{name} stopped responding. {check}").format(name=self._name, check=_check(robot))

    def _hold(self, call: RobotCall) -> None:
        """The pause takes the command back; a robot that does not end it is no longer under control."""
        call.held = True
        self._runtime.linked().cancel(call)
        if not self._runtime.scheduler.wait_for(lambda: call.done, HOLD_S):
            raise BehaviourError(
                _("{name} did not pause, so the behaviour was stopped.").format(name=self._name)
            )


def _waiting(robot: Robot, call: RobotCall) -> str:
    """What the robot does first: "Pepper waits for “say”"."""
    found = [(robot.action(name), name) for name in dict.fromkeys(call.waits_for)]
    titles = [f"“{action.title if action is not None else name}”" for action, name in found]
    return _("{robot} is waiting for {actions}").format(robot=robot.name, actions=listed(titles))


def sentence(robot: Robot, action: Action, input: Mapping[str, object]) -> str:
    """What the robot does now: "Pepper says “Touch my head.”"."""

    def place(match: re.Match[str]) -> str:
        if match[1] == "robot":
            return robot.name
        parameter = action.parameter(match[1])
        value = input.get(match[1], parameter.default if parameter else None)
        if parameter is not None:
            value = next((choice.title for choice in parameter.choices if choice.value == value), value)
        return values.text(value)

    return " ".join(_PLACE.sub(place, action.says or action.text).split())


def _fitting(action: Action, name: str, value: object) -> object:
    """A value as the parameter wants it: text of a number, a whole number of 2.0, a list of "yes, no"."""
    parameter = action.parameter(name)
    if parameter is None:
        return value
    if value is None:
        raise BehaviourError(
            _("“{title}” needs a value for “{value}” that is not known yet.").format(
                title=action.title, value=parameter.title
            ),
            unknown=True,
        )
    return _as_kind(parameter, value)


def _as_kind(parameter: Parameter, value: object) -> object:
    if parameter.kind in ("text", "image"):
        return values.text(value)
    if parameter.kind == "integer" and isinstance(value, float) and value.is_integer():
        return int(value)
    if parameter.kind in ("list", "object") and isinstance(value, str):
        return from_words(parameter, value)
    return value


def _ended(words: str) -> str:
    return words if words.endswith((".", "!", "?", "”")) else f"{words}."


def _check(robot: Robot) -> str:
    """What a person does about a robot that is silent."""
    if robot.virtual:
        return _("Start the virtual robot again.")
    return _("Check that it is switched on and on the same Wi-Fi.")


def rest_of(action: Action, input: Mapping[str, object], call: RobotCall) -> dict[str, object] | None:
    """The input for what is left of a call that was taken back; None when nothing is to be done any more.

    An action that tells what is left does the rest, another one begins again. One that moves the robot to
    another place and does not tell what is left would go too far: the rest is left out.
    """
    if not call.began:
        return dict(input)
    if is_unknown(action, input, call):
        return None
    name = measured_by(action, input)
    if name is None:
        return dict(input)
    left, whole = _number(call.feedback.get(LEFT)), _number(input[name])
    if abs(left) <= abs(whole) / 1000:
        return None
    return {**input, name: math.copysign(min(abs(left), abs(whole)), whole)}


def is_unknown(action: Action, input: Mapping[str, object], call: RobotCall) -> bool:
    """Whether the robot was on its way to another place, and does not tell how much of it is left."""
    name = measured_by(action, input)
    if not call.began or name is None:
        return call.began and action.risk == "locomotes"
    return not _is_number(call.feedback.get(LEFT))


def measured_by(action: Action, input: Mapping[str, object]) -> str | None:
    """The parameter of which the action tells what is left: the only number in the same unit."""
    unit = next((field.unit for field in action.feedback if field.name == LEFT), None)
    same = [
        parameter.name
        for parameter in action.parameters
        if unit is not None and parameter.unit == unit and _is_number(input.get(parameter.name))
    ]
    return same[0] if len(same) == 1 else None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _number(value: object) -> float:
    return finite(value) or 0.0
