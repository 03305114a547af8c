"""Result of the compiler: a program and its problems."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal

Severity = Literal["error", "warning", "info"]


@dataclass(frozen=True)
class Problem:
    """Problem shown before Run.

    ``sentence`` contains ``subject``, which is shown bold. ``category`` is the style of the block's colour,
    ``icon`` its icon. ``fix`` is a button's text, ``fix_action`` its effect (`app.blocks.fixes.fixes`, or
    ``connect:<robot>``). An error means that the program would stop with this sentence at that block.
    """

    severity: Severity
    block_id: str | None
    category: str | None
    subject: str
    sentence: str
    fix: str | None = None
    fix_action: str | None = None
    icon: str = ""


@dataclass(frozen=True)
class Variable:
    """Variable of a behaviour: the editor's ``id``, its ``name``, and its name in ``python``.

    ``python`` is empty if no script that can start uses it.
    """

    id: str
    name: str
    python: str


@dataclass(frozen=True)
class Program:
    """Compiled behaviour.

    ``source`` is for people and runs as a file; ``lines`` maps its lines to blocks. ``runnable`` is the same
    tree with a ``step`` before each block. ``robots`` are the connected robots that its blocks name, and
    those that it moves by publishing on their topics (``moves``); ``sensors`` and ``events`` are (robot,
    name). ``actions`` are the actions requested of each robot, None if that is not statically known.
    ``readings`` are the blocks as text ("wait 2 s"), ``labels`` the words that name them ("wait").
    ``variables`` are shared by its scripts.
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
    shows_value: bool = False  # it shows a tried value in short form
    problems: tuple[Problem, ...] = ()
    starts: int = 0  # number of scripts that can start
    absent: tuple[str, ...] = ()  # blocks of disconnected robots, also in scripts that can't run

    @property
    def errors(self) -> tuple[Problem, ...]:
        """Problems at which the program would stop."""
        return tuple(problem for problem in self.problems if problem.severity == "error")

    def to_json(self) -> dict[str, object]:
        """Return the JSON form of what a child process needs to run it."""
        kept = asdict(self)
        for name in ("source", "lines", "problems", "absent", "actions"):
            del kept[name]
        return kept

    @classmethod
    def from_json(cls, saved: Mapping[str, object]) -> Program:
        """Restore a program from `to_json`. Raises KeyError or TypeError for other data."""
        return cls(
            name=str(saved["name"]),
            source="",
            runnable=str(saved["runnable"]),
            lines={},
            robots=_texts(saved["robots"]),
            sensors=_pairs(saved["sensors"]),
            events=_pairs(saved["events"]),
            publishes=_texts(saved["publishes"]),
            listens=_texts(saved["listens"]),
            moves=_texts(saved.get("moves", ())),
            readings=_table(saved["readings"]),
            labels=_table(saved["labels"]),
            variables=_variables(saved.get("variables", ())),
            breakpoints=_texts(saved.get("breakpoints", ())),
            shows_value=saved.get("shows_value") is True,
        )


def _texts(saved: object) -> tuple[str, ...]:
    if not isinstance(saved, (list, tuple)):
        raise TypeError("not a list")
    return tuple(str(item) for item in saved)


def _variables(saved: object) -> tuple[Variable, ...]:
    if not isinstance(saved, (list, tuple)):
        raise TypeError("not a list")
    return tuple(Variable(str(each["id"]), str(each["name"]), str(each["python"])) for each in saved)


def _pairs(saved: object) -> tuple[tuple[str, str], ...]:
    if not isinstance(saved, (list, tuple)):
        raise TypeError("not a list")
    return tuple((str(first), str(second)) for first, second in saved)


def _table(saved: object) -> dict[str, str]:
    if not isinstance(saved, Mapping):
        raise TypeError("not a table")
    return {str(key): str(value) for key, value in saved.items()}
