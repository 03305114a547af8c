"""Empty state of a panel, which explains its future contents and offers next steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets.buttons import Button
from app.ui.widgets.labels import IconLabel, label
from app.ui.widgets.lists.scroll_areas import ContentScrollArea

TILE_SIZE, BELOW_TILE = 56, 16
TEXT_WIDTH = 400
MARGIN = 12
ROW_TOP_MARGIN = 14


@dataclass(frozen=True)
class EmptyAction:
    """Button of an empty state.

    Attributes:
        text: Text of the button.
        run: Callback.
        icon: Name of the icon, or None.
        is_primary: True if the button is filled.
    """

    text: str
    run: Callable[[], object]
    icon: str | None = None
    is_primary: bool = False


class EmptyState(QWidget):
    """Placeholder with an icon, a title, one or two lines of text, and up to two buttons."""

    def __init__(
        self, theme: Theme, icon: str, title: str, text: str, actions: Sequence[EmptyAction] = ()
    ) -> None:
        super().__init__()
        self._theme = theme
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._tile = IconLabel(theme, icon, side=theme.size("icon", "empty"), scales=False)
        self._tile.setProperty("tile", "empty")
        self._tile.setFixedSize(TILE_SIZE, TILE_SIZE + BELOW_TILE)
        self._title = label(title, "empty", wrap=True)
        self._text = label(text, "bodyLarge", role="textSecondary", wrap=True)
        for text_label in (self._title, self._text):
            text_label.setAlignment(Qt.AlignmentFlag.AlignCenter)
        content = QWidget()
        column = QVBoxLayout(content)
        column.setContentsMargins(16, MARGIN, 16, MARGIN)
        column.setSpacing(0)
        column.addStretch(1)
        column.addWidget(self._tile, 0, Qt.AlignmentFlag.AlignHCenter)
        column.addWidget(self._title)
        column.addSpacing(4)
        inner = QHBoxLayout()
        inner.addStretch(1)
        self._text.setMaximumWidth(TEXT_WIDTH)
        inner.addWidget(self._text, 100)
        inner.addStretch(1)
        column.addLayout(inner)
        self._row = QHBoxLayout()
        self._row.setSpacing(8)
        column.addLayout(self._row)
        self._column = column
        column.addStretch(1)
        self._buttons: list[Button] = []
        outer_layout = QVBoxLayout(self)
        outer_layout.setContentsMargins(0, 0, 0, 0)
        area = ContentScrollArea(content)
        area.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        outer_layout.addWidget(area)
        self.set_actions(actions)

    def set_texts(self, title: str, text: str, icon: str | None = None) -> None:
        """Set the title, the text and, unless it is None, the icon."""
        self._title.setText(title)
        self._text.setText(text)
        if icon is not None:
            self._tile.set_icon(icon, "textSecondary")
        self._update_visibility()

    def _update_visibility(self) -> None:
        # If the height is low, the tile is hidden first, then the text; the buttons stay.
        width = self.width() - 32
        text_height = self._text.heightForWidth(min(width, TEXT_WIDTH))
        # otherwise the last line would be cut off if the height is low
        self._text.setMinimumHeight(max(0, text_height))
        content_height = self._title.heightForWidth(width) + text_height + 4
        content_height += ROW_TOP_MARGIN + self._buttons[0].sizeHint().height() if self._buttons else 0
        self._tile.setVisible(self.height() - 2 * MARGIN >= content_height + TILE_SIZE + BELOW_TILE)
        is_low = bool(self._buttons) and self.height() - 2 * MARGIN < content_height
        self._text.setVisible(not is_low)
        self._title.setToolTip(plain.tip(self._text.text()) if is_low else "")
        self._row.setContentsMargins(0, 0 if is_low else ROW_TOP_MARGIN, 0, 0)
        margin = 2 if is_low else MARGIN
        self._column.setContentsMargins(16, margin, 16, margin)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._update_visibility()

    def set_actions(self, actions: Sequence[EmptyAction]) -> None:
        """Replace the buttons."""
        while (item := self._row.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.deleteLater()
        self._buttons = []
        self._row.addStretch(1)
        for action in actions:
            button = Button(self._theme, action.text, action.icon, size="form")
            button.allow_shrinking()
            button.set_kind("primary" if action.is_primary else "plain")
            button.clicked.connect(lambda _on=False, run=action.run: run())
            self._row.addWidget(button)
            self._buttons.append(button)
        self._row.addStretch(1)
        self._update_visibility()

    def minimumSizeHint(self) -> QSize:
        return QSize(120, 120)
