"""What robots go on doing when its command has ended (a speed): a pause holds it, Go on asks for it again.

So does slow motion while the script that asked for it stays at a block: it would drive too far.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from app.blocks.runtime.link import RobotCall
from app.robots.description.description import Robot


@dataclass(frozen=True)
class _Motion:
    robot: Robot
    action: str
    input: Mapping[str, object]
    uses: frozenset[str]
    script: int  # the thread of the script that asked for it


class Motions:
    """Remembers motions that were begun; `rest` and `go_on` come from another thread than the answers."""

    def __init__(
        self,
        stop: Callable[[Robot], None],
        stand: Callable[[Robot], None],
        invoke: Callable[[str, str, Mapping[str, object]], object],
    ) -> None:
        """`stop` makes a robot end all it does, `stand` only its motion, `invoke` gives a command anew."""
        self._stop, self._stand, self._invoke = stop, stand, invoke
        self._lock = threading.Lock()
        self._asked: dict[str, _Motion] = {}  # by the id of its command, until it is answered
        self._motions: dict[tuple[str, str], _Motion] = {}  # by robot and action
        self._resting = False
        self._slow: set[int] = set()  # scripts that stay at a block
        self._for = threading.local()

    def asked(self, call: RobotCall, robot: Robot, input: Mapping[str, object]) -> None:
        """A command goes out: what it uses is not in the earlier motion any more."""
        action = robot.action(call.action)
        if action is None:
            return
        motion = _Motion(robot, call.action, dict(input), frozenset(action.uses), self._script())
        with self._lock:
            self._motions = {
                key: known
                for key, known in self._motions.items()
                if known.robot.name != robot.name or not known.uses & motion.uses
            }
            if action.repeat_s is not None:
                self._asked[call.id] = motion

    def is_motion(self, call: RobotCall) -> bool:
        """Whether a command that is not answered yet begins a motion."""
        with self._lock:
            return call.id in self._asked

    def ended(self, call: RobotCall) -> None:
        """A command has had its last answer."""
        with self._lock:
            motion = self._asked.pop(call.id, None)
            if motion is None:
                return
            slow = motion.script in self._slow
            if call.state != "succeeded" and not (slow and call.state == "canceled"):
                return
            self._motions[motion.robot.name, motion.action] = motion
            rests = self._resting
        if rests:  # a single step of a paused program began it
            self._stop(motion.robot)
        elif slow:
            self._stand(motion.robot)

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
            motions = [each for each in self._motions.values() if each.script not in self._slow]
        self._ask_again(motions)

    @contextmanager
    def slow(self) -> Iterator[None]:
        """The calling script stays at a block in slow motion: what it lets drive stands still meanwhile."""
        script = self._script()
        with self._lock:
            moving = {
                motion.robot.name: motion.robot
                for motion in (*self._motions.values(), *self._asked.values())
                if motion.script == script
            }
            self._slow.add(script)
            rests = self._resting
        for robot in moving.values():
            if not rests:
                self._stand(robot)
        yield
        # Not when the program was stopped meanwhile: then nothing is to drive again.
        with self._lock:
            self._slow.discard(script)
            rests = self._resting
            motions = [motion for motion in self._motions.values() if motion.script == script]
        if moving and not rests:
            self._ask_again(motions)

    def _ask_again(self, motions: list[_Motion]) -> None:
        for motion in motions:
            self._for.script = motion.script
            try:
                self._invoke(motion.robot.name, motion.action, motion.input)
            finally:
                del self._for.script

    def _script(self) -> int:
        """The script for which this thread asks: its own, but in `go_on`."""
        return getattr(self._for, "script", None) or threading.get_ident()
