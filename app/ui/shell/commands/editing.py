"""Cut, copy, paste and select all of the Edit menu, for the focused field or the blocks."""

from __future__ import annotations

from PySide6.QtWidgets import QApplication, QLineEdit, QMenu, QMenuBar, QPlainTextEdit, QTextEdit, QWidget
from shiboken6 import isValid

from app.ui.intents import MenuEdit, UseEditMenu
from app.ui.shell.commands.shell import Shell
from nep.i18n import _

Field = QLineEdit | QPlainTextEdit | QTextEdit
FIELD_TYPES = (QLineEdit, QPlainTextEdit, QTextEdit)
MODIFYING_EDITS = frozenset({"cut", "paste"})


class EditCommands:
    """Handlers of the entries of the Edit menu.

    The menu only shows the shortcuts, such as Ctrl+C; the focused field, page or panel handles them.
    """

    def __init__(self, shell: Shell) -> None:
        self._shell = shell
        self._last_focused: QWidget | None = None
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._on_focus_changed)

    def _on_focus_changed(self, _old: QWidget | None, now: QWidget | None) -> None:
        # The menu bar takes the focus when it is opened by Alt: remember the widget that had it before.
        if now is not None and not isinstance(now, (QMenu, QMenuBar)):
            self._last_focused = now

    def run(self, edit: MenuEdit) -> None:
        """Apply an edit to the focused field or to the blocks."""
        field = self._focused_field()
        if field is not None:
            getattr(field, edit)()
            return
        if self._shell.current_layout == "behaviour":
            self._shell.request(UseEditMenu(edit))

    def disabled_reason(self, edit: MenuEdit) -> str:
        """Return the reason why an edit is unavailable, or "" if it is available."""
        field = self._focused_field()
        if field is not None:
            return _("This text can't be changed") if edit in MODIFYING_EDITS and field.isReadOnly() else ""
        return "" if self._shell.current_layout == "behaviour" else _("Only for blocks and text fields")

    def _focused_field(self) -> Field | None:
        focused = (
            self._last_focused if self._last_focused is not None and isValid(self._last_focused) else None
        )
        return focused if isinstance(focused, FIELD_TYPES) and focused.isVisible() else None
