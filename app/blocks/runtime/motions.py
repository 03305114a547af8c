"""Motions that continue after their command has ended (such as a speed), and their pausing with the program.

With a delay between blocks, motions are also stopped while the script that started them waits at a block;
otherwise the robot would drive too far. While a group of scripts is held, the motions of its scripts are
stopped, and commands of other groups don't replace them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from app.blocks.runtime.link import RobotCall
from app.blocks.runtime.scheduler import Script, ScriptGroup, acting_for, current_script
from app.robots.description.description import Robot


@dataclass(frozen=True)
class _Motion:
    robot: Robot
    action: str
    input: Mapping[str, object]
    uses: frozenset[str]
    script: Script | None  # script that started it

    @property
    def group(self) -> ScriptGroup | None:
        return None if self.script is None else self.script.group


class Motions:
    """Tracker of motions that continue after their command has ended.

    Thread-safe: `stop_all` and `resume_all` are called in a different thread than `record_final_reply`.

    Args:
        stop: Stops all actions of a robot.
        stop_motion: Stops a robot if it runs no action except such motions, and returns True if so.
        invoke: Sends a command (robot, action, input) again.
    """

    def __init__(
        self,
        stop: Callable[[Robot], None],
        stop_motion: Callable[[Robot], bool],
        invoke: Callable[[str, str, Mapping[str, object]], object],
    ) -> None:
        self._stop, self._stop_motion, self._invoke = stop, stop_motion, invoke
        self._lock = threading.Lock()
        self._pending_motions: dict[str, _Motion] = {}  # by command id, until the final reply
        self._motions: list[_Motion] = []
        self._is_paused = False
        self._delayed_scripts: set[Script | None] = set()  # scripts waiting at a block
        self._held_groups: set[ScriptGroup] = set()
        self._unstopped_robots: set[str] = set()  # moved by a held group until their pending actions end

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
        motion = _Motion(robot, call.action, dict(input), frozenset(action.uses), current_script())
        with self._lock:
            self._motions = [each for each in self._motions if not self._replaces_locked(motion, each)]
            if action.repeat_s is not None:
                self._pending_motions[call.id] = motion

    def is_motion(self, call: RobotCall) -> bool:
        """Return True if a pending command starts a motion that continues after the command."""
        with self._lock:
            return call.id in self._pending_motions

    def record_final_reply(self, call: RobotCall) -> None:
        """Record the final reply to a command, which may have started a motion.

        The motion is stopped at once if the program is paused, the script waits at a block or its group is
        held.
        """
        self._stop_held(call.robot)
        with self._lock:
            motion = self._pending_motions.pop(call.id, None)
            if motion is None:
                return
            is_delayed = motion.script in self._delayed_scripts or motion.group in self._held_groups
            if call.state != "succeeded" and not (is_delayed and call.state == "canceled"):
                return
            self._motions = [each for each in self._motions if not _is_same(each, motion)]
            self._motions.append(motion)
            is_paused = self._is_paused
        if is_paused:  # started by a single step of a paused program
            self._stop(motion.robot)
        elif is_delayed:
            self._stop_motion(motion.robot)

    def _replaces_locked(self, motion: _Motion, existing: _Motion) -> bool:
        # The motion of a held group is stopped; its group resumes it.
        if existing.group in self._held_groups and existing.group is not motion.group:
            return False
        return existing.robot.name == motion.robot.name and bool(existing.uses & motion.uses)

    def _is_suspended_locked(self, motion: _Motion) -> bool:
        return motion.script in self._delayed_scripts or motion.group in self._held_groups

    # ---- groups

    def hold(self, group: ScriptGroup) -> None:
        """Stop the motions of a group's scripts until `resume`.

        A robot that performs an action is stopped when the action has ended.

        Args:
            group: Group of scripts.
        """
        with self._lock:
            self._held_groups.add(group)
            robots = {each.robot.name: each.robot for each in self._motions if each.group is group}
        for robot in robots.values():
            if not self._stop_motion(robot):
                with self._lock:
                    self._unstopped_robots.add(robot.name)

    def resume(self, group: ScriptGroup) -> None:
        """Resume the motions that `hold` stopped.

        Args:
            group: Group of scripts.
        """
        with self._lock:
            self._held_groups.discard(group)
            motions = [
                each for each in self._motions if each.group is group and not self._is_suspended_locked(each)
            ]
            is_paused = self._is_paused
        if not is_paused:
            self._resume(motions)

    def end(self, group: ScriptGroup) -> None:
        """Stop and discard the motions of a group's scripts.

        Args:
            group: Group of scripts.
        """
        self.hold(group)
        with self._lock:
            self._held_groups.discard(group)
            self._motions = [each for each in self._motions if each.group is not group]

    def _stop_held(self, name: str) -> None:
        with self._lock:
            if name not in self._unstopped_robots:
                return
            motions = [each for each in self._motions if each.robot.name == name]
            # A stop would end the motions of other groups, too.
            is_alone = bool(motions) and all(map(self._is_suspended_locked, motions))
            if not is_alone:
                self._unstopped_robots.discard(name)
                return
        if self._stop_motion(motions[0].robot):
            with self._lock:
                self._unstopped_robots.discard(name)

    # ---- pause

    def stop_all(self) -> tuple[str, ...]:
        """Stop all motions until `resume_all`, and return the names of the stopped robots."""
        with self._lock:
            self._is_paused = True
            moving = {motion.robot.name: motion.robot for motion in self._motions}
        for robot in moving.values():
            self._stop(robot)
        return tuple(moving)

    def resume_all(self) -> None:
        """Resume the motions that `stop_all` stopped."""
        with self._lock:
            if not self._is_paused:
                return
            self._is_paused = False
            motions = [each for each in self._motions if not self._is_suspended_locked(each)]
        self._resume(motions)

    @contextmanager
    def suspend(self) -> Iterator[None]:
        """Return a context manager that stops the motions of the calling script during a delay at a block."""
        script = current_script()
        with self._lock:
            moving = {
                motion.robot.name: motion.robot
                for motion in (*self._motions, *self._pending_motions.values())
                if motion.script is script
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
            motions = [
                motion
                for motion in self._motions
                if motion.script is script and not self._is_suspended_locked(motion)
            ]
        if moving and not is_paused:
            self._resume(motions)

    def _resume(self, motions: list[_Motion]) -> None:
        for motion in motions:
            with acting_for(motion.script):
                self._invoke(motion.robot.name, motion.action, motion.input)


def _is_same(first: _Motion, second: _Motion) -> bool:
    return (first.robot.name, first.action, first.group) == (second.robot.name, second.action, second.group)
