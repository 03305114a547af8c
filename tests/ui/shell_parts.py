"""Test helpers for the main window: plain panels, fake file dialogs, robots in every state, free address."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QLineEdit, QVBoxLayout

from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.build.behaviour.printing import PrintCommands
from app.ui.panels.build.behaviour.program_pictures import ImageCommands
from app.ui.panels.build.behaviour.variable_commands import VariableCommands
from app.ui.panels.command import Command
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.actions.actions import merged
from app.ui.shell.commands import table
from app.ui.shell.start_page.page import Example
from app.ui.widgets.file_dialogs import FileKind, resolve_kind
from tests.blocks.fakes import until
from tests.ports import free_port
from tests.ui import fakes
from tests.ui.sample_data import WORKSPACE, Invocation, pepper

NAMES = {
    "behaviour": ("Behaviour", ()),
    "problems": ("Problems", ()),
    "robot": ("Pepper", ()),
    "robots": ("Robots", ()),
    "camera": ("Camera", ()),
    "image": ("Image", ("image",)),
    "sensors": ("Live sensors", ()),
    "health": ("Health", ()),
    "topics": ("Topics", ()),
    "inspector": ("Inspector", ("*",)),
    "console": ("Console", ()),
    "alerts": ("Alerts", ()),
}


class PlainPanel(PanelWidget):
    """Panel that records the calls of the window."""

    def __init__(self, context: PanelContext, title: str) -> None:
        super().__init__(context, title)
        self.refreshed = 0
        self.topics: list[str] = []
        self.state: dict[str, object] = {}
        self.closed = False
        self.undone: list[str] = []
        self.flushed = 0
        self.blocks: list[str] = []
        self.edited: list[Mapping[str, object]] = []
        self.explode = False
        self.variables = VariableCommands(context, self.flush, self.edit_variable)
        self.pictures = ImageCommands(context, lambda _kind, _white, done: done(b""))
        self.printing = PrintCommands(context, lambda _title, _date, _layout, done: done(b""))
        self.filter = QLineEdit()
        column = QVBoxLayout(self)
        column.addWidget(self.filter)

    def refresh(self) -> None:
        if self.explode:
            raise ValueError("no such luck")
        self.refreshed += 1

    def edit_variable(self, edit: Mapping[str, object]) -> None:
        self.edited.append(edit)

    def show_topic(self, name: str) -> None:
        self.topics.append(name)

    def focus_filter(self) -> bool:
        self.filter.setFocus()
        return True

    def save_state(self) -> dict[str, object]:
        return {"filter": self.filter.text()}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.state = dict(state)

    def dispose(self) -> None:
        self.closed = True

    def undo(self) -> None:
        self.undone.append("undo")

    def redo(self) -> None:
        self.undone.append("redo")

    def flush(self, done: Callable[[], None]) -> None:
        self.flushed += 1
        done()

    def show_block(self, block: str) -> None:
        self.blocks.append(block)

    def find_blocks(self, *, to_add: bool) -> None:
        self.undone.append("search" if to_add else "find")

    def edit_blocks(self, edit: str) -> None:
        self.undone.append(edit)

    def edit_from_menu(self, edit: str) -> None:
        self.undone.append(edit)

    def rename_current(self) -> None:
        self.undone.append("rename")


REGISTRY = PanelRegistry()


def plain(name: str, title: str, accepts: tuple[str, ...]) -> Panel:
    """Return a description with the contributions of the real panel and a `PlainPanel` as widget."""
    real = REGISTRY[name]
    return Panel(
        name,
        title,
        "bot",
        accepts,
        lambda context: PlainPanel(context, title),
        home=real.home,
        commands=real.commands,
        intents=real.intents,
    )


COMMANDS: list[Command[Any, Any]] = merged(
    table.COMMANDS, [command for panel in REGISTRY.values() for command in panel.commands]
)
"""Commands of the window and of all panels; tests that only need a command of the window can use them too."""
PANELS = {name: plain(name, title, accepts) for name, (title, accepts) in NAMES.items()}


class Answers:
    """Fake file dialogs that return `path`, or cancel when it is None."""

    def __init__(self) -> None:
        self.path: Path | None = None
        self.asked: list[str] = []

    def open(self, folder: str, take: Callable[[Path], None]) -> None:
        self.asked.append(f"open {folder}")
        if self.path is not None:
            take(self.path)

    def save(self, suggestion: str, take: Callable[[Path], None]) -> None:
        self.asked.append(f"save {suggestion}")
        if self.path is not None:
            take(self.path)

    def save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        take: Callable[[Path, FileKind], None],
    ) -> None:
        self.asked.append(f"{title}: {suggestion}")
        if self.path is not None:
            take(*resolve_kind(self.path, kinds[0], kinds))

    def open_picture(self, folder: str, take: Callable[[Path], None]) -> None:
        self.asked.append(f"picture {folder}")
        if self.path is not None:
            take(self.path)

    def open_recording(self, folder: str, take: Callable[[Path], None]) -> None:
        self.asked.append(f"recording {folder}")
        if self.path is not None:
            take(self.path)

    def open_layout(self, folder: str, take: Callable[[Path], None]) -> None:
        self.asked.append(f"layout {folder}")
        if self.path is not None:
            take(self.path)

    def select_folder(self, folder: str, take: Callable[[Path], None]) -> None:
        self.asked.append(f"folder {folder}")
        if self.path is not None:
            take(self.path)


def robots_in(*states: str, run: str = "ready", silent: str | None = None) -> fakes.Session:
    """Return a session with robots "Robot 1", "Robot 2", … in these states and a run in state ``run``.

    ``silent`` is the reason for a robot's silence; None makes the robot unresponsive.
    """
    session = fakes.Session()
    links = [session.join(pepper(f"Robot {number}")) for number in range(1, len(states) + 1)]
    if run != "ready":
        begin_run(session, run)
    for link, state in zip(links, states, strict=True):
        link.is_stopping, link.is_connected = state == "stopping", state != "away"
        if state == "silent":
            link.silence_reason, link.is_unresponsive = silent, silent is None
        elif state == "not stopped":
            link.stop_problem = f"{link.name} may still move: a joint is stuck"
        elif state == "busy":
            link.invocations["walk"] = Invocation("1", "walk")
        assert link.state == state
    assert session.runs.view().state == run
    return session


def begin_run(session: fakes.Session, state: str) -> None:
    """Start a behaviour and wait until its run is running or paused."""
    session.document.apply_edit(WORKSPACE)
    session.runs.run()
    assert session.runner is not None
    session.runner.does("b2")
    if state == "paused":
        session.runs.pause()

    def has_come() -> bool:
        session.take_over()
        return session.runs.view().state == state

    until(has_come)


def free_address() -> str:
    """Return a loopback address with an unused port."""
    return f"127.0.0.1:{free_port()}"


def examples(folder: Path) -> list[Example]:
    """Return two examples without blocks."""
    return [Example(folder / f"{name}.nepb", name, f"{name} does it", ()) for name in ("Greeting", "Quiz")]
