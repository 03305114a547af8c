"""Exceptions of Studio.

::

    AppError
    ├── DocumentError        a behaviour file can't be read or written
    ├── CompileError         a workspace can't be compiled to a program
    ├── RunnerError          a program's process can't be started or reached
    ├── SettingsError        settings can't be saved
    ├── BackpackError        the backpack can't be read or saved
    ├── ReportError          a problem report can't be written
    ├── CurveError           a text is not a valid curve expression
    ├── QueryError           a text is not a valid message query
    ├── DescriptionError     a robot's description is invalid
    │   └── DeclarationError a driver's Python declaration is invalid
    ├── RobotInputError      an action's input is invalid
    ├── RobotValueError      a driver's value doesn't match its declared type
    └── RobotUnknownError    a robot is not connected

Each sentence is built from the exception's attributes: lower case, no full stop, values in quotes, the
next step after a semicolon.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from nep.i18n import _
from nep.text import escaped, shortened

MAX_NAME_LENGTH, MAX_PROBLEM_LENGTH = 40, 300


class AppError(Exception):
    """Base class of errors that are shown to the user as one sentence, ``str(error)``."""

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class DocumentError(AppError):
    """A behaviour file can't be read or written.

    Attributes:
        path: The file.
        reason: Sentence that contains the name of the file.
        advice: What the user can do, if known.
    """

    def __init__(self, path: Path | None, reason: str, advice: str = "") -> None:
        self.path = path
        self.reason = reason
        self.advice = advice
        super().__init__(f"{reason}; {advice}" if advice else reason)


class CompileError(AppError):
    """A workspace can't be compiled to a program.

    ``block`` is the id of the block that causes this, if any.
    """

    def __init__(self, reason: str, block: str | None = None) -> None:
        self.reason = reason
        self.block = block
        super().__init__(reason)


class RunnerError(AppError):
    """The process of a program can't be started or reached."""


class SettingsError(AppError):
    """Settings can't be saved; ``path`` is their file."""

    def __init__(self, path: Path, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(_("can't save settings in '{path}': {reason}").format(path=path, reason=reason))


class BackpackError(AppError):
    """The backpack can't be read or saved, or it is full."""


class ReportError(AppError):
    """A problem report can't be written; ``path`` is its file."""

    def __init__(self, path: Path, reason: str, advice: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(
            _("can't write {file} ({reason}); {advice}").format(file=path.name, reason=reason, advice=advice)
        )


class CurveError(AppError):
    """A text is not a valid curve expression."""


class QueryError(AppError):
    """A text is not a valid message query."""


class DescriptionError(AppError):
    """The description of a robot is invalid. ``problems`` contains a sentence for each problem."""

    def __init__(self, name: str, problems: tuple[str, ...]) -> None:
        # The description comes from another program, so its text is escaped and shortened.
        self.name = name
        self.problems = problems
        shown = shortened(escaped(name), MAX_NAME_LENGTH)
        first = shortened(escaped(problems[0]), MAX_PROBLEM_LENGTH) if problems else _("empty")
        words = (
            _("the description of '{name}' can't be used: {problem} (and {count} more)")
            if len(problems) > 1
            else _("the description of '{name}' can't be used: {problem}")
        )
        super().__init__(words.format(name=shown, problem=first, count=len(problems) - 1))


class DeclarationError(DescriptionError):
    """The declaration of a driver is invalid.

    ``declared`` is the declared name, ``where`` the line in the source.
    """

    def __init__(self, declared: str, problem: str, where: str = "") -> None:
        super().__init__(declared, (problem,))
        self.declared = declared
        self.where = where
        self.sentence = ": ".join(part for part in (where, declared, problem) if part)
        self.args = (self.sentence,)


class InputProblem(NamedTuple):
    """Problem of one value in the input of an action.

    ``parameter`` is the name of the value, or "" if the problem concerns no single value; ``sentence``
    describes it.
    """

    parameter: str
    message: str


class RobotInputError(AppError):
    """The input of an action is invalid. ``sentences`` contains a sentence for each invalid value.

    ``problems`` assigns each sentence to its parameter.
    """

    def __init__(self, sentences: tuple[str, ...], problems: tuple[InputProblem, ...] = ()) -> None:
        self.sentences = sentences
        self.problems = problems or tuple(InputProblem("", sentence) for sentence in sentences)
        super().__init__("; ".join(sentences))


class RobotValueError(AppError, ValueError):
    """A value of a driver doesn't match its declared type.

    ``place`` is the part of the value that is invalid; "" means the whole value.
    """

    def __init__(self, words: str, place: str = "", **holes: object) -> None:
        # `words` is a `lazy` text; its placeholder `place` and the others are filled here.
        self.place = place
        self._words, self._holes = words, holes
        super().__init__(_(words).format(place=place or _("the value"), **holes))

    def nested_in(self, outer: str) -> RobotValueError:
        """Return this error for a value that contains the invalid value."""
        place = _("{place} {inner}").format(place=outer, inner=self.place) if self.place else outer
        return RobotValueError(self._words, place, **self._holes)


class UnknownRobotError(AppError):
    """A robot is not connected; ``name`` is its name."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(
            _("no robot '{robot}' is connected; switch it on or use a virtual one").format(robot=name)
        )
