"""The title of a dock: name or tabs, what is shown, chips, the panel's own buttons, "more" last."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QContextMenuEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.ui.panels.base import Density, PanelWidget
from app.ui.theme.theme import Theme
from app.ui.widgets import ElidedLabel, IconButton, paint, set_role
from app.ui.widgets.buttons import PaintedButton
from nep.i18n import _


class TitleTab(PaintedButton):
    """The name of a panel that shares its place with others; a press brings it to the front."""

    shortens = True

    def __init__(self, theme: Theme, text: str, chosen: bool) -> None:
        super().__init__(theme, text, checkable=True)
        self.setChecked(chosen)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)

    def sizeHint(self) -> QSize:
        font = self._theme.font("title")
        return QSize(round(paint.width_of(font, self.text())) + 21, max(26, round(paint.height_of(font)) + 6))

    def minimumSizeHint(self) -> QSize:
        return QSize(48, self.sizeHint().height())

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        if self.isChecked() or self.is_hovered:
            paint.box(painter, rect, theme.radius("small"), theme.colour("hover"))
        ink = theme.colour("text" if self.isChecked() else "textSecondary")
        paint.words(painter, rect, self.text(), theme.font("title"), ink, paint.CENTRE)


class DockTitle(QWidget):
    """The title of a dock; it paints the upper half of the panel's frame."""

    menu_wanted = Signal(object)

    def __init__(self, theme: Theme, panel: PanelWidget, density: Density) -> None:
        super().__init__()
        self._theme, self._panel, self._density = theme, panel, density
        self._least = theme.size("panelTitle", density)  # asked thousands of times while panels are arranged
        self._whole = panel.replaces_title()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.name = ElidedLabel("titleLarge" if density == "comfortable" else "title", "textSecondary", 120)
        self._subtitle = ElidedLabel("code", "textTertiary")
        self._tabs: list[TitleTab] = []
        self.more = IconButton(theme, "ellipsis", _("More about {panel}").format(panel=panel.title()))
        self.more.clicked.connect(lambda: self.menu_wanted.emit(self.more))
        self._row = QHBoxLayout(self)
        self._fill()
        panel.title_changed.connect(self.show_title)
        self.show_title()

    def _fill(self) -> None:
        comfortable = self._density == "comfortable"
        self._row.setContentsMargins(13 if comfortable else 11, 1, 8 if comfortable else 6, 1)
        self._row.setSpacing(8)
        if self._whole is not None:
            self._row.setContentsMargins(6, 1, 6, 1)
            self._row.addWidget(self._whole, 1)
            self.more.hide()
            return
        self._row.addWidget(self.name)
        self._row.addWidget(self._subtitle)
        widgets = self._panel.header_widgets()
        for widget in widgets:
            if widget.property("place") == "start":
                self._row.addWidget(widget)
        self._row.addStretch(1)
        for widget in widgets:
            if widget.property("place") != "start":
                self._row.addWidget(widget)
        self._row.addWidget(self.more)

    def sizeHint(self) -> QSize:
        return QSize(120, max(self._least, self._row.sizeHint().height()))

    def minimumSizeHint(self) -> QSize:
        return QSize(80, self.sizeHint().height())

    def show_title(self) -> None:
        """Take the panel's name and what it shows."""
        self.name.setText(self._panel.title())
        self._subtitle.setText(self._panel.subtitle())
        paint.show_when(self._subtitle, bool(self._panel.subtitle()) and self._whole is None)
        for tab in self._tabs:
            if tab.isChecked():
                tab.setText(self._panel.title())

    def set_active(self, active: bool) -> None:
        """The panel has the focus: its name is darker."""
        set_role(self.name, "text" if active else "textSecondary")

    def set_tabs(self, names: Sequence[tuple[str, bool, Callable[[], object]]]) -> None:
        """The panels of one place: (name, whether it is this one, how to bring it to the front)."""
        for old in self._tabs:
            self._row.removeWidget(old)
            old.deleteLater()
        self._tabs = []
        paint.show_when(self.name, not names and self._whole is None)
        for index, (text, chosen, bring) in enumerate(names):
            tab = TitleTab(self._theme, text, chosen)
            tab.clicked.connect(lambda _on=False, bring=bring: bring())
            self._row.insertWidget(index, tab)
            self._tabs.append(tab)
        self._row.setContentsMargins(5 if names else self._left(), 1, self._row.contentsMargins().right(), 1)

    def _left(self) -> int:
        if self._whole is not None:
            return 6
        return 13 if self._density == "comfortable" else 11

    @property
    def tabs(self) -> tuple[str, ...]:
        """The names of the tabs shown; empty when the panel has its place for itself."""
        return tuple(tab.text() for tab in self._tabs)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        self.menu_wanted.emit(None)
        event.accept()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        radius = theme.radius("panel")
        painter.setClipRect(rect)
        tall = rect.adjusted(0, 0, 0, 2 * radius)
        paint.box(painter, tall, radius, theme.colour("panel"), theme.colour("border"))
        paint.hairline(painter, rect, Qt.Edge.BottomEdge, theme.colour("border"))
        painter.end()
