"""What a problem's button does about a robot that is missing: another one, or a virtual one, for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from app.core.robots.virtual_processes import VIRTUAL_ROBOTS
from app.core.session import Session
from app.ui.shell.documents.controller import Files


class Says(Protocol):
    """The toast: a sentence, perhaps with a button that takes back what it says."""

    def __call__(self, words: str, button: str = "", run: Callable[[], object] | None = None) -> None: ...


class RobotMends:
    """The commands ``robot.use:MISSING:OTHER`` and ``robot.virtual:MISSING``; both can be undone."""

    def __init__(self, session: Session, files: Files, say: Says, undo: Callable[[], object]) -> None:
        """``undo`` takes back the last edit of the blocks."""
        self._session, self._files, self._say, self._undo = session, files, say, undo

    def asked(self) -> dict[str, Callable[[str], object]]:
        """By the names that a problem's mend has."""
        return {"robot.use": self._use, "robot.virtual": self._start}

    def _use(self, argument: str) -> None:
        missing, _, name = argument.partition(":")
        link = self._session.fleet.link(name)
        if link is None:
            return
        document, robot = self._session.document, link.robot

        def change() -> None:
            if document.use_robot(missing, robot):
                self._say(f"{name} does what {missing} was asked to do", "Undo", self._undo)

        self._files.with_newest(change)

    def _start(self, name: str) -> None:
        model = self._model(name)
        if model is None:
            return
        companions = self._session.companions
        companions.restart_virtual_robot(name, model)
        self._say(f"The virtual {name} is coming", "Undo", lambda: companions.stop_virtual_robot(name))

    def _model(self, name: str) -> str | None:
        kind = self._session.document.robots.get(name, {}).get("rb:robot")
        model = str(kind.get("model")) if isinstance(kind, Mapping) else ""
        return model if model in VIRTUAL_ROBOTS else None
