"""Storage in memory: settings, and the journal of a behaviour whose compiler results a test can define."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from app.blocks import Problem, Program
from app.core.documents import document as document_module
from app.core.documents import journal as journal_module
from app.core.storage import settings as settings_module


class Settings(settings_module.Settings):
    """Settings in memory."""

    def __init__(self) -> None:
        super().__init__(Path("no such folder"))

    def set(self, key: str, value: object) -> None:
        json.dumps(value)
        self._values[key] = value


class Journal(journal_module.Journal):
    """Journal in memory."""

    def __init__(self) -> None:
        super().__init__(Path("no such folder"))
        self.kept: str | None = None

    def write(
        self,
        name: str,
        path: Path | None,
        text: str,
        robots: Mapping[str, Mapping[str, object]],
        unknown_fields: Mapping[str, object] | None = None,
    ) -> None:
        self.kept = text

    def discard(self) -> None:
        self.kept = None


class Document(document_module.Document):
    """Real document whose compiler results a test can define."""

    def __init__(self) -> None:
        super().__init__(Journal)
        self._timer = lambda: 0.0  # compile time 0: the document compiles synchronously
        self.found: tuple[Problem, ...] | None = None
        self.sensors: tuple[tuple[str, str], ...] | None = None
        self.source: str | None = None
        self.absent_blocks: tuple[str, ...] | None = None

    def _compile_job(self) -> Callable[[], Program]:
        compiling = super()._compile_job()
        told = {
            "problems": self.found,
            "sensors": self.sensors,
            "source": self.source,
            "absent": self.absent_blocks,
        }
        given = {name: value for name, value in told.items() if value is not None}
        return lambda: replace(compiling(), **given)  # type: ignore[arg-type]
