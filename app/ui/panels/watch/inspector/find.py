"""Find bar of the inspector: field, number of matches, next and previous."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.ui.panels.watch.inspector.values import search
from app.ui.theme.theme import Theme
from app.ui.widgets import IconButton, SearchField, paint
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.keyboard import has_no_modifiers
from nep.i18n import _, pgettext

if TYPE_CHECKING:
    from app.core.messages.lazy_json import JsonIndex

MAX_MATCHES = 1000
Path = tuple[str | int, ...]


def find_in_text(index: JsonIndex, needle: str, max_matches: int = MAX_MATCHES) -> list[int]:
    """Return the byte offsets of a text in a large JSON message. The case of ASCII letters is ignored.

    Args:
        index: Index of the message.
        needle: Text to find.
        max_matches: Maximum number of offsets to return.
    """
    text, pattern = bytes(index.data).lower(), needle.encode().lower()
    offsets: list[int] = []
    offset = text.find(pattern) if pattern else -1
    while offset >= 0 and len(offsets) < max_matches:
        offsets.append(offset)
        offset = text.find(pattern, offset + len(pattern))
    return offsets


class FindField(SearchField):
    """Find field: Return or F3 selects the next match, with Shift the previous one; Esc clears the field.

    Down gives the tree the focus.
    """

    step_requested = Signal(int)
    exited = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, _("Find a key, value or $ path"))
        self._count = ""

    @property
    def count(self) -> str:
        """Text at the right end of the field, such as ``2 of 111``."""
        return self._count

    def show_count(self, text: str) -> None:
        """Show a text such as ``2 of 111`` in the field."""
        if text != self._count:
            self._count = text
            room = round(paint.width_of(self._theme.font("small"), text)) + 6 if text else 0
            self.setTextMargins(20, 0, room, 0)
            self.setAccessibleDescription(text)
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if self._count:
            painter = QPainter(self)
            room = QRectF(self.rect()).adjusted(0, 0, -8, 0)
            colour = self._theme.colour("textTertiary")
            paint.text_line(painter, room, self._count, self._theme.font("small"), colour, paint.RIGHT)
            painter.end()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        is_backward = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_F3}:
            self.step_requested.emit(-1 if is_backward else 1)
        elif event.key() == Qt.Key.Key_Escape and self.text():
            self.clear()
        elif event.key() == Qt.Key.Key_Down and has_no_modifiers(event):
            self.exited.emit()
        else:
            super().keyPressEvent(event)


class FindBar(QWidget):
    """Find bar with a field, the number of matches, and buttons for the next and previous match.

    Matches belong to one message. Call `invalidate_matches` when the message changes. The next step
    then searches again and continues at the same position.

    Args:
        source: Returns the value to search, and the index of a large message or None.

    Signals:
        match_selected: Path of the selected match.
        query_changed: Query (a text that begins with ``$``), or "" if the text isn't a query.
    """

    match_selected = Signal(object)
    query_changed = Signal(str)

    def __init__(self, theme: Theme, source: Callable[[], tuple[object, JsonIndex | None]]) -> None:
        super().__init__()
        self._source = source
        self._matches: list[Path] | list[int] | None = None
        self._index: JsonIndex | None = None
        self._has_more = False
        self._match_index = -1
        self.field = FindField(theme)
        self.field.textChanged.connect(self.search)
        self.field.step_requested.connect(self.step)
        self.previous_button = IconButton(theme, "chevron-up", _("Previous"), "Shift+Return", size=22)
        self.next_button = IconButton(theme, "chevron-down", _("Next"), "Return", size=22)
        self.previous_button.clicked.connect(lambda: self.step(-1))
        self.next_button.clicked.connect(lambda: self.step(1))
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(1)
        row.addWidget(self.field, 1)
        for button in (self.previous_button, self.next_button):
            row.addWidget(button)
            button.hide()
        self.setFocusProxy(self.field)

    @property
    def matches(self) -> list[Path] | list[int]:
        """Matches found so far: paths, or byte offsets in a large message."""
        return self._matches or []

    def search(self, text: str) -> None:
        """Search for a text and select the first match. A text that begins with ``$`` is a query."""
        self._match_index = -1
        self._matches = []
        is_query = self.is_query
        for button in (self.previous_button, self.next_button):
            button.setVisible(bool(text) and not is_query)
        if is_query:
            self.field.show_count("")
            self.set_invalid(is_invalid=False)
        self.query_changed.emit(text if is_query else "")
        if is_query:
            return
        self._search(text)
        self._update_count(is_invalid=bool(text) and not self.matches)
        if self.matches:
            self.step(1)

    def invalidate_matches(self) -> None:
        """Discard the matches; called when the message changes."""
        self._matches = None

    @property
    def is_query(self) -> bool:
        """True if the text is a query."""
        return self.field.text().startswith("$")

    def step(self, by: int) -> None:
        """Select the next match (`by` is 1) or the previous one (-1)."""
        text = self.field.text()
        if not text or self.is_query:
            return
        if self._matches is None:
            last = self._match_index
            self._search(text)
            self._match_index = min(last, len(self.matches) - 1)
        if self.matches:
            self._match_index = (self._match_index + by) % len(self.matches)
            match = self.matches[self._match_index]
            is_offset = isinstance(match, int) and self._index is not None
            self.match_selected.emit(self._index.path_to(match) if is_offset else match)  # type: ignore[union-attr, arg-type]
        self._update_count(is_invalid=not self.matches)

    def _search(self, text: str) -> None:
        if not text:
            self._matches = []
            return
        value, self._index = self._source()
        matches: list[Path] | list[int]
        if self._index is not None:
            matches = find_in_text(self._index, text, MAX_MATCHES + 1)
        else:
            matches = list(islice(search(value, text), MAX_MATCHES + 1))
        self._has_more = len(matches) > MAX_MATCHES
        self._matches = matches[:MAX_MATCHES]

    def _update_count(self, *, is_invalid: bool) -> None:
        total = f"{len(self.matches)}{'+' if self._has_more else ''}"
        text = _("{place} of {total}") if self.matches else pgettext("found", "none")
        text = text.format(place=self._match_index + 1, total=total)
        self.field.show_count(text if self.field.text() else "")
        self.set_invalid(is_invalid=is_invalid)

    def set_invalid(self, *, is_invalid: bool) -> None:
        """Show or remove the error style of the field.

        Args:
            is_invalid: True if there is no match or the query is invalid.
        """
        set_invalid(self.field, is_invalid=is_invalid)
