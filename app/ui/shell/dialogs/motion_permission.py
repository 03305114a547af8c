"""Card that asks for permission before a real robot moves for the first time. Stop stays accessible."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QGraphicsDropShadowEffect, QHBoxLayout, QVBoxLayout, QWidget
from shiboken6 import isValid

from app.core.robots.motion.permission import MotionPermission
from app.errors import SettingsError
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Switch, label
from app.ui.widgets.labels import IconLabel
from nep.i18n import _

WIDTH = 480
TOP_SHARE = 0.42  # below every Stop: those of the run bar and of the robots
TILE_SIZE, ICON_SIZE, MARGIN, BUTTON_GAP = 40, 20, 20, 10


class MotionPermissionCard(QWidget):
    """Card that shows the pending question of `MotionPermission`. Esc cancels.

    "Cancel" has the initial focus, so that an Enter that was typed for another widget doesn't allow
    motion.
    """

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        permission: MotionPermission,
        report_error: Callable[[str], object],
    ) -> None:
        # `report_error` is called with a message if "always" can't be saved.
        super().__init__(window)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._theme, self._permission = theme, permission
        self._last_revision = permission.revision
        self._previous_focus: QWidget | None = None
        self._report_error = report_error
        self._always_text = ""
        self.title = label("", "heading", wrap=True)
        self.message = label("", "bodyLarge", role="textSecondary", wrap=True)
        self.always_switch = Switch(theme, "")
        self.allow_button = Button(theme, _("Allow motion"), "footprints", kind="primary", size="form")
        self.cancel_button = Button(theme, _("Cancel"), size="form")
        for button in (self.allow_button, self.cancel_button):
            button.allow_shrinking()
        self.allow_button.clicked.connect(lambda: self._answer(is_allowed=True))
        self.cancel_button.clicked.connect(lambda: self._answer(is_allowed=False))
        self._lay_out(theme)
        shadow = QGraphicsDropShadowEffect(self)
        shadow.setBlurRadius(32)
        shadow.setOffset(0, 8)
        shadow.setColor(theme.colour("shadow"))
        theme.changed.connect(lambda: shadow.setColor(theme.colour("shadow")))
        self.setGraphicsEffect(shadow)
        window.installEventFilter(self)
        self.hide()

    def _lay_out(self, theme: Theme) -> None:
        text_column = QVBoxLayout()
        text_column.setSpacing(4)
        text_column.addWidget(self.title)
        text_column.addWidget(self.message)
        top = QHBoxLayout()
        top.setSpacing(14)
        tile = IconLabel(theme, "footprints", "warn", ICON_SIZE, scales=False)
        tile.setProperty("tile", "warn")
        tile.setFixedSize(TILE_SIZE, TILE_SIZE)
        top.addWidget(tile, 0, Qt.AlignmentFlag.AlignTop)
        top.addLayout(text_column, 1)
        footer = QHBoxLayout()
        footer.setSpacing(BUTTON_GAP)
        footer.addWidget(self.always_switch)
        footer.addStretch(1)
        footer.addWidget(self.cancel_button)
        footer.addWidget(self.allow_button)
        column = QVBoxLayout(self)
        column.setContentsMargins(MARGIN, 18, MARGIN, 16)
        column.setSpacing(16)
        column.addLayout(top)
        column.addLayout(footer)

    def refresh(self) -> None:
        """Show the pending question, or hide the card if there is none."""
        if self._permission.revision == self._last_revision:
            return
        self._last_revision = self._permission.revision
        question = self._permission.question
        if question is None:
            self._close()
            return
        names = list(question.names)
        self.title.setText(plain.make_breakable(question.title))
        self.message.setText(plain.make_breakable(question.message))
        self._always_text = _("Always for these")
        if len(names) == 1:
            self._always_text = _("Always for {robot}").format(robot=names[0])
        self.always_switch.setAccessibleName(self._always_text)
        self.always_switch.setChecked(False)
        self.allow_button.set_label(_("Allow motion"))
        self.setAccessibleName(question.title)
        self.setAccessibleDescription(question.message)
        if not self.isVisible():
            self._previous_focus = QApplication.focusWidget()
        self.show()  # before measuring: showing the card applies fonts and margins of the style sheet
        self._reposition()
        self.raise_()
        self.cancel_button.setFocus(Qt.FocusReason.PopupFocusReason)

    def _close(self) -> None:
        focus = QApplication.focusWidget()
        had_focus = focus is not None and self.isAncestorOf(focus)
        self.hide()
        before, self._previous_focus = self._previous_focus, None
        if had_focus and before is not None and isValid(before) and before.isVisible():
            before.setFocus(Qt.FocusReason.PopupFocusReason)

    def _answer(self, *, is_allowed: bool) -> None:
        try:
            self._permission.answer(
                is_allowed=is_allowed, is_permanent=is_allowed and self.always_switch.isChecked()
            )
        except SettingsError as error:
            self._report_error(error.sentence)
        self.refresh()

    def _reposition(self) -> None:
        window = self.parentWidget()
        if window is None:
            return
        width = min(round(self._theme.scaled(WIDTH)), window.width() - 32)
        self.setFixedWidth(width)
        self._set_always_text(width)
        layout = self.layout()
        if layout is not None:
            layout.invalidate()
            layout.activate()
        height = layout.heightForWidth(width) if layout is not None else -1
        self.resize(width, max(height, self.minimumSizeHint().height()))
        top = round(window.height() * TOP_SHARE)
        self.move((window.width() - width) // 2, min(top, max(8, window.height() - self.height() - 8)))

    def _set_always_text(self, width: int) -> None:
        # The robot's name is on the switch only if it fits there; the title always contains it.
        self.always_switch.setText(self._always_text)
        buttons = self.cancel_button.sizeHint().width() + self.allow_button.sizeHint().width()
        if self.always_switch.sizeHint().width() > width - 2 * MARGIN - 2 * BUTTON_GAP - buttons:
            self.always_switch.setText(_("Always"))
        self.always_switch.updateGeometry()

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize and self.isVisible():
            self._reposition()
        return False

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self._answer(is_allowed=False)
        else:
            super().keyPressEvent(event)
