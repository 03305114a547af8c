"""What a panel is: one dockable view of the session, described by one `Panel`.

A panel reads the session in `PanelWidget.refresh`, 30 times a second while it can be seen, and does nothing
there when nothing changed. It never imports another panel; what concerns the window goes through
`PanelContext`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction, QFont
from PySide6.QtWidgets import QStackedWidget, QVBoxLayout, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.empty_state import EmptyAction
from app.ui.widgets.file_dialogs import FileDialogs
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.network.watches import Suspendable
    from app.core.session import Session

Density = Literal["compact", "comfortable"]
ANY_TYPE = "*"


class ShowToast(Protocol):
    """Says for some seconds what the person just did."""

    def __call__(
        self,
        words: str,
        button: str = "",
        run: Callable[[], object] | None = None,
        *,
        until: Callable[[], bool] | None = None,
    ) -> None:
        """Show ``words``, "Copied robots.Pepper.pose.y", and perhaps a ``button`` that does ``run``.

        They go earlier once ``until`` is so: what they say has happened.
        """


@dataclass(frozen=True, slots=True)
class PanelContext:
    """What a panel may use of the window.

    ``open_topic`` shows a topic in the panel that fits its type, ``toast`` says what was just done, ``run``
    does one of the window's commands by its name (`app.ui.shell.commands.table`), ``files`` asks for files,
    ``keys_to_question`` gives the keyboard to what a running behaviour asks, if it asks something. ``plot``
    plots a field of a topic; without a path it asks which. ``open_beside`` shows a topic in one more panel.
    ``why`` asks the connection doctor why a panel shows nothing of a topic, or ("") of any. ``panels`` are
    those that can be seen now.
    """

    session: Session
    theme: Theme
    open_topic: Callable[[str], None]
    toast: ShowToast
    run: Callable[[str], None]
    files: FileDialogs
    keys_to_question: Callable[[], None] = lambda: None
    plot: Callable[[str, str], None] = lambda _topic, _path: None
    open_beside: Callable[[str], None] = lambda _topic: None
    why: Callable[[PanelWidget, str], None] = lambda _panel, _topic: None
    panels: Callable[[], Sequence[PanelWidget]] = lambda: ()


@dataclass(frozen=True, slots=True)
class Hindrance:
    """Something in a panel itself that keeps what comes from being shown, and the button that ends it.

    ``sentence`` says what, ``mend`` what to do, ``button`` what ``run`` does: "Let it go on".
    """

    sentence: str
    mend: str
    button: str
    run: Callable[[], object]


def paused_hindrance(panel: str, go_on: Callable[[], object]) -> Hindrance:
    """A panel of this title holds what it shows."""
    return Hindrance(
        _("{panel} is paused and doesn't show new data.").format(panel=panel),
        "",
        _("Resume"),
        go_on,
    )


def filter_hindrance(panel: str, words: str, clear: Callable[[], object]) -> Hindrance:
    """A panel of this title shows only what has these words."""
    return Hindrance(
        _("{panel} only shows entries with “{words}”.").format(panel=panel, words=words),
        "",
        _("Clear the filter"),
        clear,
    )


def numbered(title: str, number: int) -> str:
    """A title that tells one panel from others of its kind: "Plot", "Plot 2"."""
    return title if number < 2 else _("{panel} {number}").format(panel=title, number=number)


@dataclass(frozen=True, slots=True)
class Panel:
    """A panel's description.

    ``name`` is its id in saved layouts, ``icon`` a Lucide name, ``accepts`` the codecs of the topics that it
    can show ("image"), or `ANY_TYPE`; ``make`` builds one. Where ``several`` make sense,
    each with its own topic, they may be open side by side.
    """

    name: str
    title: str
    icon: str
    accepts: tuple[str, ...]
    make: Callable[[PanelContext], PanelWidget]
    several: bool = False


class PanelWidget(QWidget):
    """The inside of a panel, and what stands in its title.

    The window shows in the title: `title` and `subtitle` in mono (or `replaces_title` in their place), then
    `header_widgets`, and `more_actions` in "more". `title_changed` when title or subtitle did.
    """

    title_changed = Signal()
    shows_pictures = False
    """Whether `refresh` is called 60 times a second, so that no picture of 30 a second is passed over."""

    def __init__(self, context: PanelContext, title: str) -> None:
        """A panel called ``title``."""
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

    def show_one_of(self, *pages: QWidget) -> QStackedWidget:
        """Fill the panel, edge to edge, with one of these at a time; the first one to begin with."""
        stack = QStackedWidget()
        for page in pages:
            stack.addWidget(page)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(stack)
        return stack

    def title(self) -> str:
        """Its name in the title: "Plot", and "Plot 2" for the second one."""
        return numbered(self._title, self._number)

    def set_number(self, number: int) -> None:
        """Which one of its kind it is, from 1."""
        self._number = number
        self.setAccessibleName(self.title())

    def subtitle(self) -> str:
        """What it shows: a topic; empty when it shows one thing only."""
        return self._subtitle

    def header_widgets(self) -> Sequence[QWidget]:
        """Chips, which have ``place`` "start" and stand right after the title, then buttons, at the right."""
        for chip in self.chips:
            chip.setProperty("place", "start")
        return [*self.chips, *self.header]

    def replaces_title(self) -> QWidget | None:
        """A widget that fills the title's row in place of the name; None in most panels."""
        return None

    def more_actions(self) -> Sequence[QAction]:
        """What "more" offers above floating and closing."""
        return ()

    def set_title(self, title: str, subtitle: str | None = None) -> None:
        """Change title and subtitle; nothing is told when they are the same."""
        wanted = (title, self._subtitle if subtitle is None else subtitle)
        if wanted != (self._title, self._subtitle):
            self._title, self._subtitle = wanted
            self.setAccessibleName(self.title())
            self.title_changed.emit()

    def refresh(self) -> None:
        """Show what is in the session now; called 30 times a second while the panel can be seen."""

    def badge(self) -> tuple[str, str] | None:
        """What waits in it while it stands behind another panel: a count and a status; None for nothing.

        Asked with every tick of a panel that shares its place, so it costs nothing when nothing changed.
        """
        return None

    def set_density(self, density: Density) -> None:
        """Comfortable rows and text in the Behaviour layout, compact ones in Developer."""
        self.density = density
        self.theme_changed()

    def theme_changed(self) -> None:
        """Colours, fonts or density changed."""
        self.update()

    def text_font(self) -> QFont:
        """The font of the panel's words in its density."""
        return self.theme.font("bodyLarge" if self.density == "comfortable" else "body")

    def row_height(self) -> int:
        """The height of a row in its density, grown with the text."""
        return round(self.theme.scaled(self.theme.size("row", self.density)))

    def source_changed(self) -> None:
        """The session shows another source, a recording or the live network: begin anew with that."""

    def show_topic(self, name: str) -> None:
        """Show this topic, if the panel accepts topics."""

    def focus_filter(self) -> bool:
        """Go to the panel's filter (`/`); False when it has none."""
        return False

    def hindrances(self) -> Sequence[Hindrance]:
        """What of the panel itself hides what comes: that it is paused, its filter."""
        return ()

    def waits_for(self) -> str:
        """The topic of which it is to show a message and has seen none; empty when it waits for none."""
        return ""

    def why(self, topic: str = "") -> EmptyAction:
        """The way to the connection doctor for when nothing is seen of a topic, or ("") of any."""
        return EmptyAction(_("Why do I see nothing?"), lambda: self.context.why(self, topic), "stethoscope")

    def save_state(self) -> dict[str, object]:
        """What is to be as it was when the layout comes back."""
        return {}

    def restore_state(self, state: Mapping[str, object]) -> None:
        """Take over what `save_state` gave; whatever does not fit is left out."""

    def looks(self) -> Iterable[Suspendable | None]:
        """The watches and streams that only cost while the panel can be seen; None stands for none."""
        return ()

    def rest(self) -> None:
        """Nobody has seen the panel for a while: it keeps what it shows and gets nothing new."""
        for look in self.looks():
            if look is not None:
                look.rest()

    def wake(self) -> None:
        """The panel can be seen, perhaps again: it gets what is new."""
        for look in self.looks():
            if look is not None:
                look.wake()

    def shut(self) -> None:
        """The panel leaves the window: end its watches and streams."""
