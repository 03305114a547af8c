"""Which real robots may move: a person is asked once for each robot, before it moves for the first time.

A virtual robot may always, if Studio knows the program that it is (`app.core.robots.launcher`).
Everything that makes a robot act comes through here: the forms, the palette, keys and programs, also those
that publish on a robot's topics. Stop does not. A yes counts for the program that the robot is now, *always*
for its name, model, program and computer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.blocks.model.program import Program
from app.core.storage.settings import ListSettings
from app.errors import AppError
from app.robots.description.description import Robot
from app.robots.identity import Identity
from nep.i18n import _, listed, ngettext, pgettext
from nep.programs.robots.moving import RIZE_COMMANDS

ALWAYS = "robots.may_move"
MOST_NAMED = 4


class MayNotMoveError(AppError):
    """Nobody has said yet that these robots may move; the question stands."""

    def __init__(self, names: Sequence[str]) -> None:
        """Make the sentence from the robots' names."""
        self.names = tuple(names)
        super().__init__(
            _("{robots} may not move yet; answer the question above first").format(robots=listed(list(names)))
        )


@dataclass(frozen=True)
class Question:
    """May these robots move? ``moves`` names for each what it would do, in the words of its description.

    ``strangers`` would be moved, too: names of robots that could not be read, or topics of unknown robots.
    ``reason`` is a sentence that says what asks, "" when the person has just asked for it themselves.
    """

    moves: Mapping[str, tuple[str, ...]]
    go_on: Callable[[], object]
    strangers: tuple[str, ...] = ()
    reason: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """All of them, for people."""
        return (*self.moves, *map(_stranger, self.strangers))

    @property
    def title(self) -> str:
        """In bold: "Let Rover move?"."""
        return _("Allow {robots} to move?").format(robots=listed(list(self.names)))

    @property
    def sentence(self) -> str:
        """What would move, and how it is stopped."""
        told = [self.reason] if self.reason else []
        told += [
            ngettext("{actions} moves {robot}.", "{actions} move {robot}.", len(actions)).format(
                actions=listed(actions), robot=name
            )
            for name, actions in self.moves.items()
        ]
        if self.strangers:
            names = listed([_stranger(each) for each in self.strangers])
            said = _("The message may move {robot}, which Studio doesn't know.")
            told.append(said.format(robot=names))
        return _("{moves} Make sure nobody is in the way. Press F12 to stop at any time.").format(
            moves=" ".join(told)
        )


class MotionPermission:
    """Who may move. One thread uses it (the window's)."""

    def __init__(
        self,
        settings: ListSettings | None = None,
        identity_of: Callable[[str], Identity | None] = lambda _name: None,
    ) -> None:
        """`settings` keep the robots that may always; `identity_of` tells the program that a robot is."""
        self._settings, self._identity_of = settings, identity_of
        self._allowed: set[str] = set()
        self.strangers: frozenset[str] = frozenset()
        """Robots without a readable description, and topics of unknown robots, that may move."""
        self._asked: tuple[tuple[str, str], ...] = ()
        self.question: Question | None = None
        """What a person is to answer now."""
        self.revision = 0

    def allowed(self, robot: Robot) -> bool:
        """Whether this robot may move without being asked for."""
        return robot.virtual or self._now(robot) in self._allowed or self._key(robot) in self._always()

    def permits(
        self,
        wanted: Iterable[tuple[Robot, Sequence[str]]],
        go_on: Callable[[], object],
        strangers: Iterable[str] = (),
        reason: str = "",
    ) -> bool:
        """Whether these robots may do these actions now, and ``strangers`` anything (see `Question`).

        If not, the question stands, and `go_on` is called when the answer is yes.
        """
        asked = [(robot, risky(robot, actions)) for robot, actions in wanted if not self.allowed(robot)]
        open_ = [(robot, moves) for robot, moves in asked if moves]
        unknown = tuple(name for name in strangers if name not in self.strangers)
        if not open_ and not unknown:
            return True
        self._asked = tuple((self._now(robot), self._key(robot)) for robot, _key in open_)
        self.question = Question({robot.name: moves for robot, moves in open_}, go_on, unknown, reason)
        self.revision += 1
        return False

    def answer(self, *, let: bool, always: bool = False) -> None:
        """The person has answered; a yes goes on with what was wanted. SettingsError if it can't be kept."""
        question, self.question = self.question, None
        self.revision += 1
        if question is None or not let:
            return
        self._allowed.update(now for now, _key in self._asked)
        self.strangers |= set(question.strangers)
        try:
            if always and self._settings is not None:
                self._settings.set(ALWAYS, sorted({*self._always(), *(key for _now, key in self._asked)}))
        finally:
            question.go_on()

    def withdraw(self) -> None:
        """What was asked is not wanted any more (Stop was pressed, the robot has gone)."""
        if self.question is not None:
            self.question = None
            self.revision += 1

    def forget(self) -> None:
        """Ask again before any robot moves."""
        self._allowed.clear()
        self.strangers = frozenset()
        self.revision += 1
        if self._settings is not None:
            self._settings.set(ALWAYS, [])

    def _key(self, robot: Robot) -> str:
        """What *always* is kept for: who announces another robot under this name is not meant."""
        identity = self._identity_of(robot.name)
        return f"{robot.name} ({robot.model})" + (f", {identity.words}" if identity is not None else "")

    def _now(self, robot: Robot) -> str:
        """What a yes counts for: this very program, until it is started anew."""
        identity = self._identity_of(robot.name)
        return f"{self._key(robot)} {identity.node_id if identity is not None else ''}"

    def _always(self) -> list[str]:
        return self._settings.get(ALWAYS, []) if self._settings is not None else []


def _stranger(name: str) -> str:
    """A robot of which only its name, or only a topic, is known."""
    return _("the robot on {topic}").format(topic=name) if "/" in name or name == RIZE_COMMANDS else name


def risky(robot: Robot, actions: Iterable[str]) -> tuple[str, ...]:
    """The titles of those actions that move the robot, each once; of many only the first."""
    found = [action.title for name in actions if (action := robot.action(name)) is not None and action.risk]
    titles = [f"“{title}”" for title in dict.fromkeys(found)]
    return (
        (*titles[:MOST_NAMED], pgettext("after a list", "more"))
        if len(titles) > MOST_NAMED
        else tuple(titles)
    )


def wanted_by(program: Program, robots: Iterable[Robot]) -> list[tuple[Robot, Sequence[str]]]:
    """What a program asks of each of its robots: anything of those that it moves by publishing."""
    asked, moved = program.actions, program.moves
    return [
        (
            robot,
            [action.name for action in robot.actions]
            if asked is None or robot.name in moved
            else asked.get(robot.name, ()),
        )
        for robot in robots
    ]
