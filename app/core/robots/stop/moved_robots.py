"""Robots that have received a command and are not proven to stand still since then.

`MovedRobots` decides which robots a Stop must report. A robot is recorded before any message that moves
it is sent. It is removed when its own program confirms a Stop, when its own final reply ends the
motion, or when the user confirms that it has stopped. Being suspended, crashing, leaving the graph and
returning as another program do not remove a robot (docs/adr/0030-moved-robots.md).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from app.robots.client.stop_report import StopReport
from app.robots.identity import Identity
from nep.i18n import _, lazy

OnMoved: TypeAlias = Callable[[Sequence[str], str], object]
"""Callback before a message is sent, with the names of the robots that it moves and the kind of sender."""
UNKNOWN_SENDERS: tuple[str, str] = ("action", "stop")
"""Values of `UnconfirmedMotion.sender` for an action that didn't end and for an unproven Stop."""
MAX_MOTIONS = 64
"""Maximum number of motions of one robot that are tracked by id. Further motions end only with a Stop."""

_MESSAGES = {
    "form": lazy("{robot} received a command from a form and hasn't responded since"),
    "behaviour": lazy("{robot} received a command from a behaviour and hasn't responded since"),
    "shelf": lazy("{robot} received a command from a saved message and hasn't responded since"),
    "key": lazy("{robot} received a command from the keyboard and hasn't responded since"),
    "alarm": lazy("{robot} received a command from an alarm and hasn't responded since"),
    "replay": lazy("{robot} received a command from a replayed recording and hasn't responded since"),
    "bridge": lazy("{robot} received a command from a bridge and hasn't responded since"),
    "image": lazy("{robot} received a command from a click on an image and hasn't responded since"),
    "program": lazy("{robot} received a command from a Python program and hasn't responded since"),
    "action": lazy("{robot} couldn't stop an action and hasn't responded since"),
    "stop": lazy("{robot} hasn't confirmed Stop"),
}
"""Reason for each kind of sender. `_OTHER_MESSAGE` is used for other kinds."""
_OTHER_MESSAGE = lazy("{robot} received a command and hasn't responded since")


def ignore_moved(_names: Sequence[str], _sender: str) -> None:
    """Do nothing; the default `OnMoved`."""


@dataclass(frozen=True, slots=True)
class UnconfirmedMotion:
    """Command to a robot whose end has not been observed.

    Attributes:
        number: Serial number of the motion among all robots.
        sender: Kind of sender.
        since_s: Time of the command (monotonic seconds).
        program: Program of the robot at that time.
        id: Id of the invocation; "" if its end can't be observed.
    """

    number: int
    robot: str
    sender: str
    since_s: float
    program: Identity | None
    id: str = ""

    @property
    def is_sender_known(self) -> bool:
        """True if the sender of the command is known."""
        return self.sender not in UNKNOWN_SENDERS

    @property
    def reason(self) -> str:
        """Reason why the robot may still move, as a sentence without a full stop."""
        return _(_MESSAGES.get(self.sender, _OTHER_MESSAGE)).format(robot=self.robot)


class MovedRobots:
    """Record of the robots that may be moving. Not thread-safe; use it from the main thread."""

    def __init__(
        self,
        program_of: Callable[[str], Identity | None] = lambda _name: None,
        has_ended: Callable[[Identity], bool] = lambda _program: False,
        clock: Callable[[], float] = time.monotonic,
        other_programs_of: Callable[[str], Iterable[Identity]] = lambda _name: (),
    ) -> None:
        # `other_programs_of` returns other programs that receive a robot's commands and publish its replies.
        self._program_of, self._has_ended, self._clock = program_of, has_ended, clock
        self._other_programs_of = other_programs_of
        self._motions: dict[str, list[UnconfirmedMotion]] = {}
        self._last_number = 0
        self._recent_commands: dict[str, UnconfirmedMotion] = {}
        """Newest command to each robot, as far as sent since the last but one graph."""
        self._proven_stops: dict[str, int] = {}
        """Value of `mark` at each proven Stop since the last but one graph, by node id of the program."""
        self._graph_mark = 0
        """Value of `mark` when the newest graph arrived."""

    def __contains__(self, name: object) -> bool:
        return name in self._motions

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the robots that may be moving, in the order of their commands."""
        return tuple(self._motions)

    @property
    def mark(self) -> int:
        """Number of the newest motion. A Stop that starts now does not end motions with greater numbers."""
        return self._last_number

    @property
    def recently_commanded(self) -> tuple[str, ...]:
        """Names of the robots that received a command after the second newest graph."""
        return tuple(self._recent_commands)

    def motion(self, name: str) -> UnconfirmedMotion | None:
        """Return the newest motion of a robot; None if the robot isn't recorded.

        Motions with a known sender take precedence over unfinished actions and unproven Stops.
        """
        motions = self._motions.get(name, [])
        candidates = [motion for motion in motions if motion.is_sender_known] or motions
        return candidates[-1] if candidates else None

    def other_programs(self, name: str, current: Identity | None) -> tuple[Identity, ...]:
        """Return other programs that received commands of a robot and may still be running.

        Args:
            name: Name of the robot.
            current: Robot's own program.
        """
        other_programs = {
            motion.program.node_id: motion.program
            for motion in self._motions.get(name, ())
            if motion.program is not None
            and (current is None or motion.program.node_id != current.node_id)
            and not self._has_ended(motion.program)
        }
        return tuple(other_programs.values())

    def record_command(
        self, names: Iterable[str], sender: str, *, id: str = "", program: Identity | None = None
    ) -> None:
        """Record that robots are about to receive a command that may move them. Call this before sending.

        Args:
            names: Names of the robots.
            sender: Kind of sender: "form", "behaviour", "shelf", "key", "alarm", "replay", "bridge", ...
            id: Id of the invocation whose final reply ends the motion; "" if there is none.
            program: Program of the robot; default: the current one.
        """
        for name in names:
            self._last_number += 1
            target_program = program if program is not None else self._program_of(name)
            motion = UnconfirmedMotion(self._last_number, name, sender, self._clock(), target_program, id)
            motions = self._motions.setdefault(name, [])
            if not id or len(motions) >= MAX_MOTIONS:  # of motions that end together only the newest is kept
                motion = replace(motion, id="")
                motions[:] = [
                    each
                    for each in motions
                    if each.id or (each.sender, each.program) != (sender, motion.program)
                ]
            motions.append(motion)
            if program is None:
                self._recent_commands[name] = motion
                self._record_others(name, sender, motions)

    def _record_others(self, name: str, sender: str, motions: list[UnconfirmedMotion]) -> None:
        # Other programs of the same robot received the command too: a frozen one may execute it when it
        # resumes.
        recorded_programs = {motion.program for motion in motions if not motion.id}
        for other in self._other_programs_of(name):
            if other not in recorded_programs and len(motions) < MAX_MOTIONS:
                motions.append(UnconfirmedMotion(self._last_number, name, sender, self._clock(), other))

    def record_new_programs(self, new_programs: Mapping[str, Iterable[Identity]]) -> None:
        """Record commands that newly listed programs may have received before the graph listed them.

        Call this once for each graph. A graph is older than the call, so all commands after the second
        newest graph count.

        Args:
            new_programs: New programs of each robot in `recently_commanded`.
        """
        for name, programs in new_programs.items():
            command, motions = self._recent_commands[name], self._motions.get(name, [])
            recorded_programs = {motion.program for motion in motions if motion.number >= command.number}
            for program in programs:
                has_stopped = self._proven_stops.get(program.node_id, -1) >= command.number
                if program not in recorded_programs and not has_stopped and len(motions) < MAX_MOTIONS:
                    motions.append(replace(command, program=program, id=""))
            if motions:
                self._motions[name] = motions
        previous_mark, self._graph_mark = self._graph_mark, self._last_number
        self._recent_commands = {
            name: command for name, command in self._recent_commands.items() if command.number > previous_mark
        }
        self._proven_stops = {node: mark for node, mark in self._proven_stops.items() if mark > previous_mark}

    def end_motion(self, name: str, id: str, program: Identity | None = None) -> None:
        """End a motion after the program that executed it has sent the final reply.

        Args:
            name: Name of the robot.
            id: Id of the invocation; with "", nothing is ended.
            program: Program that replied; None ends the motion of every program.
        """

        def is_other_motion(motion: UnconfirmedMotion) -> bool:
            if motion.id != id or program is None or motion.program is None:
                return motion.id != id
            return program.node_id != motion.program.node_id

        if id:
            self._retain_motions(name, is_other_motion)

    def record_stopped(self, name: str, programs: Collection[str], mark: int) -> None:
        """End the motions of programs that confirmed a Stop. Motions of other programs remain.

        Args:
            name: Name of the robot.
            programs: Node ids of the programs.
            mark: Value of `mark` when the Stop started.
        """
        self._proven_stops |= dict.fromkeys(programs, mark)
        self._retain_motions(
            name,
            lambda motion: (
                motion.number > mark
                or (
                    motion.program is not None
                    and motion.program.node_id not in programs
                    and not self._has_ended(motion.program)
                )
            ),
        )

    def apply_report(self, report: StopReport, mark: int) -> None:
        """Apply the report of a Stop, for robots that are proven to have stopped and for all others.

        Args:
            report: Result of the Stop.
            mark: Value of `mark` when the Stop started.
        """
        self.record_command((name for name in report.unconfirmed_names if name not in self), "stop")
        for name in report.stopped_names:
            self.record_stopped(name, report.confirmed_programs(name), mark)
        for name in set(report.names) - {*report.unconfirmed_names, *report.stopped_names}:
            self.record_stop_received(name, mark)

    def record_stop_received(self, name: str, mark: int) -> None:
        """End the motions of a robot that received a Stop but can't confirm it (RIZE).

        Args:
            name: Name of the robot.
            mark: Value of `mark` when the Stop started.
        """
        self._retain_motions(name, lambda motion: motion.number > mark)
        if name in self._recent_commands and self._recent_commands[name].number <= mark:
            del self._recent_commands[name]

    def confirm(self, names: Iterable[str]) -> None:
        """Remove robots that have stopped according to the user."""
        for name in names:
            self._motions.pop(name, None)
            self._recent_commands.pop(name, None)

    def drop_ended(self, name: str) -> None:
        """End the motions of a virtual robot whose program has exited.

        A virtual robot stops with its program.
        """
        self._retain_motions(
            name, lambda motion: motion.program is None or not self._has_ended(motion.program)
        )

    def _retain_motions(self, name: str, is_retained: Callable[[UnconfirmedMotion], bool]) -> None:
        retained = [motion for motion in self._motions.get(name, ()) if is_retained(motion)]
        if retained:
            self._motions[name] = retained
        else:
            self._motions.pop(name, None)
