"""What robots go on doing when its command has ended (a speed): a pause holds it, Go on asks for it again."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from app.blocks.link import Call
from app.robots.description import Robot


@dataclass(frozen=True)
class _Motion:
    robot: Robot
    action: str
    input: Mapping[str, object]
    uses: frozenset[str]


class Going:
    """Remembers motions that were begun; `rest` and `go_on` come from another thread than the answers."""

    def __init__(
        self, stop: Callable[[Robot], None], invoke: Callable[[str, str, Mapping[str, object]], object]
    ) -> None:
        """`stop` makes a robot stand still, `invoke` gives a command anew."""
        self._stop, self._invoke = stop, invoke
        self._lock = threading.Lock()
        self._asked: dict[str, _Motion] = {}  # by the id of its command, until it is answered
        self._motions: dict[tuple[str, str], _Motion] = {}  # by robot and action
        self._resting = False

    def asked(self, call: Call, robot: Robot, input: Mapping[str, object]) -> None:
        """A command goes out: what it uses is not in the earlier motion any more."""
        action = robot.action(call.action)
        if action is None:
            return
        motion = _Motion(robot, call.action, dict(input), frozenset(action.uses))
        with self._lock:
            self._motions = {
                key: known
                for key, known in self._motions.items()
                if known.robot.name != robot.name or not known.uses & motion.uses
            }
            if action.repeat_s is not None:
                self._asked[call.id] = motion

    def ended(self, call: Call) -> None:
        """A command has had its last answer."""
        with self._lock:
            motion = self._asked.pop(call.id, None)
            if motion is None or call.state != "succeeded":
                return
            self._motions[motion.robot.name, motion.action] = motion
            rests = self._resting
        if rests:  # a single step of a paused program began it
            self._stop(motion.robot)

    def rest(self) -> tuple[str, ...]:
        """The program is paused: whatever goes on stands still. The names of the robots that are told."""
        with self._lock:
            self._resting = True
            moving = {motion.robot.name: motion.robot for motion in self._motions.values()}
        for robot in moving.values():
            self._stop(robot)
        return tuple(moving)

    def go_on(self) -> None:
        """The program goes on, and so do the motions."""
        with self._lock:
            if not self._resting:
                return
            self._resting = False
            motions = list(self._motions.values())
        for motion in motions:
            self._invoke(motion.robot.name, motion.action, motion.input)
