"""Trial of one stack of a behaviour: the label shown while it runs, and its value."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

from app.blocks.model.program import Program
from app.blocks.model.stack import Stack
from app.core.projects.open_project import OpenProject
from app.core.run.requests import RequestedRun
from app.robots.description.description import Robot
from nep.i18n import _


@dataclass(frozen=True, slots=True)
class TriedValue:
    """Value of a tried block.

    Attributes:
        document: Behaviour of the block.
        block: Id of the block.
        text: Formatted value.
        number: Serial number of the trial.
    """

    document: OpenProject
    block: str
    text: str
    number: int


class Trial:
    """State of the current or last trial. Empty if a whole behaviour was run."""

    def __init__(self) -> None:
        self.value: TriedValue | None = None
        self._numbers = itertools.count(1)
        self._request: RequestedRun | None = None
        self._unit = ""

    def prepare(self, request: RequestedRun) -> None:
        """Apply a new request to run, and discard the value of the previous trial."""
        self._request, self._unit, self.value = request, "", None

    def start(self, program: Program, robots: Iterable[Robot]) -> str:
        """Record the start of the program; return the label of the tried block ("" for a behaviour).

        Args:
            program: Program that was started.
            robots: Connected robots, which determine the unit of a sensor value.
        """
        if self._request is None:
            return ""
        self._unit = self._request.unit(program, robots)
        return self._request.label(program)

    def parse_line(self, line: str) -> str | None:
        """Format and store the value in a printed line; return None if no value block is being tried."""
        request = self._request
        if request is None or request.stack is None or not request.has_value:
            return None
        text = f"{line} {self._unit}".strip() if line else _("not known yet")
        self.set_value(request.document, request.stack, text)
        return text

    def set_value(self, project: OpenProject, stack: Stack, text: str) -> None:
        """Set the value of a tried block.

        Args:
            project: Behaviour of the block.
            stack: Stack that was tried.
            text: Formatted value.
        """
        self.value = TriedValue(project, stack.id, text, next(self._numbers))
