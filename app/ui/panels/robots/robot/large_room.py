"""Enlarged view of the room over the middle of the window, next to the run bar with the Stop button."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QObject, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QHBoxLayout, QMainWindow, QVBoxLayout, QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label
from nep.i18n import _


class LargeRoom(QWidget):
    """Overlay that shows the room in place of all panels. Esc, its button or a double click close it.

    Args:
        panel: Panel within the area to cover.
        stage: Widget to show.
        buttons: Copies of the buttons in the panel's title bar.
    """

    closed = Signal()

    def __init__(self, theme: Theme, panel: QWidget, stage: QWidget, buttons: Sequence[QWidget] = ()) -> None:
        workbench = _workbench_of(panel)
        super().__init__(workbench)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._workbench = workbench
        self.is_full_screen = False
        self.setAccessibleName(_("Large room"))
        self.screen_button = Button(theme, _("Full screen"), "fullscreen", size="small")
        self.screen_button.clicked.connect(self.toggle_full_screen)
        self.back_button = Button(theme, _("Back to the panels"), "minimize-2", size="small")
        self.back_button.clicked.connect(self.dispose)
        row = QHBoxLayout()
        row.setContentsMargins(10, 6, 10, 6)
        row.addWidget(label(_("Room"), "title"))
        row.addStretch(1)
        row.setSpacing(8)
        for button in (*buttons, self.screen_button, self.back_button):
            row.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(row)
        column.addWidget(stage, 1)
        workbench.installEventFilter(self)
        self._window = workbench.window()  # receives Esc while the run bar has the focus
        self._window.installEventFilter(self)
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._retain_focus)
        self.setGeometry(workbench.rect())
        stage.show()
        self.show()
        self.raise_()
        stage.setFocus(Qt.FocusReason.OtherFocusReason)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setFocus(Qt.FocusReason.OtherFocusReason)

    def _retain_focus(self, _old: QWidget | None, new: QWidget | None) -> None:
        # Covered widgets must not get the focus: Esc would not reach the overlay, and the editor would change
        # invisibly.
        is_covered = new is not None and self._workbench.isAncestorOf(new) and not self.isAncestorOf(new)
        if is_covered and new is not self and self.isVisible():
            self.setFocus(Qt.FocusReason.OtherFocusReason)

    def toggle_full_screen(self) -> None:
        """Enter or leave the full screen mode of the window."""
        window = self.window()
        self.is_full_screen = not self.is_full_screen
        window.setWindowState(window.windowState() ^ Qt.WindowState.WindowFullScreen)
        self.screen_button.set_label(_("Leave full screen") if self.is_full_screen else _("Full screen"))

    def dispose(self) -> None:
        """Close the overlay, leave full screen mode and return the stage to the panel."""
        if self.is_full_screen:
            self.toggle_full_screen()
        self._workbench.removeEventFilter(self)
        self._window.removeEventFilter(self)
        self.hide()
        self.closed.emit()
        self.deleteLater()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self._workbench and event.type() == QEvent.Type.Resize:
            self.setGeometry(self._workbench.rect())
        if watched is self._window and isinstance(event, QKeyEvent) and self.isVisible():
            is_press = event.type() == QEvent.Type.KeyPress
            if is_press and event.key() == Qt.Key.Key_Escape:
                self.dispose()
                return True
        return super().eventFilter(watched, event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape:
            self.dispose()
        else:
            super().keyPressEvent(event)


def _workbench_of(panel: QWidget) -> QWidget:
    # Returns the window if the panel is not within the workbench.
    ancestor = panel.parentWidget()
    while ancestor is not None and not isinstance(ancestor, QMainWindow):
        ancestor = ancestor.parentWidget()
    return ancestor if ancestor is not None else panel.window()
