"""Interface of a program to one robot: actions, sensors and event scripts.

A pause cancels a running action; the remaining part is executed when the program continues. `StatusText`
describes the current activity in the run bar: the action of a robot, or else the block.
"""

from __future__ import annotations

import math
import re
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from app.blocks.runtime import values
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.link import ProgramLink, RobotCall
from app.blocks.runtime.scheduler import EndScript, Scheduler, Script, current_script
from app.robots.client import limits
from app.robots.client.dialects import dialect_of
from app.robots.client.task import is_silent
from app.robots.description.description import Action, Parameter, Robot
from app.robots.description.inputs import parse_value
from app.robots.description.json_access import finite_float
from nep.i18n import _, format_list

MAX_STORED_COMMANDS = 64
"""Maximum number of recent commands in `Replacements`; a robot reports a replaced command at once."""
REPLACE = "replace"
_PLACEHOLDER = re.compile(r"%([A-Za-z_][A-Za-z0-9_]*)")

Decorator = Callable[[Callable[..., None]], Callable[..., None]]

REMAINING_FIELD = "to_go"
"""Name of the feedback field with the remaining amount, in the unit of one parameter of the action."""


class StatusText:
    """Texts about the current activity for the run bar. Written by scripts, read by another thread.

    Args:
        block: Returns the current block of the calling script.
        readings: Blocks as text by id.
    """

    def __init__(self, block: Callable[[], str | None], readings: Mapping[str, str]) -> None:
        self._block, self._block_texts = block, readings
        self._status_by_block: dict[str | None, str] = {}
        self._warning_by_block: dict[str | None, str] = {}

    def set_text(self, status: str) -> None:
        """Set the activity of a robot at the current block of the calling script; "" removes it."""
        _set_or_remove(self._status_by_block, self._block(), status)

    def set_warning(self, warning: str) -> None:
        """Set a warning at the current block of the calling script; "" removes it."""
        _set_or_remove(self._warning_by_block, self._block(), warning)

    def text(self, blocks: Sequence[str]) -> str:
        """Return the text for the run bar: the activity of a robot at these blocks, or the first block.

        Returns an empty text if there are no blocks.
        """
        return _first_text(self._status_by_block, blocks) or self.block_text(blocks[0] if blocks else None)

    def warning(self, blocks: Sequence[str]) -> str:
        """Return the warning at one of these blocks; "" if there is none."""
        return _first_text(self._warning_by_block, blocks)

    def block_text(self, block: str | None) -> str:
        """Return a block as text; "" for None and unknown blocks."""
        return self._block_texts.get(block or "", "")


def _set_or_remove(texts: dict[str | None, str], block: str | None, status: str) -> None:
    if status:
        texts[block] = status
    else:
        texts.pop(block, None)


def _first_text(texts: Mapping[str | None, str], blocks: Sequence[str]) -> str:
    return next((texts[block] for block in blocks if block in texts), "")


@dataclass(frozen=True, slots=True)
class Replacement:
    """Command of one script that was replaced by a command of another script.

    Attributes:
        block: Id of the block whose command was replaced.
        message: Message for the user.
        count: Number of times that this happened in this run.
    """

    block: str
    message: str
    count: int = 1


@dataclass(frozen=True, slots=True)
class _Command:
    call: RobotCall
    action: Action
    block: str | None
    script: Script | None


class Replacements:
    """Detector of scripts that replace each other's actions.

    The script whose action was replaced continues with its next block (docs/blocks.md), and the user is
    informed. Written by one script at a time, read by another thread.
    """

    def __init__(self) -> None:
        self._commands: deque[_Command] = deque(maxlen=MAX_STORED_COMMANDS)
        self._lock = threading.Lock()
        self._counts: dict[tuple[str, str], int] = {}
        self._new_replacements: dict[tuple[str, str], Replacement] = {}

    def record_command(self, call: RobotCall, action: Action, block: str | None) -> None:
        """Record a command of the calling script.

        Args:
            call: Command.
            action: Description of the action.
            block: Id of the block.
        """
        self._commands.append(_Command(call, action, block, current_script()))

    def record_early_end(self, call: RobotCall, *, names_robot: bool) -> bool:
        """Record that the robot cancelled a command although there was no pause or stop.

        Such a command is reported only if a later command of another script replaced it.

        Args:
            call: Cancelled command.
            names_robot: True to include the name of the robot in the message.

        Returns:
            True if a command of another script replaced it.
        """
        replaced = next((each for each in self._commands if each.call is call), None)
        if replaced is None or replaced.block is None:
            return False
        later_commands = list(self._commands)[self._commands.index(replaced) + 1 :]
        replacing = next((each for each in later_commands if _replaces(each, replaced)), None)
        if replacing is None or replacing.script is replaced.script:
            return False
        template = _("“{action}” was replaced by “{other}”")
        if names_robot:
            template = _("{robot}: “{action}” was replaced by “{other}”")
        message = template.format(
            robot=call.robot, action=replaced.action.title, other=replacing.action.title
        )
        key = (replaced.block, replacing.block or replacing.action.name)
        with self._lock:
            count = self._counts[key] = self._counts.get(key, 0) + 1
            self._new_replacements[key] = Replacement(replaced.block, message, count)
        return True

    def take_new(self) -> tuple[Replacement, ...]:
        """Return the replacements since the last call; repeated ones are combined with their count."""
        with self._lock:
            new_replacements, self._new_replacements = tuple(self._new_replacements.values()), {}
        return new_replacements


def _replaces(replacing: _Command, replaced: _Command) -> bool:
    return (
        replacing.call.robot == replaced.call.robot
        and replacing.action.on_busy == REPLACE
        and bool(set(replacing.action.uses) & set(replaced.action.uses))
    )


class ProgramContext(Protocol):
    """Interface of the running program that `RobotHandle` uses.

    Implemented by `app.blocks.runtime.runtime.Runtime`.
    """

    scheduler: Scheduler
    status_text: StatusText
    replacements: Replacements

    @property
    def robot_count(self) -> int:
        """Number of robots that the program uses."""
        ...

    def robot_description(self, name: str) -> Robot:
        """Return the description of a robot. Raises BehaviourError if the robot is not connected."""
        ...

    def link(self) -> ProgramLink:
        """Return the connection of the program to the network."""
        ...

    def write(self, value: object) -> None:
        """Write a line to the Console."""
        ...

    def on_event(self, robot: str, event: str, filters: Mapping[str, object]) -> Decorator:
        """Return a decorator for scripts that run at each event of a robot with this name."""
        ...

    def on_change(self, robot: str, sensor: str) -> Decorator:
        """Return a decorator for scripts that run each time the value of a sensor changes."""
        ...

    def on_pass(self, robot: str, sensor: str, side: str, limit: float) -> Decorator:
        """Return a decorator for scripts that run each time a sensor passes a limit.

        See `RobotHandle.on_pass` for the arguments.
        """
        ...


class RobotHandle:
    """Interface of a program to one robot, returned by ``robot("Pepper")``."""

    def __init__(self, name: str, runtime: ProgramContext) -> None:
        self._name = name
        self._runtime = runtime

    def do(self, name: str, /, **arguments: object) -> RobotCall:
        """Run an action, wait until it has ended, and return its call.

        Args:
            name: Name of the action.
            arguments: Parameters of the action.

        Raises:
            BehaviourError: The robot can't execute the action; the message is for the user.
        """
        robot = self._runtime.robot_description(self._name)
        action = robot.action(name)
        if action is None:
            raise BehaviourError(_("{name} can't “{name_2}”.").format(name=self._name, name_2=name))
        input = {key: _convert_input(action, key, value) for key, value in arguments.items()}
        problems = action.check(action.complete(input))
        if problems:
            raise BehaviourError(
                _("{name} can't do this: {wrong}.").format(name=self._name, wrong=problems[0])
            )
        activity = activity_text(robot, action, input)
        self._runtime.status_text.set_text(activity)
        try:
            call = self._run_action(robot, action, action.complete(input), activity)
        finally:
            self._runtime.status_text.set_text("")
        if call.state == "failed":
            reason = call.error or _("“{action}” failed").format(action=action.title)
            raise BehaviourError(
                _with_full_stop(_("{robot}: {what_it_said}").format(robot=self._name, what_it_said=reason))
            )
        return call

    def ask(self, action: str, field: str, /, **input: object) -> object:
        """Run an action and return one field of its result; None if the result doesn't have the field.

        Args:
            action: Name of the action.
            field: Name of the field.
            input: Parameters of the action.

        Raises:
            BehaviourError: The robot can't execute the action; the message is for the user.
        """
        return self.do(action, **input).output.get(field)

    def get(self, sensor: str, field: str | None = None) -> object:
        """Return the newest value of a sensor, or one field of the value; None if the value is unknown.

        Waits up to 2 s for the first value.

        Args:
            sensor: Name of the sensor.
            field: Field path in the value; None for the whole value.

        Raises:
            BehaviourError: The robot is not connected or has no such sensor.
        """
        robot = self._runtime.robot_description(self._name)
        link, scheduler = self._runtime.link(), self._runtime.scheduler
        if robot.sensor(sensor) is None:
            raise BehaviourError(_("{name} has no sensor “{sensor}”.").format(name=self._name, sensor=sensor))
        if link.sensor(self._name, sensor) is None:
            # Sensors publish several times a second: the first value may be in flight.
            scheduler.wait_for(
                lambda: link.sensor(self._name, sensor) is not None, limits.FIRST_VALUE_TIMEOUT_S
            )
        value = link.sensor(self._name, sensor)
        return value if field is None else values.part(value, field)

    def on(self, event: str, /, **filters: object) -> Decorator:
        """Return a decorator for scripts that run at each event with this name.

        Args:
            event: Name of the event.
            filters: Required values of fields, by name.
        """
        return self._runtime.on_event(self._name, event, filters)

    def on_change(self, sensor: str) -> Decorator:
        """Return a decorator for scripts that run each time the value of the sensor changes."""
        return self._runtime.on_change(self._name, sensor)

    def on_pass(self, sensor: str, side: str, limit: float) -> Decorator:
        """Return a decorator for scripts that run each time the value of the sensor passes a limit.

        Args:
            sensor: Name of the sensor.
            side: "below" to run when the value falls below the limit, "above" when it rises above.
            limit: Limit in the unit of the sensor.
        """
        return self._runtime.on_pass(self._name, sensor, side, limit)

    def _run_action(
        self, robot: Robot, action: Action, input: Mapping[str, object], activity: str
    ) -> RobotCall:
        whole_input, scheduler = input, self._runtime.scheduler
        while True:
            call = self._runtime.link().invoke(self._name, action.name, input)
            self._runtime.replacements.record_command(call, action, scheduler.block())
            try:
                self._wait_for_reply(robot, action, call, activity)
            except EndScript:  # the program continues, but the robot must stop
                self._runtime.link().cancel(call)
                raise
            if call.state == "canceled" and not call.is_canceled_by_pause:
                names_robot = self._runtime.robot_count > 1
                is_replaced = self._runtime.replacements.record_early_end(call, names_robot=names_robot)
                scheduler.record_interruption("replaced" if is_replaced else "canceled")
            if not call.is_canceled_by_pause or call.state != "canceled":
                return call
            restarts = scheduler.must_restart_block()
            self._wait_while_paused(action, not restarts and is_remainder_unknown(action, input, call))
            remaining = whole_input if restarts else remaining_input(action, input, call)
            if remaining is None:
                return call
            input = remaining

    def _wait_while_paused(self, action: Action, is_unknown: bool) -> None:
        names = {"robot": self._name, "action": action.title}
        status_text = self._runtime.status_text
        pause_warning = _("{robot} doesn't report how much of “{action}” is left; Resume skips it")
        status_text.set_warning(pause_warning.format(**names) if is_unknown else "")
        self._runtime.scheduler.wait_while_paused()
        status_text.set_warning("")
        if is_unknown:
            skipped_message = _("{robot} doesn't report how much of “{action}” is left, so it was skipped")
            self._runtime.write(skipped_message.format(**names))
            self._runtime.scheduler.record_skip("unknown_remainder")

    def _wait_for_reply(self, robot: Robot, action: Action, call: RobotCall, activity: str) -> None:
        scheduler, dialect = self._runtime.scheduler, dialect_of(robot)
        if dialect.is_identified and not scheduler.wait_for(
            lambda: call.state != "sent", limits.FIRST_REPLY_TIMEOUT_S
        ):
            raise BehaviourError(
                _("{name} isn't responding. {check}").format(name=self._name, check=_check_hint(robot))
            )
        can_pause = action.cancellable and dialect.can_cancel
        time_limit_s = action.timeout_s or limits.DEFAULT_ACTION_TIMEOUT_S
        clock = scheduler.clock
        deadline = clock.now() + time_limit_s + limits.ACTION_MARGIN_S
        is_waiting = bool(call.waits_for) and call.state == "accepted"
        if is_waiting:
            self._runtime.status_text.set_text(_waiting_text(robot, call))

        def ready() -> bool:
            return call.done or (can_pause and scheduler.is_script_paused())

        while not scheduler.wait_for(
            ready, min(limits.COMMAND_CHECK_INTERVAL_S, max(0.0, deadline - clock.now()))
        ):
            if is_waiting:  # the time limit starts with the action
                deadline = clock.now() + time_limit_s + limits.ACTION_MARGIN_S
                is_waiting = not call.has_started
                self._runtime.status_text.set_text(_waiting_text(robot, call) if is_waiting else activity)
            error_text = self._silence_error(robot, call)
            if error_text is None and clock.now() >= deadline:
                error_text = _("{name} didn't finish “{title}” within {limit:g} s.").format(
                    name=self._name, title=action.title, limit=time_limit_s
                )
            if error_text is not None:
                self._runtime.link().cancel(call)
                raise BehaviourError(error_text)
        if not call.done:
            self._cancel_for_pause(call)

    def _silence_error(self, robot: Robot, call: RobotCall) -> str | None:
        if not is_silent(robot, call.last_reply_s, self._runtime.scheduler.clock.now()):
            return None
        return _("{name} stopped responding. {check}").format(name=self._name, check=_check_hint(robot))

    def _cancel_for_pause(self, call: RobotCall) -> None:
        call.is_canceled_by_pause = True
        self._runtime.link().cancel(call)
        if not self._runtime.scheduler.wait_for(lambda: call.done, limits.PAUSE_TIMEOUT_S):
            raise BehaviourError(
                _("{name} didn't pause, so the behaviour was stopped.").format(name=self._name)
            )


def _waiting_text(robot: Robot, call: RobotCall) -> str:
    actions = [(robot.action(name), name) for name in dict.fromkeys(call.waits_for)]
    titles = [
        _("“{name}”").format(name=action.title if action is not None else name) for action, name in actions
    ]
    return _("{robot} is waiting for {actions}").format(robot=robot.name, actions=format_list(titles))


def activity_text(robot: Robot, action: Action, input: Mapping[str, object]) -> str:
    """Return a sentence that describes a running action, such as ``Pepper says “Touch my head.”``.

    Args:
        robot: Description of the robot.
        action: Description of the action.
        input: Input of the action.
    """

    def replacement(match: re.Match[str]) -> str:
        if match[1] == "robot":
            return robot.name
        parameter = action.parameter(match[1])
        value = input.get(match[1], parameter.default if parameter else None)
        if parameter is not None:
            value = next((choice.title for choice in parameter.choices if choice.value == value), value)
        return values.text(value)

    return " ".join(_PLACEHOLDER.sub(replacement, action.says or action.text).split())


def _convert_input(action: Action, name: str, value: object) -> object:
    parameter = action.parameter(name)
    if parameter is None:
        return value
    if value is None:
        raise BehaviourError(
            _("Can't run “{title}”: the value for “{value}” isn't known yet.").format(
                title=action.title, value=parameter.title
            ),
            is_value_unknown=True,
        )
    return _convert_to_kind(parameter, value)


def _convert_to_kind(parameter: Parameter, value: object) -> object:
    if parameter.kind in ("text", "image"):
        return values.text(value)
    if parameter.kind == "integer" and isinstance(value, float) and value.is_integer():
        return int(value)
    if parameter.kind in ("list", "object") and isinstance(value, str):
        return parse_value(parameter, value)
    return value


def _with_full_stop(sentence: str) -> str:
    return sentence if sentence.endswith((".", "!", "?", "”")) else f"{sentence}."


def _check_hint(robot: Robot) -> str:
    if robot.virtual:
        return _("Start the virtual robot again.")
    return _("Check that it is switched on and connected to the same Wi-Fi.")


def remaining_input(action: Action, input: Mapping[str, object], call: RobotCall) -> dict[str, object] | None:
    """Return the input for the remaining part of a cancelled action; None if there is nothing left to do.

    An action that reports the remaining amount continues with that amount; other actions start again.
    If the amount is unknown (`is_remainder_unknown`), the robot could go too far, so the remaining part
    is skipped.

    Args:
        action: Description of the action.
        input: Input of the cancelled action.
        call: Cancelled command with the last feedback.
    """
    if not call.has_started:
        return dict(input)
    if is_remainder_unknown(action, input, call):
        return None
    name = remainder_parameter(action, input)
    if name is None:
        return dict(input)
    remaining, total = _float_or_zero(call.feedback.get(REMAINING_FIELD)), _float_or_zero(input[name])
    if abs(remaining) <= abs(total) / 1000:
        return None
    return {**input, name: math.copysign(min(abs(remaining), abs(total)), total)}


def is_remainder_unknown(action: Action, input: Mapping[str, object], call: RobotCall) -> bool:
    """Return True if it is not known how much of a cancelled action is left.

    This is the case for a started action that should report the remaining amount but has not, and for
    one that drives the robot and never reports it.
    """
    name = remainder_parameter(action, input)
    if not call.has_started or name is None:
        return call.has_started and action.risk == "locomotes"
    return not _is_number(call.feedback.get(REMAINING_FIELD))


def remainder_parameter(action: Action, input: Mapping[str, object]) -> str | None:
    """Return the parameter that the remaining amount refers to: the only number with the same unit.

    Returns None if there is no such parameter or more than one.
    """
    unit = next((field.unit for field in action.feedback if field.name == REMAINING_FIELD), None)
    matching_names = [
        parameter.name
        for parameter in action.parameters
        if unit is not None and parameter.unit == unit and _is_number(input.get(parameter.name))
    ]
    return matching_names[0] if len(matching_names) == 1 else None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _float_or_zero(value: object) -> float:
    return finite_float(value) or 0.0
