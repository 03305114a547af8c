"""Bar below the room for speaking to a virtual robot and for simulating events."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.robots.description.description import Event, Robot
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import IconButton, SearchField
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _

HEARD_EVENT = "heard"
"""Name of the event that a robot publishes when it hears speech."""
MAX_ENTRIES = 24
MAX_WIDTH = 720
"""Maximum width of the speech field in px, which is reached in the enlarged room."""
AwaitedValuesGetter: TypeAlias = Callable[[Event, str], Sequence[str]]
SimulatedEvent: TypeAlias = dict[str, object]


class SayField(SearchField):
    """Text field for speech.

    Signals:
        submitted: Text to say, when Return was pressed.
        suggestions_requested: Suggestions should be shown, because Down was pressed.
    """

    submitted = Signal(str)
    suggestions_requested = Signal()
    icon_name = "message-circle"

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, _("Say something"))
        self.setMaxLength(200)
        self.setMinimumWidth(60)
        self.setMaximumWidth(MAX_WIDTH)
        self._last_text = ""

    def sizeHint(self) -> QSize:
        return QSize(120, super().sizeHint().height())

    def submit(self, text: str) -> None:
        """Emit a text as `submitted` and clear the field; ignored if the text is blank."""
        if text.strip():
            self._last_text = text.strip()
            self.clear()
            self.submitted.emit(self._last_text)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = event.key() if has_no_modifiers(event) else None
        if key in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.submit(self.text())
        elif key == Qt.Key.Key_Up and not self.text():
            self.setText(self._last_text)
        elif key == Qt.Key.Key_Down:
            self.suggestions_requested.emit()
        else:
            super().keyPressEvent(event)


class SayBar(QWidget):
    """Bar with a field for speech, its suggestions, and the menu of simulated events.

    Args:
        get_awaited_values: Returns the values of an event's field that blocks in open behaviours react to,
            those of the current behaviour first.

    Signals:
        speech_submitted: Text to say to the robot.
        event_simulated: Event to simulate.
    """

    speech_submitted = Signal(str)
    event_simulated = Signal(object)  # `SimulatedEvent`, in the format of a virtual robot's world

    def __init__(self, theme: Theme, get_awaited_values: AwaitedValuesGetter) -> None:
        super().__init__()
        self._theme, self._get_awaited_values = theme, get_awaited_values
        self._robot: Robot | None = None
        self.field = SayField(theme)
        self.suggestions_button = IconButton(theme, "chevron-down", _("Choose what to say"), size=26)
        self.events_button = IconButton(theme, "zap", _("Simulate an event"), size=26)
        self.field.submitted.connect(self.speech_submitted)
        self.field.suggestions_requested.connect(self.show_suggestions)
        self.suggestions_button.clicked.connect(self.show_suggestions)
        self.events_button.clicked.connect(self.show_event_menu)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 6, 8, 6)
        row.setSpacing(4)
        row.addStretch(0)
        row.addWidget(self.field, 1)
        for button in (self.suggestions_button, self.events_button):
            row.addWidget(button)
        row.addStretch(0)
        self._row = row
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def add(self, button: QWidget) -> None:
        """Add a button at the right end."""
        self._row.insertWidget(self._row.count() - 1, button)

    def show_robot(self, robot: Robot) -> None:
        """Switch to another robot."""
        self._robot = robot
        can_hear = robot.event(HEARD_EVENT) is not None
        text = _("Say something to {robot}").format(robot=robot.name)
        self.field.setPlaceholderText(text)
        self.field.setAccessibleName(text)
        self.field.setVisible(can_hear)
        self.suggestions_button.setVisible(can_hear)
        self.events_button.setVisible(any(True for _entry in self.simulated_events()))
        self.setVisible(robot.virtual and (can_hear or self.events_button.isVisibleTo(self)))

    # -- speech -------------------------------------------------------------------------------------------

    def suggestions(self) -> Sequence[str]:
        """Return the words that programs react to."""
        event = self._robot.event(HEARD_EVENT) if self._robot is not None else None
        return (
            self._get_awaited_values(event, event.filters[0]) if event is not None and event.filters else ()
        )

    def show_suggestions(self) -> None:
        """Show a menu of the words that programs react to; selecting one says it."""
        menu = Menu(self._theme, self)
        for suggestion in self.suggestions():
            menu.addAction(plain.escape_menu_text(suggestion)).triggered.connect(
                lambda _on=False, text=suggestion: self.field.submit(text)
            )
        if menu.isEmpty():
            menu.addAction(_("No program is waiting for speech")).setEnabled(False)
        self._pop_up(menu, self.suggestions_button)

    # -- simulated events ---------------------------------------------------------------------------------

    def simulated_events(self) -> Iterator[tuple[str, str, SimulatedEvent]]:
        """Yield title, icon and data of each event that can be simulated."""
        for event in self._robot.events if self._robot is not None else ():
            if event.name in {HEARD_EVENT, "released"}:  # a tap includes the release
                continue
            yield from _entries(event, self._get_awaited_values)

    def show_event_menu(self) -> None:
        """Show the menu of events."""
        menu = Menu(self._theme, self)
        for text, icon, event in list(self.simulated_events())[:MAX_ENTRIES]:
            action = menu.addAction(self._theme.icon(icon), plain.escape_menu_text(text))
            action.triggered.connect(lambda _on=False, event=event: self.event_simulated.emit(event))
        self._pop_up(menu, self.events_button)

    def _pop_up(self, menu: Menu, anchor: QWidget) -> None:
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_below(menu, anchor)


def _entries(
    event: Event, get_awaited_values: AwaitedValuesGetter
) -> Iterator[tuple[str, str, SimulatedEvent]]:
    # One entry per value, such as "head is touched" and "left hand is touched".
    if not event.filters:
        yield _event_text(event, {}), event.icon, {"happen": event.name}
        return
    name = event.filters[0]
    parameter = next((each for each in event.fields if each.name == name), None)
    if parameter is not None and parameter.choices:
        values: list[tuple[object, str]] = [(each.value, each.title) for each in parameter.choices]
    else:
        values = [(value, value) for value in get_awaited_values(event, name)]
    for value, title in values:
        yield _event_text(event, {name: title}), event.icon, {"happen": event.name, name: value}


def _event_text(event: Event, values: dict[str, str]) -> str:
    # Text of the event's block without the robot, such as "Sees something red".
    text = event.text.partition("%robot")[2].strip() or event.title
    for name, title in values.items():
        text = text.replace(f"%{name}", title)
    return text[:1].upper() + text[1:]
