"""Robots that were told to move and have not proven since that they stand still.

`MovedRobots` is the one source for which robots a Stop must name. A robot enters when something that moves it
is sent, by whatever sent it. It leaves when its own program answered a Stop as still, when the end of the
motion was seen in the robot's own final answer, or when a person confirms that it stands still. Freezing,
dying, leaving the graph and coming back as another program do not remove it (docs/adr/0030-moved-robots.md).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from app.core.robots.stop.report import StopReport
from app.robots.identity import Identity
from nep.i18n import _, lazy

OnMoved: TypeAlias = Callable[[Sequence[str], str], object]
"""Called with the robots that a message moves, and what sends it, before it is sent."""
UNKNOWN: tuple[str, str] = ("action", "stop")
"""Not what moved a robot: it says itself that it could not end an action, or it did not prove a Stop."""
MAX_MOTIONS = 64
"""Motions of one robot that are told apart by their ids; further ones end only with a Stop."""

_SENTENCES = {
    "form": lazy("{robot} got a command from a form and has not answered since"),
    "behaviour": lazy("{robot} got a command from a behaviour and has not answered since"),
    "shelf": lazy("{robot} got a command from a message of the publish shelf and has not answered since"),
    "key": lazy("{robot} got a command from a key and has not answered since"),
    "alarm": lazy("{robot} got a command from an alarm and has not answered since"),
    "replay": lazy("{robot} got a command from a replayed recording and has not answered since"),
    "bridge": lazy("{robot} got a command from a bridge and has not answered since"),
    "image": lazy("{robot} got a command from a click on a picture and has not answered since"),
    "program": lazy("{robot} got a command from a Python program and has not answered since"),
    "action": lazy("{robot} could not end an action and has not answered since"),
    "stop": lazy("{robot} has not answered Stop"),
}
"""By what moved it; anything else is `_OTHER`."""
_OTHER = lazy("{robot} got a command and has not answered since")


def ignore_moved(_names: Sequence[str], _by: str) -> None:
    """Default `OnMoved`: nothing keeps the motion."""


@dataclass(frozen=True, slots=True)
class UnprovenMotion:
    """Something that a robot was told to do and that nobody has seen to end.

    ``number`` counts all motions, ``since_s`` is monotonic, ``program`` is the robot's program at that time.
    ``id`` is that of the invocation; "" when its end can't be seen.
    """

    number: int
    robot: str
    by: str
    since_s: float
    program: Identity | None
    id: str = ""

    @property
    def is_known(self) -> bool:
        """Whether it is known what moved the robot."""
        return self.by not in UNKNOWN

    @property
    def sentence(self) -> str:
        """Why nobody knows that the robot stands still, without a full stop."""
        return _(_SENTENCES.get(self.by, _OTHER)).format(robot=self.robot)


class MovedRobots:
    """Ledger of robots that may move. One thread uses it (the window's)."""

    def __init__(
        self,
        program_of: Callable[[str], Identity | None] = lambda _name: None,
        has_ended: Callable[[Identity], bool] = lambda _program: False,
        clock: Callable[[], float] = time.monotonic,
        others_of: Callable[[str], Iterable[Identity]] = lambda _name: (),
    ) -> None:
        """Nothing has moved yet.

        Args:
            program_of: Returns the program that a robot is now.
            has_ended: Whether it is certain that a program does not run any more.
            clock: Monotonic seconds.
            others_of: Returns other programs that hear a robot's commands now and answer them.
        """
        self._program_of, self._has_ended, self._clock = program_of, has_ended, clock
        self._others_of = others_of
        self._motions: dict[str, list[UnprovenMotion]] = {}
        self._count = 0
        self._sent: dict[str, UnprovenMotion] = {}
        """Newest command to each robot since the graph before the last one."""
        self._proven: dict[str, int] = {}
        """Marks of Stops proven by programs since then, by node id."""
        self._graph_mark = 0
        """`mark` at the newest graph."""

    def __contains__(self, name: object) -> bool:
        return name in self._motions

    @property
    def names(self) -> tuple[str, ...]:
        """The robots that may move, in the order in which they were told to."""
        return tuple(self._motions)

    @property
    def mark(self) -> int:
        """Number of the newest motion. A Stop that begins now proves nothing about later ones."""
        return self._count

    @property
    def sent_to(self) -> tuple[str, ...]:
        """Robots with a command since the graph before the last one."""
        return tuple(self._sent)

    def motion(self, name: str) -> UnprovenMotion | None:
        """The newest motion of a robot whose cause is known, or None when it is not in the ledger.

        That an action or a Stop did not end is told only when nothing else is known.
        """
        found = self._motions.get(name, [])
        known = [motion for motion in found if motion.is_known] or found
        return known[-1] if known else None

    def other_programs(self, name: str, current: Identity | None) -> tuple[Identity, ...]:
        """Programs besides the ``current`` one under which a robot was moved and that may still run."""
        others = {
            motion.program.node_id: motion.program
            for motion in self._motions.get(name, ())
            if motion.program is not None
            and (current is None or motion.program.node_id != current.node_id)
            and not self._has_ended(motion.program)
        }
        return tuple(others.values())

    def note(self, names: Iterable[str], by: str, *, id: str = "", program: Identity | None = None) -> None:
        """Enter robots that are told to move; call this before the message is sent.

        Args:
            names: The robots.
            by: What moves them: "form", "behaviour", "shelf", "key", "alarm", "replay", "bridge", ...
            id: Of the invocation, when the robot's final answer to it ends the motion.
            program: The robot's program, when it is not the one that it is now.
        """
        for name in names:
            self._count += 1
            meant = program if program is not None else self._program_of(name)
            motion = UnprovenMotion(self._count, name, by, self._clock(), meant, id)
            found = self._motions.setdefault(name, [])
            if not id or len(found) >= MAX_MOTIONS:  # the newest of several that end together stands for them
                motion = replace(motion, id="")
                found[:] = [
                    each for each in found if each.id or (each.by, each.program) != (by, motion.program)
                ]
            found.append(motion)
            if program is None:
                self._sent[name] = motion
                self._note_others(name, by, found)

    def _note_others(self, name: str, by: str, found: list[UnprovenMotion]) -> None:
        """Enter other programs of the robot's name: one that is frozen may obey when it goes on."""
        known = {motion.program for motion in found if not motion.id}
        for other in self._others_of(name):
            if other not in known and len(found) < MAX_MOTIONS:
                found.append(UnprovenMotion(self._count, name, by, self._clock(), other))

    def take_newcomers(self, newcomers: Mapping[str, Iterable[Identity]]) -> None:
        """Note the commands that programs may have received which a new graph lists for the first time.

        A program can receive a command before the graph lists it. Call this once per graph. A graph is older
        than the call, so commands since the graph before the last one count.

        Args:
            newcomers: New programs by robot, for robots in `sent_to`.
        """
        for name, programs in newcomers.items():
            sent, found = self._sent[name], self._motions.get(name, [])
            known = {motion.program for motion in found if motion.number >= sent.number}
            for program in programs:
                is_still = self._proven.get(program.node_id, -1) >= sent.number
                if program not in known and not is_still and len(found) < MAX_MOTIONS:
                    found.append(replace(sent, program=program, id=""))
            if found:
                self._motions[name] = found
        last, self._graph_mark = self._graph_mark, self._count
        self._sent = {name: sent for name, sent in self._sent.items() if sent.number > last}
        self._proven = {node: mark for node, mark in self._proven.items() if mark > last}

    def ended(self, name: str, id: str, program: Identity | None = None) -> None:
        """Take over the final answer of a robot's program to an invocation: for this program it has ended."""

        def stays(motion: UnprovenMotion) -> bool:
            if motion.id != id or program is None or motion.program is None:
                return motion.id != id
            return program.node_id != motion.program.node_id

        if id:
            self._keep(name, stays)

    def stood_still(self, name: str, programs: Collection[str], mark: int) -> None:
        """Programs of a robot, by node id, proved a Stop that began at ``mark``: it stands still.

        What a program was told that has not answered, and may still run, remains.
        """
        self._proven |= dict.fromkeys(programs, mark)
        self._keep(
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

    def take(self, report: StopReport, mark: int) -> None:
        """Take over what a Stop that began at ``mark`` proved, and which robots it did not prove still."""
        self.note((name for name in report.silent if name not in self), "stop")
        for name in report.still:
            self.stood_still(name, report.programs(name), mark)
        for name in set(report.names) - {*report.silent, *report.still}:
            self.told(name, mark)

    def told(self, name: str, mark: int) -> None:
        """A robot that can't confirm (RIZE) was told to stop at ``mark``; nothing more can be known."""
        self._keep(name, lambda motion: motion.number > mark)
        if name in self._sent and self._sent[name].number <= mark:
            del self._sent[name]

    def confirm(self, names: Iterable[str]) -> None:
        """A person says that these robots stand still."""
        for name in names:
            self._motions.pop(name, None)
            self._sent.pop(name, None)

    def drop_ended(self, name: str) -> None:
        """Forget what ended programs were told: a virtual robot is its program, and moves no more."""
        self._keep(name, lambda motion: motion.program is None or not self._has_ended(motion.program))

    def _keep(self, name: str, stays: Callable[[UnprovenMotion], bool]) -> None:
        left = [motion for motion in self._motions.get(name, ()) if stays(motion)]
        if left:
            self._motions[name] = left
        else:
            self._motions.pop(name, None)
