"""Command palette (Ctrl+K) to search commands, panels, topics, robots, layouts, files and examples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

from PySide6.QtCore import QEvent, QObject, QRectF, QSize, Qt
from PySide6.QtGui import QKeyEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QVBoxLayout, QWidget

from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text.numbers import shortcut_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import label, paint
from app.ui.widgets.lists.entry_list import EntryList, Heading, Line
from app.ui.widgets.lists.fuzzy import Entry, Finder, Match
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _, lazy, ngettext

WIDTH, TOP, FIELD_HEIGHT, FOOTER_HEIGHT = 640, 128, 56, 36
MAX_VISIBLE_ROWS = 9.5
MAX_RESULTS, MAX_RESULTS_WITHOUT_QUERY, MAX_LAST_USED_SHOWN, MAX_LAST_USED_SAVED = 40, 8, 5, 12


class _Field(QLineEdit):
    """Frameless search field with an icon on the left and the key cap "Esc" on the right."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        name = _("Find a command, panel, topic, robot or file")
        self.setPlaceholderText(name)
        self.setAccessibleName(name)
        self.setProperty("bare", "true")
        self.setProperty("ownFocus", True)
        self.setFrame(False)
        FieldContextMenu(theme, self)
        self.restyle()

    def restyle(self) -> None:
        font = self._theme.font("heading")
        font.setWeight(font.Weight.Normal)
        font.setPixelSize(round(self._theme.scaled(17)))
        self.setFont(font)
        self.setFixedHeight(round(self._theme.scaled(FIELD_HEIGHT)))
        right = round(paint.key_width(self._theme, shortcut_text("Esc"))) + 26
        self.setTextMargins(round(self._theme.scaled(20)) + 28, 0, right, 0)

    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        painter = QPainter(self)
        middle, side = self.height() / 2, self._theme.scaled(20)
        icon_area = QRectF(18, middle - side / 2, side, side)
        paint_icon(painter, icon_area, "search", self._theme.colour("textSecondary"))
        paint.key_cap(painter, self._theme, self.width() - 19, middle, shortcut_text("Esc"))
        paint.hairline(painter, QRectF(self.rect()), Qt.Edge.BottomEdge, self._theme.colour("border"))
        painter.end()


class _Footer(QWidget):
    """Footer with hints about keys and the number of matches."""

    KEY_HINTS = (
        (("↑", "↓"), lazy("choose")),
        (("Enter",), lazy("run")),
        (("Ctrl+Enter",), lazy("change shortcut")),
    )

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.result_text = ""
        self.setFixedHeight(round(theme.scaled(FOOTER_HEIGHT)))

    def sizeHint(self) -> QSize:
        return QSize(100, round(self._theme.scaled(FOOTER_HEIGHT)))

    def paintEvent(self, _event: QPaintEvent) -> None:
        theme, painter = self._theme, QPainter(self)
        font, quiet = theme.font("body"), theme.colour("textSecondary")
        middle, x = self.height() / 2, 18.0
        paint.hairline(painter, QRectF(self.rect()), Qt.Edge.TopEdge, theme.colour("border"))
        result_width = paint.width_of(font, self.result_text)
        for keys, hint in self.KEY_HINTS:
            text = _(hint)
            caps = [shortcut_text(key) for key in keys]
            width = sum(paint.key_width(theme, cap) + 5 for cap in caps) + paint.width_of(font, text)
            if x + width > self.width() - result_width - 40:
                break
            for cap in caps:
                x = paint.key_cap(painter, theme, x + paint.key_width(theme, cap), middle, cap).right()
                x += 5
            area = QRectF(x + 1, 0, 400, self.height())
            paint.text_line(painter, area, text, font, quiet)
            x += paint.width_of(font, text) + 17
        area = QRectF(0, 0, self.width() - 19, self.height())
        paint.text_line(painter, area, self.result_text, font, quiet, paint.RIGHT)
        painter.end()


class CommandPalette(Overlay):
    """Command palette, 640 px wide and 128 px below the top of the window.

    Args:
        theme: Theme.
        window: Window that the palette covers.
        get_entries: Returns the entries; called whenever the palette opens.
        run: Runs an entry.
        rebind: Asks for a new shortcut for a command, given by its name.
    """

    top = TOP

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        get_entries: Callable[[], Sequence[Entry]],
        run: Callable[[Entry], object],
        rebind: Callable[[str], object],
    ) -> None:
        super().__init__(theme, window, _("Command palette"))
        self._get_entries, self._run, self._rebind = get_entries, run, rebind
        self._finder = Finder(())
        self.last_used_ids: list[str] = []
        self.on_last_used_changed: Callable[[Sequence[str]], object] = lambda _ids: None
        self.field = _Field(theme)
        self.rows = EntryList(theme, _("Matches"))
        self.no_result_label = label("", "bodyLarge", role="textSecondary", wrap=True)
        self.no_result_label.setContentsMargins(20, 14, 20, 16)
        self.foot = _Footer(theme)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 1, 1, 1)
        column.setSpacing(0)
        column.addWidget(self.field)
        column.addWidget(self.no_result_label)
        inner = QHBoxLayout()
        inner.setContentsMargins(0, 2, 0, 6)
        inner.addWidget(self.rows)
        column.addLayout(inner, 1)
        column.addWidget(self.foot)
        self.field.installEventFilter(self)
        self.field.textChanged.connect(self._search)
        self.rows.selection_moved.connect(self._announce_selection)
        self.rows.row_activated.connect(self.run_selected)
        theme.changed.connect(self._restyle)

    def initial_focus(self) -> QWidget:
        return self.field

    def open(self) -> None:
        """Open the palette with all entries, recently used ones first; if it is open, close it."""
        if self.isVisible():
            self.dismiss()
            return
        self._finder = Finder(self._get_entries())
        self.field.blockSignals(True)
        self.field.clear()
        self.field.blockSignals(False)
        self._search()
        super().open()

    def preferred_size(self, room: QSize) -> QSize:
        scaled = self.theme.scaled
        rows = min(self.rows.content_height(), round(scaled(40) * MAX_VISIBLE_ROWS)) + 8
        content_height = rows if self.rows.line_model.lines else self.no_result_label.sizeHint().height()
        height = self.field.height() + content_height + self.foot.height() + 2
        return QSize(min(room.width(), round(scaled(WIDTH))), min(room.height(), height))

    def _restyle(self) -> None:
        self.field.restyle()
        self.foot.setFixedHeight(round(self.theme.scaled(FOOTER_HEIGHT)))
        self.place()

    def _search(self) -> None:
        query = self.field.text().strip()
        lines = self._default_lines() if not query else []
        if query:
            matches, count = self._finder.find(query, MAX_RESULTS)
            self.foot.result_text = _("{shown} of {count}").format(
                shown=count, count=len(self._finder.entries)
            )
            for match in matches:
                heading = Heading(_(GROUP_TITLES[match.entry.kind]))
                if heading not in lines:
                    lines.append(heading)
                lines.append(match)
        self.no_result_label.setText(_("No results for “{words}”.").format(words=query))
        paint.show_when(self.no_result_label, not lines)
        paint.show_when(self.rows, bool(lines))
        self.rows.show_lines(lines)
        self.foot.update()
        self.place()

    def _default_lines(self) -> list[Line]:
        # The last used entries, then the first ones of each kind.
        entries = self._finder.entries
        entries_by_id = {entry.id: entry for entry in entries if entry.id in self.last_used_ids}
        last_used = [entries_by_id[id] for id in self.last_used_ids if id in entries_by_id]
        last_used = last_used[:MAX_LAST_USED_SHOWN]
        lines: list[Line] = [Heading(_(GROUP_TITLES["recent"])), *map(Match, last_used)] if last_used else []
        matches_by_kind: dict[str, list[Match]] = {}
        for entry in entries:
            matches = matches_by_kind.setdefault(entry.kind, [])
            if entry not in last_used and (
                entry.kind == "command" or len(matches) < MAX_RESULTS_WITHOUT_QUERY
            ):
                matches.append(Match(entry))
        for kind, matches in matches_by_kind.items():
            if matches:
                lines += [Heading(_(GROUP_TITLES[kind])), *matches]
        self.foot.result_text = ngettext("{count} result", "{count} results", len(entries)).format(
            count=len(entries)
        )
        return lines

    def _announce_selection(self) -> None:
        # The focus stays in the field; therefore the selected row is announced to screen readers.
        entry = self.rows.entry
        if entry is not None and self.isVisible():
            paint.announce(self.field, str(self.rows.currentIndex().data(Qt.ItemDataRole.AccessibleTextRole)))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self.field and event.type() == QEvent.Type.KeyPress:
            key_event = cast("QKeyEvent", event)
            is_unmodified = not key_event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier
            if is_unmodified and self.rows.handle_key(key_event.key()):
                return True
            if key_event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
                if key_event.modifiers() & Qt.KeyboardModifier.ControlModifier:
                    self.rebind()
                else:
                    self.run_selected()
                return True
        return super().eventFilter(watched, event)

    def run_selected(self) -> None:
        """Run the selected entry, unless it is unavailable."""
        entry = self.rows.entry
        if entry is None:
            return
        if entry.reason:
            paint.announce(self.field, entry.reason)
            return
        used_ids = [entry.id, *(id for id in self.last_used_ids if id != entry.id)]
        self.last_used_ids = used_ids[:MAX_LAST_USED_SAVED]
        self.on_last_used_changed(self.last_used_ids)
        self.dismiss()
        self._run(entry)

    def rebind(self) -> None:
        """Close the palette and ask for a new shortcut, if the selected entry is a command."""
        entry = self.rows.entry
        if entry is not None and entry.kind == "command":
            self.dismiss()
            self._rebind(entry.name)


GROUP_TITLES = {
    "recent": lazy("Recently used"),
    "command": lazy("Commands"),
    "panel": lazy("Panels"),
    "another": lazy("Another panel"),
    "topic": lazy("Topics"),
    "robot": lazy("Robots"),
    "layout": lazy("Layouts"),
    "file": lazy("Recent files"),
    "example": lazy("Examples"),
}
