"""Parts of the inspector: what it says of pictures, what it copies, its search field and its foot."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.ui.theme import Theme
from app.ui.widgets import Elided, IconButton, Line, SearchField, label, paint
from app.ui.words import grouped, latency_words, size_words

if TYPE_CHECKING:
    from nep.message import Message


def image_summary(message: Message) -> Mapping[str, object]:
    """What is worth reading of a picture: how it is coded, its shape, its bytes; never its pixels."""
    shape = message.extension.get("shape")
    if shape is None:
        shape = list(getattr(message.payload, "shape", ()))
    height, width, *depth = (
        [*shape, 0, 0][: max(2, len(shape))] if isinstance(shape, (list, tuple)) else (0, 0)
    )
    return {
        "encoding": message.extension.get("encoding", "not told"),
        "width": width,
        "height": height,
        "channels": depth[0] if depth else 1,
        "size": size_words(message.size_bytes),
    }


def tells_its_shape(message: Message) -> bool:
    """Whether it is a picture that can be summed up without decoding it."""
    return message.codec == "image" and message.extension.get("shape") is not None


def plain_words(value: object) -> str:
    """A value for the clipboard: text as it is, everything else as JSON."""
    if isinstance(value, str):
        return value
    if isinstance(value, (bytes, bytearray, memoryview)):
        return bytes(value).hex(" ")
    return json.dumps(value, indent=2, ensure_ascii=False, default=str)


def message_facts(message: Message) -> str:
    """``seq 18 204   412 B   latency 0.6 ms``; what is not known is left out."""
    facts = [size_words(message.size_bytes)]
    if message.seq is not None:
        facts.insert(0, f"seq {grouped(message.seq)}")
    if message.stamp_ns is not None:
        latency = (time.time_ns() - message.stamp_ns) / 1e9
        if 0 <= latency < 3600:
            facts.append(f"latency {latency_words(latency)}")
    return "   ".join(facts)


class FindField(SearchField):
    """Finds a key or a value: Return goes to the next one, Esc clears, Down goes into the tree."""

    next_wanted = Signal()
    leave = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, "Find a key or value")

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.next_wanted.emit()
        elif event.key() == Qt.Key.Key_Escape and self.text():
            self.clear()
        elif event.key() == Qt.Key.Key_Down:
            self.leave.emit()
        else:
            super().keyPressEvent(event)


class Legend(QWidget):
    """Says what the bar at a row's left means."""

    WORDS = "changed"

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName("A bar at the left marks changed values")

    def sizeHint(self) -> QSize:
        font = self._theme.font("small")
        return QSize(round(paint.width_of(font, self.WORDS)) + 10, max(18, round(paint.height_of(font)) + 2))

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        colour = self._theme.colour("changed")
        painter.fillRect(QRectF(0, self.height() / 2 - 7, 3, 14), colour)
        words = QRectF(self.rect()).adjusted(7, 0, 3, 0)
        paint.words(painter, words, self.WORDS, self._theme.font("small"), colour)
        painter.end()


class Foot(QWidget):
    """The path of the chosen value with its copy buttons; below, the message's facts."""

    def __init__(self, theme: Theme, copy_value: Callable[[], None], copy_path: Callable[[], None]) -> None:
        super().__init__()
        self.path = label("", "code", role="textSecondary")
        self.path.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.path.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.copy_value = IconButton(theme, "copy", "Copy value", "Ctrl+C", size=26)
        self.copy_path = IconButton(theme, "link", "Copy path", "Ctrl+Shift+C", size=26)
        self.copy_value.clicked.connect(copy_value)
        self.copy_path.clicked.connect(copy_path)
        self.facts = Elided("small", "textTertiary")
        self.legend = Legend(theme)
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(0)
        for parts in ((self.path, self.copy_value, self.copy_path), (self.facts, self.legend)):
            rows.addWidget(Line(theme))
            row = QHBoxLayout()
            row.setContentsMargins(10, 3, 8, 3)
            row.setSpacing(2)
            row.addWidget(parts[0], 1)
            for part in parts[1:]:
                row.addWidget(part)
            rows.addLayout(row)

    def show_path(self, path: str) -> None:
        """The path of the chosen value; empty when none is."""
        self.path.setText(path)
        self.path.setToolTip(path)
        for button in (self.copy_value, self.copy_path):
            button.setEnabled(bool(path))
