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
    └── UnknownRobotError    a robot is not connected

Messages start with a lower-case letter and have no full stop; values are in quotes, and the next step
follows after a semicolon.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from nep.i18n import _
from nep.text import escaped, shortened

MAX_NAME_LENGTH, MAX_PROBLEM_LENGTH = 40, 300


class AppError(Exception):
    """Base class of errors that are shown to the user as one sentence.

    Attributes:
        sentence: The message, also returned by ``str(error)``.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class DocumentError(AppError):
    """Raised when a behaviour file can't be read or written.

    Attributes:
        path: Path of the file; None if there is none.
        reason: What happened, with the name of the file.
        advice: What the user can do; "" if unknown.
    """

    def __init__(self, path: Path | None, reason: str, advice: str = "") -> None:
        self.path = path
        self.reason = reason
        self.advice = advice
        super().__init__(f"{reason}; {advice}" if advice else reason)


class CompileError(AppError):
    """Raised when a workspace can't be compiled to a program.

    Attributes:
        reason: Message.
        block: Id of the block that causes the error; None if there is none.
    """

    def __init__(self, reason: str, block: str | None = None) -> None:
        self.reason = reason
        self.block = block
        super().__init__(reason)


class RunnerError(AppError):
    """Raised when the process of a program can't be started or reached."""


class SettingsError(AppError):
    """Raised when settings can't be saved.

    Attributes:
        path: Path of the settings file.
        reason: Reason as text.
    """

    def __init__(self, path: Path, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(_("can't save settings in '{path}': {reason}").format(path=path, reason=reason))


class BackpackError(AppError):
    """Raised when the backpack can't be read or saved, or when it is full."""


class ReportError(AppError):
    """Raised when a problem report can't be written.

    Attributes:
        path: Path of the report.
        reason: Reason as text.
    """

    def __init__(self, path: Path, reason: str, advice: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(
            _("can't write {file} ({reason}); {advice}").format(file=path.name, reason=reason, advice=advice)
        )


class CurveError(AppError):
    """Raised for a text that is not a valid curve expression."""


class QueryError(AppError):
    """Raised for a text that is not a valid message query."""


class DescriptionError(AppError):
    """Raised when the description of a robot is invalid.

    Attributes:
        name: Name of the robot.
        problems: One message for each problem.
    """

    def __init__(self, name: str, problems: tuple[str, ...]) -> None:
        # The description comes from another program, so its text is escaped and shortened.
        self.name = name
        self.problems = problems
        display_name = shortened(escaped(name), MAX_NAME_LENGTH)
        first = shortened(escaped(problems[0]), MAX_PROBLEM_LENGTH) if problems else _("empty")
        template = (
            _("the description of '{name}' can't be used: {problem} (and {count} more)")
            if len(problems) > 1
            else _("the description of '{name}' can't be used: {problem}")
        )
        super().__init__(template.format(name=display_name, problem=first, count=len(problems) - 1))


class DeclarationError(DescriptionError):
    """Raised when the declaration of a driver is invalid.

    Attributes:
        declared: Declared name.
        where: File and line of the declaration; "" if unknown.
    """

    def __init__(self, declared: str, problem: str, where: str = "") -> None:
        super().__init__(declared, (problem,))
        self.declared = declared
        self.where = where
        self.sentence = ": ".join(part for part in (where, declared, problem) if part)
        self.args = (self.sentence,)


class InputProblem(NamedTuple):
    """Problem in the input of an action.

    Attributes:
        parameter: Name of the invalid value; "" if the problem concerns no single value.
        message: Message.
    """

    parameter: str
    message: str


class RobotInputError(AppError):
    """Raised when the input of an action is invalid.

    Attributes:
        sentences: One message for each problem.
        problems: The messages with the names of the invalid values.
    """

    def __init__(self, sentences: tuple[str, ...], problems: tuple[InputProblem, ...] = ()) -> None:
        self.sentences = sentences
        self.problems = problems or tuple(InputProblem("", message) for message in sentences)
        super().__init__("; ".join(sentences))


class RobotValueError(AppError, ValueError):
    """Raised when a value of a driver doesn't match its declared type.

    Attributes:
        place: Name of the invalid part of the value; "" for the whole value.
    """

    def __init__(self, template: str, place: str = "", **placeholder_values: object) -> None:
        # `template` is a `lazy` text; its placeholder `place` and the others are filled here.
        self.place = place
        self._template, self._placeholder_values = template, placeholder_values
        super().__init__(_(template).format(place=place or _("the value"), **placeholder_values))

    def nested_in(self, outer: str) -> RobotValueError:
        """Return this error for an outer value.

        Args:
            outer: Name of the part of the outer value that contains the invalid value.
        """
        location = _("{place} {inner}").format(place=outer, inner=self.place) if self.place else outer
        return RobotValueError(self._template, location, **self._placeholder_values)


class UnknownRobotError(AppError):
    """Raised when a robot is not connected.

    Attributes:
        name: Name of the robot.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(
            _("no robot '{robot}' is connected; switch it on or use a virtual one").format(robot=name)
        )
