"""Storage in memory: settings, and the journal of a behaviour whose compiler results a test can define."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from app.blocks.model.program import Problem, Program
from app.blocks.model.project import Project
from app.blocks.model.workspace_json import WorkspaceJson
from app.core.projects import journal as journal_module
from app.core.projects import open_project as project_module
from app.core.storage import settings as settings_module


class Settings(settings_module.Settings):
    """Settings in memory."""

    def __init__(self) -> None:
        super().__init__(Path("no such folder"))

    def _write_changes(self) -> None:
        """Write nothing."""


class Journal(journal_module.Journal):
    """Journal in memory."""

    def __init__(self) -> None:
        super().__init__(Path("no such folder"))
        self.kept: str | None = None

    def write(self, project: Project, path: Path | None) -> Path:
        self.kept = project.always.workspace.text
        return Path(self.name)

    def discard(self) -> None:
        self.kept = None


class OpenProject(project_module.OpenProject):
    """Real project whose compiler results a test can define."""

    def __init__(self) -> None:
        super().__init__(Journal)
        self._timer = lambda: 0.0  # compile time 0: the project compiles synchronously
        self.found: tuple[Problem, ...] | None = None
        self.sensors: tuple[tuple[str, str], ...] | None = None
        self.source: str | None = None
        self.absent_blocks: tuple[str, ...] | None = None

    def set_blocks(self, blocks: Mapping[str, object]) -> None:
        """Replace the blocks without an edit, as if the project had been opened with them."""
        page = self.project.always.with_workspace(WorkspaceJson.from_blocks(blocks))
        self.project = self.project.with_page(page)

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
