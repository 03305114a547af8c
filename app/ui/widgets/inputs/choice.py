"""A combo box with our own arrow, and colour swatches."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import (
    QComboBox,
    QLineEdit,
    QSizePolicy,
    QStyledItemDelegate,
    QWidget,
)

from app.ui.text import plain
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.buttons import Button, PaintedButton
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.labels import label
from app.ui.widgets.menus import EditMenu, cut, make_round
from nep.i18n import _, lazy

# What a robot's lamps show, not how Studio looks: values of the action, so they are no tokens.
LAMP_COLOURS: tuple[tuple[str, str], ...] = (
    ("#ffffff", lazy("white")),
    ("#3ab7ff", lazy("sky blue")),
    ("#35c26b", lazy("green")),
    ("#ffc53d", lazy("amber")),
    ("#ff6b5e", lazy("coral")),
    ("#b06bff", lazy("violet")),
)
SWATCH = 32
SHOWN_AT_ONCE = 12


class Choice(QComboBox):
    """One of many words; the wheel turns it only with the focus."""

    def __init__(self, theme: Theme, options: Sequence[tuple[str, str]] = (), *, name: str = "") -> None:
        """Options are (value, label)."""
        super().__init__()
        self._theme = theme
        self.setAccessibleName(name)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setProperty("focusRadius", theme.radius("control"))
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        for value, words in options:
            self.addItem(words, value)
        self.setItemDelegate(QStyledItemDelegate(self))  # which the style sheet can give room
        self.setMaxVisibleItems(SHOWN_AT_ONCE)
        make_round(self.view().window())

    @property
    def value(self) -> str:
        """The chosen value, or "" when there is none."""
        data = self.currentData()
        return data if isinstance(data, str) else self.currentText()

    def set_value(self, value: str) -> None:
        """Choose a value that is offered; another changes nothing."""
        index = self.findData(value)
        if index >= 0:
            self.setCurrentIndex(index)

    def sizeHint(self) -> QSize:
        font = self.font()
        widest = max((paint.width_of(font, self.itemText(i)) for i in range(self.count())), default=60)
        height = max(self._theme.size("control", "normal"), round(paint.height_of(font)) + 10)
        return QSize(round(widest) + 46, height)

    def minimumSizeHint(self) -> QSize:
        return QSize(min(80, self.sizeHint().width()), self.sizeHint().height())

    def showPopup(self) -> None:
        super().showPopup()
        cut(self.view().window(), self._theme.radius("panel"))

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme = self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        fill = theme.colour("hover" if self.underMouse() else "sunken" if theme.dark else "panel")
        paint.box(painter, rect, theme.radius("control"), fill, theme.colour("controlBorder"))
        ink = theme.colour("text" if self.isEnabled() else "textDisabled")
        paint.words(painter, rect.adjusted(10, 0, -30, 0), self.currentText(), self.font(), ink)
        square = QRectF(rect.right() - 26, rect.center().y() - 8, 16, 16)
        paint_icon(painter, square, "chevron-down", theme.colour("textSecondary"))
        painter.end()


class _Swatch(PaintedButton):
    def __init__(self, theme: Theme, colour: str, name: str) -> None:
        super().__init__(theme, radius="control", checkable=True)
        self.colour = colour
        self.setAutoExclusive(True)
        self.setAccessibleName(name)
        self.setToolTip(plain.tip(name))
        self.setFixedSize(SWATCH + 8, SWATCH + 8)
        self.setProperty("focusInset", 4)

    def paint_button(self, painter: QPainter, rect: QRectF) -> None:
        theme = self._theme
        rect = rect.adjusted(4, 4, -4, -4)
        radius = theme.radius("control")
        if self.isChecked():
            paint.box(painter, rect.adjusted(-4, -4, 4, 4), radius + 4, None, theme.colour("accent"), 2)
        paint.box(painter, rect, radius, QColor(self.colour), theme.colour("controlBorder"))


class ColourSwatches(QWidget):
    """Colours to choose from with the name of the chosen one beside them, and "other" by its number."""

    changed = Signal(str)

    def __init__(
        self,
        theme: Theme,
        value: str = LAMP_COLOURS[0][0],
        colours: Sequence[tuple[str, str]] = LAMP_COLOURS,
        *,
        name: str = "",
    ) -> None:
        super().__init__()
        self._names = {colour.lower(): _(words) for colour, words in colours}
        self._value = ""
        name = name or _("Colour")
        self.setAccessibleName(name)
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Preferred)
        row = Flow(self, gap=2)
        self._swatches: dict[str, _Swatch] = {}
        for colour, words in self._names.items():
            swatch = _Swatch(theme, colour, words)
            swatch.clicked.connect(lambda _on=False, colour=colour: self._choose(colour))
            self._swatches[colour] = swatch
            row.addWidget(swatch)
        self._name = label("", "bodyLarge", role="textSecondary")
        self._name.setContentsMargins(6, 0, 0, 0)
        row.addWidget(self._name)
        self._other = Button(theme, _("Other"), kind="ghost", size="small")
        self._field = QLineEdit()
        EditMenu(theme, self._field)
        self._field.setAccessibleName(_("{value}, as a number like #33aaff").format(value=name))
        self._field.setPlaceholderText("#33aaff")
        self._field.setMaxLength(7)
        self._field.setFixedWidth(92)
        self._field.hide()
        row.addWidget(self._other)
        row.addWidget(self._field)
        self._other.clicked.connect(self._ask)
        self._field.editingFinished.connect(self._typed)
        self.set_value(value)

    @property
    def value(self) -> str:
        """The chosen colour, ``#rrggbb``."""
        return self._value

    def set_value(self, value: str) -> None:
        """Show a colour without telling; text that is no colour changes nothing."""
        colour = QColor(value)
        if not colour.isValid():
            return
        self._value = colour.name()
        for key, swatch in self._swatches.items():
            swatch.setAutoExclusive(False)
            swatch.setChecked(key == self._value)
            swatch.setAutoExclusive(True)
        self._name.setText(self._names.get(self._value, self._value))

    def _choose(self, value: str) -> None:
        if value != self._value:
            self.set_value(value)
            self.changed.emit(self._value)

    def _ask(self) -> None:
        self._field.setText(self._value)
        self._other.hide()
        self._field.show()
        self._field.setFocus(Qt.FocusReason.OtherFocusReason)
        self._field.selectAll()

    def _typed(self) -> None:
        wrong = not QColor(self._field.text()).isValid()
        self._field.setProperty("wrong", "true" if wrong else "false")
        self._field.style().unpolish(self._field)
        self._field.style().polish(self._field)
        if not wrong:
            self._choose(QColor(self._field.text()).name())
            self._field.hide()
            self._other.show()
