"""Sheet with all keyboard shortcuts, to search, change, swap and reset them."""

from __future__ import annotations

from typing import cast

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.ui.shell.actions.actions import STOP_COMMAND
from app.ui.shell.actions.shortcuts import FIXED_KEYS, Shortcuts, format_key
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text.numbers import shortcut_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, SearchField, label, paint
from app.ui.widgets.lists.entry_list import EntryList, Heading, Line
from app.ui.widgets.lists.fuzzy import Entry, Match, match
from nep.i18n import _, lazy

WIDTH, HEIGHT = 680, 640
MODIFIER_KEYS = frozenset(
    {
        Qt.Key.Key_Control,
        Qt.Key.Key_Shift,
        Qt.Key.Key_Alt,
        Qt.Key.Key_AltGr,
        Qt.Key.Key_Meta,
        Qt.Key.Key_unknown,
    }
)
GROUP_LABELS = {"file": lazy("File"), "panel": lazy("Panels"), "edit": lazy("Edit")}
HINT = lazy("Press Enter or click to change a shortcut. Press Delete to remove it.")


class ShortcutSheet(Overlay):
    """Sheet with a table of shortcuts.

    While a new shortcut is recorded, the sheet receives all keys except F12, and Esc cancels.
    """

    top = 72

    def __init__(self, theme: Theme, window: QWidget, shortcuts: Shortcuts) -> None:
        super().__init__(theme, window, _("Keyboard shortcuts"))
        self._shortcuts = shortcuts
        self._recorded_command = ""
        self._pending_assignment: tuple[str, str] | None = None  # command, and the key that another one holds
        self.field = SearchField(theme, _("Find a command or key"))
        self.rows = EntryList(theme, _("Keyboard shortcuts"))
        self.hint = label(_(HINT), "body", role="textSecondary", wrap=True)
        self.swap = Button(theme, _("Swap shortcuts"), size="small")
        self.reset = Button(theme, _("Reset this shortcut"), size="small")
        self.reset_all = Button(theme, _("Reset all"), size="small")
        self._lay_out()
        self.field.installEventFilter(self)
        self.field.textChanged.connect(self._show)
        self.rows.row_activated.connect(self.record)
        self.rows.selection_moved.connect(self._on_selection_changed)
        self.swap.clicked.connect(self._swap)
        self.reset.clicked.connect(self._reset)
        self.reset_all.clicked.connect(shortcuts.reset_all)
        shortcuts.changed.connect(self._show)

    def _lay_out(self) -> None:
        header = self.create_header(label(_("Keyboard shortcuts"), "heading"))
        footer = QHBoxLayout()
        footer.setSpacing(8)
        footer.addWidget(self.hint, 1)
        for button in (self.swap, self.reset, self.reset_all):
            footer.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 14, 1, 14)
        column.setSpacing(10)
        for part, margin in ((header, 19), (self.field, 19), (self.rows, 0), (footer, 19)):
            row = QHBoxLayout()
            row.setContentsMargins(margin, 0, margin, 0)
            if isinstance(part, QWidget):
                row.addWidget(part)
            else:
                row.addLayout(part)
            column.addLayout(row, 1 if part is self.rows else 0)
        paint.show_when(self.swap, False)

    def initial_focus(self) -> QWidget:
        return self.field

    def preferred_size(self, room: QSize) -> QSize:
        scaled = self.theme.scaled
        return QSize(min(room.width(), round(scaled(WIDTH))), min(room.height(), round(scaled(HEIGHT))))

    def open(self) -> None:
        """Open the sheet without a filter."""
        self.field.clear()
        self._stop_recording()
        self._show()
        super().open()

    def open_for(self, name: str) -> None:
        """Open the sheet, select a command by name, and start to record a new shortcut for it."""
        self.open()
        self._show(f"command:{name}")
        self.record()

    def _show(self, selected_id: str = "") -> None:
        query = self.field.text().strip()
        before = self.rows.entry
        lines: list[Line] = []
        for heading, entry in self._entries():
            text = f"{entry.text} {shortcut_text(entry.key)}" if query else entry.text
            text_match = match(query, text)
            if text_match is None:
                continue
            if Heading(heading) not in lines:
                lines.append(Heading(heading))
            end = len(entry.text)
            spans = tuple((begin, min(stop, end)) for begin, stop in text_match[1] if begin < end)
            lines.append(Match(entry, 0.0, spans if query else ()))
        entry_id = (
            selected_id if selected_id.startswith(("command:", "fixed:")) else before.id if before else ""
        )
        self.rows.show_lines(lines, entry_id)
        self._on_selection_changed()

    def _entries(self) -> list[tuple[str, Entry]]:
        groups: dict[str, list[Entry]] = {}
        for command in self._shortcuts.commands.values():
            if not command.in_shortcuts:
                continue
            keys = "\n".join(self._shortcuts.shortcuts_of(command.id))
            note = _("custom") if self._shortcuts.is_customised(command.id) else ""
            group_name = command.menu or GROUP_LABELS.get(command.id.partition(".")[0], "View")
            group = groups.setdefault(_(group_name), [])
            group.append(Entry(f"command:{command.id}", command.label, "", note, keys))
        for number, fixed_key in enumerate(FIXED_KEYS):
            keys = "\n".join(fixed_key.keys.split(", "))
            groups.setdefault(_(fixed_key.scope), []).append(
                Entry(f"fixed:{number}", _(fixed_key.label), "", _("always"), keys)
            )
        return [(heading, entry) for heading, entries in groups.items() for entry in entries]

    def _on_selection_changed(self) -> None:
        entry = self.rows.entry
        is_command = entry is not None and entry.kind == "command"
        self.reset.setEnabled(is_command and entry is not None and self._shortcuts.is_customised(entry.name))
        self.reset_all.setEnabled(
            any(self._shortcuts.is_customised(name) for name in self._shortcuts.commands)
        )
        if entry is not None and self.isVisible() and not self._recorded_command:
            paint.announce(self.field, str(self.rows.currentIndex().data(Qt.ItemDataRole.AccessibleTextRole)))

    def record(self) -> None:
        """Start to record a new shortcut for the selected command; a fixed shortcut can't be changed."""
        entry = self.rows.entry
        if entry is None:
            return
        if entry.kind != "command":
            self._set_status(_("The shortcut of “{command}” can't be changed.").format(command=entry.text))
            return
        self._recorded_command, self._pending_assignment = entry.name, None
        self.rows.delegate.waiting_entry_id = entry.id
        paint.show_when(self.swap, False)
        self.field.setFocus(Qt.FocusReason.OtherFocusReason)
        message = _("Press the new shortcut for “{command}”. Esc cancels.")
        self._set_status(message.format(command=entry.text))
        self.rows.viewport().update()

    def _stop_recording(self, message: str = "") -> None:
        self._recorded_command = self.rows.delegate.waiting_entry_id = ""
        self._pending_assignment = None
        paint.show_when(self.swap, False)
        self._set_status(message or _(HINT))
        self.rows.viewport().update()

    def _set_status(self, message: str) -> None:
        self.hint.setText(message)
        if message != _(HINT) and self.isVisible():
            paint.announce(self.hint, message)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is not self.field:
            return super().eventFilter(watched, event)
        if event.type() == QEvent.Type.ShortcutOverride and self._recorded_command:
            key_event = cast("QKeyEvent", event)
            if key_event.key() != Qt.Key.Key_F12:  # F12 triggers Stop even while a key is recorded
                event.accept()
                return True
        if event.type() == QEvent.Type.KeyPress:
            return self._handle_key(cast("QKeyEvent", event))
        return super().eventFilter(watched, event)

    def _handle_key(self, key_event: QKeyEvent) -> bool:
        key = key_event.key()
        if self._recorded_command:
            if key not in MODIFIER_KEYS:
                self._assign(key_event)
            return True
        if key in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.record()
            return True
        if key == Qt.Key.Key_Delete and not self.field.text():
            self._remove_shortcut()
            return True
        is_unmodified = not key_event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier
        return is_unmodified and self.rows.handle_key(key)

    def _assign(self, key_event: QKeyEvent) -> None:
        name, key = self._recorded_command, format_key(key_event.keyCombination())
        if key_event.key() == Qt.Key.Key_Escape:
            self._stop_recording()
            return
        reason = self._shortcuts.rejection_reason(name, key_event.keyCombination())
        if reason:
            self._set_status(reason)
            return
        text = self._shortcuts.commands[name].label
        owner = self._shortcuts.command_for(key)
        if owner and owner != name:
            other = self._shortcuts.commands[owner].label
            message = _(
                "{key} is already the shortcut of “{command}”. Swap the shortcuts, or press Enter to choose "
                "another one."
            )
            self._stop_recording(message.format(key=shortcut_text(key), command=other))
            self._pending_assignment = (name, key)
            paint.show_when(self.swap, True)
            return
        self._stop_recording(
            _("The shortcut of “{command}” is now {key}.").format(command=text, key=shortcut_text(key))
        )
        self._shortcuts.assign(name, key)

    def _swap(self) -> None:
        if self._pending_assignment is not None:
            name, key = self._pending_assignment
            text = self._shortcuts.commands[name].label
            self._stop_recording(
                _("The shortcut of “{command}” is now {key}.").format(command=text, key=shortcut_text(key))
            )
            self._shortcuts.swap(name, key)
            self.field.setFocus(Qt.FocusReason.OtherFocusReason)

    def _remove_shortcut(self) -> None:
        entry = self.rows.entry
        if entry is None or entry.kind != "command" or not self._shortcuts.shortcuts_of(entry.name):
            return
        if entry.name == STOP_COMMAND and len(self._shortcuts.shortcuts_of(STOP_COMMAND)) == 1:
            self._set_status(_("F12 can't be removed: it always triggers Stop."))
            return
        message = _("“{command}” no longer has a shortcut.").format(command=entry.text)
        self._stop_recording(
            _("F12 is now the only shortcut for Stop.") if entry.name == STOP_COMMAND else message
        )
        self._shortcuts.assign(entry.name, "")

    def _reset(self) -> None:
        entry = self.rows.entry
        if entry is not None and entry.kind == "command":
            self._stop_recording(_("Reset the shortcut of “{command}”.").format(command=entry.text))
            self._shortcuts.reset(entry.name)
            self.field.setFocus(Qt.FocusReason.OtherFocusReason)
