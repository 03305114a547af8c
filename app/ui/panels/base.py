"""Base class of panels (`PanelWidget`), their description (`Panel`) and window access (`PanelContext`).

A panel is one dockable view of the session. `PanelWidget.refresh` is called 30 times a second while the panel
is visible and must return at once when the data is unchanged. Panels don't import each other; they reach the
window through `PanelContext`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction, QFont
from PySide6.QtWidgets import QAbstractButton, QStackedWidget, QVBoxLayout, QWidget

from app.intents import Intent
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import Home
from app.ui.theme.theme import Theme
from app.ui.widgets.empty_state import EmptyAction
from app.ui.widgets.file_dialogs import FileDialogs
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.network.watches import Suspendable
    from app.core.session import Session
    from app.core.world.world import World

Density = Literal["compact", "comfortable"]
ANY_TYPE = "*"


class ShowToast(Protocol):
    """Signature of the function that shows a toast for some seconds.

    Args:
        text: Text of the toast, such as "Copied robots.Pepper.pose.y".
        button: Text of the button; "" for no button.
        run: Called when the button is clicked.
        until: The toast closes early once this function returns True.
    """

    def __call__(
        self,
        text: str,
        button: str = "",
        run: Callable[[], object] | None = None,
        *,
        until: Callable[[], bool] | None = None,
    ) -> None: ...


class AskName(Protocol):
    """Signature of the function that asks for a name in a sheet.

    Args:
        question: Title of the sheet.
        verb: Text of the button that applies the name.
        rejection_reason: Returns the reason why a name is invalid, as a sentence, or "".
        callback: Called with the name if it is valid.
        name: Initial text of the field.
    """

    def __call__(
        self,
        question: str,
        verb: str,
        rejection_reason: Callable[[str], str],
        callback: Callable[[str], object],
        name: str = "",
        /,
    ) -> None: ...


def _ask_nothing(
    _question: str,
    _verb: str,
    _rejection_reason: Callable[[str], str],
    _callback: Callable[[str], object],
    _name: str = "",
) -> None:
    pass


@dataclass(frozen=True, slots=True)
class PanelContext:
    """Session, theme and functions of the window for use by panels.

    Attributes:
        session: Session that the window shows.
        theme: Theme of the window.
        open_topic: Shows a topic in the panel that fits its message type.
        show_toast: Shows a short message that disappears after some seconds.
        run: Runs a command of the window or of a panel by its id.
        files: Dialogs for opening and saving files.
        focus_question: Gives the keyboard focus to the question of a running behaviour, if there is one.
        plot: Plots a field of a topic; with an empty path, asks for the field.
        open_to_side: Shows a topic in an additional panel.
        open_doctor: Opens the connection doctor for a panel and a topic; "" stands for any topic.
        panels: Returns the visible panels.
        request: Requests an intent, which another panel or the window carries out.
        ask_name: Asks for a name in a sheet.
        layout: Returns the name of the current layout; "" on the start page.
        surface: Parent widget of dialogs; None without a window.
    """

    session: Session
    theme: Theme
    open_topic: Callable[[str], None]
    show_toast: ShowToast
    run: Callable[[str], None]
    files: FileDialogs
    focus_question: Callable[[], None] = lambda: None
    plot: Callable[[str, str], object] = lambda _topic, _path: None
    open_to_side: Callable[[str], None] = lambda _topic: None
    open_doctor: Callable[[PanelWidget, str], object] = lambda _panel, _topic: None
    panels: Callable[[], Sequence[PanelWidget]] = lambda: ()
    request: Callable[[Intent], object] = lambda _intent: None
    ask_name: AskName = _ask_nothing
    layout: Callable[[], str] = lambda: ""
    surface: QWidget | None = None


@dataclass(frozen=True, slots=True)
class Blocker:
    """Reason why a panel does not show new data, with a button that resolves it.

    Attributes:
        message: Sentence that states the reason.
        fix: Instruction for the user, or "".
        button: Text of the button, such as "Resume"; "" for no button.
        run: Called when the button is clicked.
    """

    message: str
    fix: str
    button: str
    run: Callable[[], object]


def paused_blocker(panel: str, resume: Callable[[], object]) -> Blocker:
    """Return the blocker for a panel that is paused.

    Args:
        panel: Title of the panel.
        resume: Resumes the panel.
    """
    return Blocker(
        _("{panel} is paused and doesn't show new data.").format(panel=panel),
        "",
        _("Resume"),
        resume,
    )


def filter_blocker(panel: str, text: str, clear: Callable[[], object]) -> Blocker:
    """Return the blocker for a panel whose filter hides data.

    Args:
        panel: Title of the panel.
        text: Text of the filter.
        clear: Clears the filter.
    """
    return Blocker(
        _("{panel} only shows entries with “{words}”.").format(panel=panel, words=text),
        "",
        _("Clear the filter"),
        clear,
    )


def numbered_title(title: str, number: int) -> str:
    """Format a title with its number, such as "Plot 2"; the number 1 is omitted."""
    return title if number < 2 else _("{panel} {number}").format(panel=title, number=number)


@dataclass(frozen=True, slots=True)
class Panel:
    """Description of a panel, found by `app.ui.panels.registry`.

    A panel contributes its commands to menus, palette and shortcuts, and handles intents that other panels,
    alerts and problems request.

    Attributes:
        name: Id in saved layouts.
        title: Title, wrapped in `lazy`.
        icon: Name of a Lucide icon.
        accepted_types: Codecs of the topics that the panel can show, such as "image", or `ANY_TYPE`.
        make: Creates the widget of the panel.
        allows_multiple: True if several panels of this kind can be open, each with its own topic.
        home: Places in the layouts. Commands and intents show the panel in the current layout if it has a
            place there, else in the layout of the first place; without places, in the current layout.
        commands: Commands of the panel, which receive its widget.
        intents: Handlers of intents, which receive its widget.
    """

    name: str
    title: str
    icon: str
    accepted_types: tuple[str, ...]
    make: Callable[[PanelContext], PanelWidget]
    allows_multiple: bool = False
    home: tuple[Home, ...] = ()
    commands: tuple[Command[Any, PanelContext], ...] = ()
    intents: tuple[IntentHandler[Any, Any], ...] = ()


@dataclass(frozen=True)
class Diagnose(Intent):
    """Find out why a panel shows no data.

    Attributes:
        panel: Panel whose data is missing.
        topic: Topic to check first; "" for any topic.
    """

    panel: PanelWidget
    topic: str


class PanelWidget(QWidget):
    """Base class of the widget in a panel.

    The title bar of the dock shows `title` and `subtitle` (or the widget returned by `title_widget`),
    followed by `header_widgets`; its "more" menu contains `more_actions`.

    Signals:
        title_changed: The title or the subtitle changed.
    """

    title_changed = Signal()
    shows_video = False
    """True if `refresh` should run 60 times a second instead of 30.

    Otherwise, frames of a 30 fps video would be skipped.
    """

    def __init__(self, context: PanelContext, title: str) -> None:
        super().__init__()
        self.context = context
        self.session = context.session
        self.theme = context.theme
        self.density: Density = "compact"
        self.chips: list[QWidget] = []
        self.header: list[QWidget] = []
        self._title = title
        self._subtitle = ""
        self._number = 1
        self.setAccessibleName(title)
        self.theme.changed.connect(self.theme_changed)

    @property
    def world(self) -> World:
        """World that the panels show: the live network, or another one such as a recording."""
        return self.session.shown

    def make_page_stack(self, *pages: QWidget) -> QStackedWidget:
        """Fill the panel with a stack of pages, of which the first one is visible.

        Returns:
            The stack.
        """
        stack = QStackedWidget()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(stack)
        for page in pages:
            stack.addWidget(page)
        return stack

    def title(self) -> str:
        """Return the displayed title: "Plot", or "Plot 2" for the second panel of a kind."""
        return numbered_title(self._title, self._number)

    def set_number(self, number: int) -> None:
        """Set the number among the panels of this kind, counted from 1."""
        self._number = number
        self.setAccessibleName(self.title())

    def subtitle(self) -> str:
        """Return the text next to the title: usually the topic shown; "" for none."""
        return self._subtitle

    def header_widgets(self) -> Sequence[QWidget]:
        """Return the widgets for the title bar: chips, then buttons.

        The property "place" of the chips is set to "start", so that the dock places them next to the title.
        """
        for chip in self.chips:
            chip.setProperty("place", "start")
        return [*self.chips, *self.header]

    def title_widget(self) -> QWidget | None:
        """Return a widget to show instead of title and subtitle, or None."""
        return None

    def more_actions(self) -> Sequence[QAction]:
        """Return the panel's actions for the "more" menu, which lists them before the actions of the dock."""
        return ()

    def set_title(self, title: str, subtitle: str | None = None) -> None:
        """Set title and subtitle, and emit `title_changed` if one of them differs.

        Args:
            title: Title without a number.
            subtitle: Subtitle; None leaves the current one.
        """
        texts = (title, self._subtitle if subtitle is None else subtitle)
        if texts != (self._title, self._subtitle):
            self._title, self._subtitle = texts
            self.setAccessibleName(self.title())
            self.title_changed.emit()

    def refresh(self) -> None:
        """Show the current state of the session; called 30 times a second while the panel is visible."""

    def badge(self) -> tuple[str, str] | None:
        """Return text and status of the badge on the panel's tab, or None for no badge.

        The badge is shown while another panel covers this one. This is called on every tick while the panel
        shares its dock, so it must return quickly if nothing changed.
        """
        return None

    def set_density(self, density: Density) -> None:
        """Set the density of rows and text: comfortable in the Behaviour layout, compact in Developer."""
        self.density = density
        self.theme_changed()

    def theme_changed(self) -> None:
        """Update the panel after the theme's colours, fonts or density changed."""
        self.update()

    def text_font(self) -> QFont:
        """Return the font of body text at the panel's density."""
        return self.theme.font("bodyLarge" if self.density == "comfortable" else "body")

    def row_height(self) -> int:
        """Return the height of a row in pixels, scaled with the text size."""
        return round(self.theme.scaled(self.theme.size("row", self.density)))

    def source_changed(self) -> None:
        """Reset the panel after the session switched between the live network and a recording."""

    def show_topic(self, name: str) -> None:
        """Show a topic. Called only for panels that accept topics."""

    def focus_filter(self) -> bool:
        """Move the focus to the filter (key `/`); return False if there is none."""
        return False

    def blockers(self) -> Sequence[Blocker]:
        """Return the reasons why the panel itself hides new data, such as a pause or a filter."""
        return ()

    def awaited_topic(self) -> str:
        """Return the topic whose first message the panel is waiting for, or ""."""
        return ""

    def doctor_action(self, topic: str = "") -> EmptyAction:
        """Return the action that opens the connection doctor for a topic; "" stands for any topic."""
        return EmptyAction(
            _("Why is nothing shown?"), lambda: self.context.open_doctor(self, topic), "stethoscope"
        )

    def flush(self, callback: Callable[[], None]) -> None:
        """Apply pending edits to the session, then call `callback`. By default there are none."""
        callback()

    def freeze_button(self) -> QAbstractButton | None:
        """Return the checkable button that stops updates; hidden without live contents, or None."""
        return None

    def save_state(self) -> dict[str, object]:
        """Return the panel's state for the saved layout, as JSON values."""
        return {}

    def restore_state(self, state: Mapping[str, object]) -> None:
        """Restore a state returned by `save_state`; invalid entries are ignored."""

    def suspendables(self) -> Iterable[Suspendable | None]:
        """Return watches and streams to suspend while the panel is hidden; None entries are skipped."""
        return ()

    def suspend(self) -> None:
        """Suspend the panel's watches after it has been hidden for a while. Its contents stay visible."""
        for watch in self.suspendables():
            if watch is not None:
                watch.suspend()

    def resume(self) -> None:
        """Resume the panel's watches when it becomes visible."""
        for watch in self.suspendables():
            if watch is not None:
                watch.resume()

    def dispose(self) -> None:
        """Close watches and streams before the panel is removed from the window."""
