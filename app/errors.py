"""The errors of Studio.

::

    AppError
    ├── DocumentError        a behaviour file that can't be read or written
    ├── CompileError         a workspace that can't become a program
    ├── RunnerError          a program that can't be started or reached
    ├── SettingsError        settings that can't be kept
    ├── BackpackError        a backpack that can't be read or kept
    ├── ReportError          a report of a problem that can't be written
    ├── CurveError           what was typed is no curve that can be plotted
    ├── QueryError           what was typed is no query that a message can be asked
    ├── DescriptionError     a robot's description that can't be understood
    │   └── DeclarationError one that a driver's Python declares
    ├── RobotInputError      an action's input that the robot would refuse
    ├── RobotValueError      what a driver tells is not of the type that it declared
    └── RobotUnknownError    a robot that isn't there

The attributes come first, the sentence is made from them: lower case, no full stop, values in quotes, the
next step behind a semicolon.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from nep.i18n import _
from nep.text import escaped, shortened

LONGEST_NAME, LONGEST_PROBLEM = 40, 300


class AppError(Exception):
    """Anything that Studio can explain in one sentence: ``str(error)``."""

    def __init__(self, sentence: str) -> None:
        """Keep the sentence that a person reads."""
        super().__init__(sentence)
        self.sentence = sentence


class DocumentError(AppError):
    """A behaviour file can't be read or written.

    ``path`` is the file, ``reason`` a whole sentence that names it, ``advice`` what to do, if that is known.
    """

    def __init__(self, path: Path | None, reason: str, advice: str = "") -> None:
        """Make the sentence from the reason and the advice."""
        self.path = path
        self.reason = reason
        self.advice = advice
        super().__init__(f"{reason}; {advice}" if advice else reason)


class CompileError(AppError):
    """A workspace can't become a program; ``block`` is the block's id when one is to blame."""

    def __init__(self, reason: str, block: str | None = None) -> None:
        """Make the sentence from the reason."""
        self.reason = reason
        self.block = block
        super().__init__(reason)


class RunnerError(AppError):
    """The process of a program can't be started or reached."""


class SettingsError(AppError):
    """The settings can't be kept; ``path`` is their file."""

    def __init__(self, path: Path, reason: str) -> None:
        """Make the sentence from the file's name and the reason."""
        self.path = path
        self.reason = reason
        super().__init__(_("can't save settings in '{path}': {reason}").format(path=path, reason=reason))


class BackpackError(AppError):
    """The backpack can't be read or kept, or it is full."""


class ReportError(AppError):
    """A report of a problem can't be written; ``path`` is where."""

    def __init__(self, path: Path, reason: str, advice: str) -> None:
        """Make the sentence from the file's name, the reason and the advice."""
        self.path = path
        self.reason = reason
        super().__init__(
            _("can't write {file} ({reason}); {advice}").format(file=path.name, reason=reason, advice=advice)
        )


class CurveError(AppError):
    """What was typed is no curve that can be plotted."""


class QueryError(AppError):
    """What was typed is no query that a message can be asked."""


class DescriptionError(AppError):
    """A robot's description can't be understood; ``problems`` holds every sentence."""

    def __init__(self, name: str, problems: tuple[str, ...]) -> None:
        """Make the sentence from the first problem, without what a stranger's text may do to a reader."""
        self.name = name
        self.problems = problems
        shown = shortened(escaped(name), LONGEST_NAME)
        first = shortened(escaped(problems[0]), LONGEST_PROBLEM) if problems else _("empty")
        words = (
            _("the description of '{name}' can't be used: {problem} (and {count} more)")
            if len(problems) > 1
            else _("the description of '{name}' can't be used: {problem}")
        )
        super().__init__(words.format(name=shown, problem=first, count=len(problems) - 1))


class DeclarationError(DescriptionError):
    """A driver declares something that can't be described: ``declared`` names it, ``where`` its line."""

    def __init__(self, declared: str, problem: str, where: str = "") -> None:
        """Make the sentence from the line, the name and the problem."""
        super().__init__(declared, (problem,))
        self.declared = declared
        self.where = where
        self.sentence = ": ".join(part for part in (where, declared, problem) if part)
        self.args = (self.sentence,)


class InputProblem(NamedTuple):
    """What is wrong with one value of an action's input.

    ``parameter`` is the value's name, "" when it is no parameter's; ``sentence`` is whole.
    """

    parameter: str
    sentence: str


class RobotInputError(AppError):
    """An action's input that the robot would refuse; ``sentences`` has one for each wrong value.

    ``problems`` says of which value each one is.
    """

    def __init__(self, sentences: tuple[str, ...], problems: tuple[InputProblem, ...] = ()) -> None:
        """Make the sentence from all of them."""
        self.sentences = sentences
        self.problems = problems or tuple(InputProblem("", sentence) for sentence in sentences)
        super().__init__("; ".join(sentences))


class RobotValueError(AppError, ValueError):
    """What a driver tells is not of the type that it declared.

    ``place`` says which value inside is meant; "" is the whole of it.
    """

    def __init__(self, words: str, place: str = "", **holes: object) -> None:
        """Make the sentence from its `lazy` words, the place (hole ``place``) and what fills the others."""
        self.place = place
        self._words, self._holes = words, holes
        super().__init__(_(words).format(place=place or _("the value"), **holes))

    def inside(self, outer: str) -> RobotValueError:
        """The same of a value that this one is in."""
        place = _("{place} {inner}").format(place=outer, inner=self.place) if self.place else outer
        return RobotValueError(self._words, place, **self._holes)


class RobotUnknownError(AppError):
    """A robot that isn't connected; ``name`` is the one asked for."""

    def __init__(self, name: str) -> None:
        """Make the sentence from the name."""
        self.name = name
        super().__init__(
            _("no robot '{robot}' is connected; switch it on or use a virtual one").format(robot=name)
        )
