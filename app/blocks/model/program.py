"""Result of the compiler: a program and its problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal

from app.intents import Intent

Severity = Literal["error", "warning", "info"]


@dataclass(frozen=True)
class Problem:
    """Problem shown before Run.

    An error means that the program would stop with this message at this block.

    Attributes:
        severity: "error", "warning" or "info".
        block_id: Id of the block; None for a problem of the whole workspace.
        category: Name of the style that defines the block's colour.
        subject: Part of `message` that is shown in bold.
        message: Message for the user.
        fix: Text of the button that fixes the problem; None for no button.
        fix_action: Intent of the button, such as a `BlockFix`; None for no button.
        icon: Icon of the block.
    """

    severity: Severity
    block_id: str | None
    category: str | None
    subject: str
    message: str
    fix: str | None = None
    fix_action: Intent | None = None
    icon: str = ""


@dataclass(frozen=True)
class Variable:
    """Variable of a behaviour.

    Attributes:
        id: Id in the editor.
        name: Name given by the user.
        python: Name in the program; empty if no script that can start uses the variable.
    """

    id: str
    name: str
    python: str


@dataclass(frozen=True)
class Program:
    """Compiled behaviour.

    Attributes:
        source: Readable code, which can also be run as a file.
        lines: Block ids by line of `source`.
        runnable: The same code with a call of ``step`` before each block.
        robots: Connected robots that the blocks use, or that the program moves by publishing on their topics.
        publishes: Topics on which the blocks publish.
        listens: Topics that the blocks subscribe to.
        moves: Robots that the program moves by publishing on their topics.
        sensors: Used sensors as (robot, name).
        events: Used events as (robot, name).
        actions: Names of the executed actions by robot; None if they aren't statically known.
        readings: Blocks as text by block id, such as "wait 2 s".
        labels: Labels of blocks by block id, such as "wait".
        variables: Variables, which are shared by all scripts.
    """

    name: str
    source: str
    runnable: str
    lines: Mapping[int, str]
    robots: tuple[str, ...] = ()
    sensors: tuple[tuple[str, str], ...] = ()
    events: tuple[tuple[str, str], ...] = ()
    publishes: tuple[str, ...] = ()
    listens: tuple[str, ...] = ()
    moves: tuple[str, ...] = ()
    actions: Mapping[str, tuple[str, ...]] | None = None
    readings: Mapping[str, str] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)
    variables: tuple[Variable, ...] = ()
    breakpoints: tuple[str, ...] = ()  # blocks with breakpoints
    shows_value: bool = False  # the program prints a tried value in short form
    problems: tuple[Problem, ...] = ()
    starts: int = 0  # number of scripts that can start
    absent: tuple[str, ...] = ()  # blocks of disconnected robots, including those in scripts that can't run

    @property
    def errors(self) -> tuple[Problem, ...]:
        """Problems with the severity "error", at which the program would stop."""
        return tuple(problem for problem in self.problems if problem.severity == "error")

    def to_json(self) -> dict[str, object]:
        """Return the parts of the program that the program's process needs, as a JSON object."""
        program_json = asdict(self)
        for name in ("source", "lines", "problems", "absent", "actions"):
            del program_json[name]
        return program_json

    @classmethod
    def from_json(cls, saved: Mapping[str, object]) -> Program:
        """Create a program from the result of `to_json`.

        Raises:
            KeyError, TypeError, ValueError: The data is invalid.
        """
        return cls(
            name=str(saved["name"]),
            source="",
            runnable=str(saved["runnable"]),
            lines={},
            robots=_parse_texts(saved["robots"]),
            sensors=_parse_pairs(saved["sensors"]),
            events=_parse_pairs(saved["events"]),
            publishes=_parse_texts(saved["publishes"]),
            listens=_parse_texts(saved["listens"]),
            moves=_parse_texts(saved.get("moves", ())),
            readings=_parse_string_map(saved["readings"]),
            labels=_parse_string_map(saved["labels"]),
            variables=_parse_variables(saved.get("variables", ())),
            breakpoints=_parse_texts(saved.get("breakpoints", ())),
            shows_value=saved.get("shows_value") is True,
        )


def _parse_texts(saved: object) -> tuple[str, ...]:
    if not isinstance(saved, (list, tuple)):
        raise TypeError("not a list")
    return tuple(str(item) for item in saved)


def _parse_variables(saved: object) -> tuple[Variable, ...]:
    if not isinstance(saved, (list, tuple)):
        raise TypeError("not a list")
    return tuple(Variable(str(each["id"]), str(each["name"]), str(each["python"])) for each in saved)


def _parse_pairs(saved: object) -> tuple[tuple[str, str], ...]:
    if not isinstance(saved, (list, tuple)):
        raise TypeError("not a list")
    return tuple((str(first), str(second)) for first, second in saved)


def _parse_string_map(saved: object) -> dict[str, str]:
    if not isinstance(saved, Mapping):
        raise TypeError("not a table")
    return {str(key): str(value) for key, value in saved.items()}
