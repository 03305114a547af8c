"""What a person says to a virtual robot, and what they let happen to it: a field, its words, a menu."""

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
from app.ui.widgets.keyboard import is_plain
from app.ui.widgets.menus import Menu, drop_below
from nep.i18n import _

HEARS = "heard"
"""The event of a robot that hears what is said to it."""
MOST_ENTRIES = 24
MOST_WIDTH = 720
"""Wider, the field in the large room would be a line from edge to edge."""
Awaited: TypeAlias = Callable[[Event, str], Sequence[str]]
Happening: TypeAlias = dict[str, object]


class SayField(SearchField):
    """A field for words: Return says them (`said`), Down offers some (`asked`)."""

    said = Signal(str)
    asked = Signal()
    icon_name = "message-circle"

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, _("Say something"))
        self.setMaxLength(200)
        self.setMinimumWidth(60)
        self.setMaximumWidth(MOST_WIDTH)
        self._last = ""

    def sizeHint(self) -> QSize:
        return QSize(120, super().sizeHint().height())

    def say(self, words: str) -> None:
        """These words are said; the field is free for the next ones."""
        if words.strip():
            self._last = words.strip()
            self.clear()
            self.said.emit(self._last)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = event.key() if is_plain(event) else None
        if key in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.say(self.text())
        elif key == Qt.Key.Key_Up and not self.text():
            self.setText(self._last)
        elif key == Qt.Key.Key_Down:
            self.asked.emit()
        else:
            super().keyPressEvent(event)


class SayBar(QWidget):
    """The field with the words that programs wait for, and a menu of other things that may happen."""

    said = Signal(str)
    happened = Signal(object)  # a Happening, as a virtual robot's world takes it

    def __init__(self, theme: Theme, awaited: Awaited) -> None:
        """``awaited`` gives the values that programs wait for in a datum of an event."""
        super().__init__()
        self._theme, self._awaited = theme, awaited
        self._robot: Robot | None = None
        self.field = SayField(theme)
        self.words = IconButton(theme, "chevron-down", _("Words to say"), size=26)
        self.events = IconButton(theme, "zap", _("Simulate an event"), size=26)
        self.field.said.connect(self.said)
        self.field.asked.connect(self.show_words)
        self.words.clicked.connect(self.show_words)
        self.events.clicked.connect(self.show_events)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 6, 8, 6)
        row.setSpacing(4)
        row.addStretch(0)
        row.addWidget(self.field, 1)
        for button in (self.words, self.events):
            row.addWidget(button)
        row.addStretch(0)
        self._row = row
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def add(self, button: QWidget) -> None:
        """A further button, at the right."""
        self._row.insertWidget(self._row.count() - 1, button)

    def show_robot(self, robot: Robot) -> None:
        """Speak to this robot from now on."""
        self._robot = robot
        hears = robot.event(HEARS) is not None
        words = _("Say something to {robot}").format(robot=robot.name)
        self.field.setPlaceholderText(words)
        self.field.setAccessibleName(words)
        self.field.setVisible(hears)
        self.words.setVisible(hears)
        self.events.setVisible(any(True for _entry in self.happenings()))
        self.setVisible(robot.virtual and (hears or self.events.isVisibleTo(self)))

    # -- words ------------------------------------------------------------------------------------

    def choices(self) -> Sequence[str]:
        """The words that programs wait for now."""
        event = self._robot.event(HEARS) if self._robot is not None else None
        return self._awaited(event, event.filters[0]) if event is not None and event.filters else ()

    def show_words(self) -> None:
        """Offer the words that programs wait for; a choice says it at once."""
        menu = Menu(self._theme, self)
        for word in self.choices():
            menu.addAction(plain.entry(word)).triggered.connect(
                lambda _on=False, word=word: self.field.say(word)
            )
        if menu.isEmpty():
            menu.addAction(_("No program is waiting for words")).setEnabled(False)
        self._pop_up(menu, self.words)

    # -- what else may happen ---------------------------------------------------------------------

    def happenings(self) -> Iterator[tuple[str, str, Happening]]:
        """What may happen to the robot: its words, its icon, and what its world is told."""
        for event in self._robot.events if self._robot is not None else ():
            if event.name in {HEARS, "released"}:  # who taps lets go
                continue
            yield from _entries(event, self._awaited)

    def show_events(self) -> None:
        """Offer what may happen."""
        menu = Menu(self._theme, self)
        for words, icon, happening in list(self.happenings())[:MOST_ENTRIES]:
            action = menu.addAction(self._theme.icon(icon), plain.entry(words))
            action.triggered.connect(lambda _on=False, told=happening: self.happened.emit(told))
        self._pop_up(menu, self.events)

    def _pop_up(self, menu: Menu, anchor: QWidget) -> None:
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        drop_below(menu, anchor)


def _entries(event: Event, awaited: Awaited) -> Iterator[tuple[str, str, Happening]]:
    """An event once for each value that it may have; "head is touched", "left hand is touched"."""
    if not event.filters:
        yield _sentence(event, {}), event.icon, {"happen": event.name}
        return
    name = event.filters[0]
    parameter = next((each for each in event.fields if each.name == name), None)
    if parameter is not None and parameter.choices:
        values: list[tuple[object, str]] = [(each.value, each.title) for each in parameter.choices]
    else:
        values = [(value, value) for value in awaited(event, name)]
    for value, title in values:
        yield _sentence(event, {name: title}), event.icon, {"happen": event.name, name: value}


def _sentence(event: Event, values: dict[str, str]) -> str:
    """What a block says of an event, without the robot: "Sees something red"."""
    words = event.text.partition("%robot")[2].strip() or event.title
    for name, title in values.items():
        words = words.replace(f"%{name}", title)
    return words[:1].upper() + words[1:]
