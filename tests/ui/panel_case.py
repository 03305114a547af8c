"""Helpers for tests of panels: a panel with a session in memory, and a fake window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from PySide6.QtTest import QTest
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.intents import Intent
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.theme import fonts
from app.ui.theme.theme import Theme
from tests.ui.fakes import Session
from tests.ui.shell_parts import Answers

OUT_OF_SIGHT = 5000


@dataclass
class Window:
    """Fake main window that records the requests of panels."""

    session: Session
    theme: Theme = field(default_factory=lambda: Theme("light"))
    opened: list[str] = field(default_factory=list)
    toasts: list[str] = field(default_factory=list)
    toast_buttons: list[tuple[str, Callable[[], object] | None]] = field(default_factory=list)
    commands: list[str | Intent] = field(default_factory=list)
    """Ids of commands, and intents, in the order in which they were requested."""
    plotted: list[tuple[str, str]] = field(default_factory=list)
    beside: list[str] = field(default_factory=list)
    asked_why: list[tuple[PanelWidget, str]] = field(default_factory=list)
    panels: list[PanelWidget] = field(default_factory=list)
    """Visible panels, other than the panel under test."""
    answers: Answers = field(default_factory=Answers)

    def context(self) -> PanelContext:
        return PanelContext(
            self.session,  # type: ignore[arg-type]
            self.theme,
            self.opened.append,
            self.show_toast,
            self.commands.append,
            self.answers,
            plot=lambda topic, path: self.plotted.append((topic, path)),
            open_to_side=self.beside.append,
            open_doctor=lambda panel, topic: self.asked_why.append((panel, topic)),
            panels=lambda: self.panels,
            request=self.commands.append,
        )

    def show_toast(self, words: str, button: str = "", run: Callable[[], object] | None = None) -> None:
        self.toasts.append(words)
        self.toast_buttons.append((button, run))

    def make(self, panel: Panel, size: tuple[int, int] = (640, 480)) -> PanelWidget:
        """Return a panel that is shown with Studio's fonts."""
        fonts.load()
        made = panel.make(self.context())
        _give_title(made)
        made.resize(*size)
        made.show()
        made.refresh()
        return made


def _give_title(made: PanelWidget) -> None:
    """Put the panel's header widgets into a parent, as its dock does; without one, each would be a window."""
    title = QWidget(made)
    row = QHBoxLayout(title)
    for widget in made.header_widgets():
        row.addWidget(widget)
    title.move(-OUT_OF_SIGHT, 0)


def ticks(window: Window, panel: PanelWidget, count: int = 1) -> None:
    """Advance the session by `count` thirtieths of a second, refreshing the panel each time."""
    for _ in range(count):
        window.session.tick()
        panel.refresh()


def button(widget: QWidget, name: str) -> QWidget:
    """Return the child widget with this accessible name."""
    found = [child for child in widget.findChildren(QWidget) if child.accessibleName() == name]
    assert found, f"nothing is called {name!r}"
    return found[0]


def has_keys(widget: QWidget) -> bool:
    """Return whether a widget has the focus of its window; `hasFocus` also needs the window to be active."""
    return widget.window().focusWidget() is widget


def press(widget: QWidget) -> None:
    """Click the centre of a widget."""
    from PySide6.QtCore import Qt

    QTest.mouseClick(widget, Qt.MouseButton.LeftButton)
