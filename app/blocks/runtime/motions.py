"""Motions that continue after their command has ended (such as a speed), and their pausing with the program.

With a delay between blocks, motions are also stopped while the script that started them waits at a block;
otherwise the robot would drive too far.
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
    script: int  # thread of the script that started it


class Motions:
    """Tracker of motions that continue after their command has ended.

    Thread-safe: `stop_all` and `resume_all` are called in a different thread than `record_final_reply`.

    Args:
        stop: Stops all actions of a robot.
        stop_motion: Stops a robot if it runs no action except such motions.
        invoke: Sends a command (robot, action, input) again.
    """

    def __init__(
        self,
        stop: Callable[[Robot], None],
        stop_motion: Callable[[Robot], None],
        invoke: Callable[[str, str, Mapping[str, object]], object],
    ) -> None:
        self._stop, self._stop_motion, self._invoke = stop, stop_motion, invoke
        self._lock = threading.Lock()
        self._pending_motions: dict[str, _Motion] = {}  # by command id, until the final reply
        self._motions: dict[tuple[str, str], _Motion] = {}  # by robot and action
        self._is_paused = False
        self._delayed_scripts: set[int] = set()  # scripts waiting at a block
        self._script_override = threading.local()

    def record_command(self, call: RobotCall, robot: Robot, input: Mapping[str, object]) -> None:
        """Record a new command, which ends earlier motions that use the same resources.

        Args:
            call: Command.
            robot: Description of the robot.
            input: Input of the action.
        """
        action = robot.action(call.action)
        if action is None:
            return
        motion = _Motion(robot, call.action, dict(input), frozenset(action.uses), self._script_id())
        with self._lock:
            self._motions = {
                key: existing
                for key, existing in self._motions.items()
                if existing.robot.name != robot.name or not existing.uses & motion.uses
            }
            if action.repeat_s is not None:
                self._pending_motions[call.id] = motion

    def is_motion(self, call: RobotCall) -> bool:
        """Return True if a pending command starts a motion that continues after the command."""
        with self._lock:
            return call.id in self._pending_motions

    def record_final_reply(self, call: RobotCall) -> None:
        """Record the final reply to a command, which may have started a motion.

        The motion is stopped at once if the program is paused or the script waits at a block.
        """
        with self._lock:
            motion = self._pending_motions.pop(call.id, None)
            if motion is None:
                return
            is_delayed = motion.script in self._delayed_scripts
            if call.state != "succeeded" and not (is_delayed and call.state == "canceled"):
                return
            self._motions[motion.robot.name, motion.action] = motion
            is_paused = self._is_paused
        if is_paused:  # started by a single step of a paused program
            self._stop(motion.robot)
        elif is_delayed:
            self._stop_motion(motion.robot)

    def stop_all(self) -> tuple[str, ...]:
        """Stop all motions until `resume_all`, and return the names of the stopped robots."""
        with self._lock:
            self._is_paused = True
            moving = {motion.robot.name: motion.robot for motion in self._motions.values()}
        for robot in moving.values():
            self._stop(robot)
        return tuple(moving)

    def resume_all(self) -> None:
        """Resume the motions that `stop_all` stopped."""
        with self._lock:
            if not self._is_paused:
                return
            self._is_paused = False
            motions = [each for each in self._motions.values() if each.script not in self._delayed_scripts]
        self._resume(motions)

    @contextmanager
    def suspend(self) -> Iterator[None]:
        """Return a context manager that stops the motions of the calling script during a delay at a block."""
        script = self._script_id()
        with self._lock:
            moving = {
                motion.robot.name: motion.robot
                for motion in (*self._motions.values(), *self._pending_motions.values())
                if motion.script == script
            }
            self._delayed_scripts.add(script)
            is_paused = self._is_paused
        for robot in moving.values():
            if not is_paused:
                self._stop_motion(robot)
        yield
        # Not reached if the program was stopped, so that nothing starts again.
        with self._lock:
            self._delayed_scripts.discard(script)
            is_paused = self._is_paused
            motions = [motion for motion in self._motions.values() if motion.script == script]
        if moving and not is_paused:
            self._resume(motions)

    def _resume(self, motions: list[_Motion]) -> None:
        for motion in motions:
            self._script_override.script = motion.script
            try:
                self._invoke(motion.robot.name, motion.action, motion.input)
            finally:
                del self._script_override.script

    def _script_id(self) -> int:
        # Another script than the thread's own while motions are resumed.
        return getattr(self._script_override, "script", None) or threading.get_ident()
