"""One stack of a behaviour that is tried alone: its words while it runs, and the value that it has."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

from app.blocks.compiler.stack import Stack
from app.blocks.model.program import Program
from app.core.documents.document import Document
from app.core.run.wanted import Wanted
from app.robots.description.description import Robot
from nep.i18n import _


@dataclass(frozen=True, slots=True)
class TriedValue:
    """The value of a block that was tried, in words; ``number``: of the try."""

    document: Document
    block: str
    words: str
    number: int


class Trial:
    """What is known of the stack that is tried, or was tried last; of a whole behaviour nothing."""

    def __init__(self) -> None:
        self.value: TriedValue | None = None
        self._tries = itertools.count(1)
        self._wanted: Wanted | None = None
        self._unit = ""

    def begin(self, wanted: Wanted) -> None:
        """This is to run now; the value of the one before is forgotten."""
        self._wanted, self._unit, self.value = wanted, "", None

    def start(self, program: Program, robots: Iterable[Robot]) -> str:
        """Its program runs with these robots; the words of the block that is tried, "" of a behaviour."""
        if self._wanted is None:
            return ""
        self._unit = self._wanted.unit(program, robots)
        return self._wanted.words(program)

    def take(self, line: str) -> str | None:
        """Take a line that the program has written as the value that is tried; None: it is none."""
        wanted = self._wanted
        if wanted is None or wanted.stack is None or not wanted.gives_value:
            return None
        words = f"{line} {self._unit}".strip() if line else _("not known yet")
        self.show(wanted.document, wanted.stack, words)
        return words

    def show(self, document: Document, stack: Stack, words: str) -> None:
        """This is the value of the block."""
        self.value = TriedValue(document, stack.id, words, next(self._tries))
