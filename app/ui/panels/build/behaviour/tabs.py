"""Title bar of the behaviour panel: tabs, "+", undo, redo, and the Blocks/Python switch."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QPoint, QSize, Qt, Signal
from PySide6.QtGui import QContextMenuEvent, QResizeEvent, QWheelEvent
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QWidget

from app.intents import Intent
from app.ui.intents import CloseBehaviour, CloseOtherTabs, DuplicateTab, SaveTab, SaveTabAs, ShowTabFolder
from app.ui.panels.build.behaviour.tab import BehaviourTab, NameField, TabState
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, Segments
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _

MIN_TAB_WIDTH = 76
GAP = 4
NAME_FIELD_WIDTH = 180
SCROLL_MARGIN, SCROLL_STEP = 32, 8  # px
NEW_TAB = "+"
"""Key of the "+" button, used in place of a tab's key."""


class BehaviourTabs(QWidget):
    """Tab bar with a "+" button. Tabs shrink when space is short, then scroll with the wheel.

    While some tabs are scrolled out of view, a button opens a list of all tabs.
    """

    selected = Signal(str)
    close_requested = Signal(str)
    moved = Signal(str, int)
    intent_requested = Signal(object)  # intent of a tab's context menu
    renamed = Signal(str, str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._states: tuple[TabState, ...] = ()
        self._current = ""
        self._scroll_offset = 0.0
        self.name_problem: Callable[[str, str], str] = lambda _key, _name: ""
        """Returns the reason why the tab with this key can't have a name, or ""."""
        self.field: NameField | None = None
        self._edited_key = ""
        self.tabs: dict[str, BehaviourTab] = {}
        self._clip_area = QWidget(self)  # clips tabs that are scrolled out of view
        self.add = IconButton(theme, "plus", _("New behaviour"), "Ctrl+N", parent=self)
        self.add.setProperty("command", "file.new")
        self.list = IconButton(theme, "chevron-down", _("All open behaviours"), parent=self)
        self.list.clicked.connect(self._show_tab_list)
        self.list.hide()
        self.setAccessibleName(_("Open behaviours"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self._restyle)

    def show_tabs(self, states: Sequence[TabState], current: str) -> None:
        """Replace the tabs.

        Args:
            states: Data of the tabs, from left to right.
            current: Key of the active tab.
        """
        new_states = tuple(states)
        if (new_states, current) == (self._states, self._current):
            return
        had_focus = any(tab.hasFocus() for tab in self.tabs.values())
        for key in self.tabs.keys() - {each.key for each in new_states}:
            removed_tab = self.tabs.pop(key)
            if self.field is not None and key == self._edited_key:
                self._end_edit()
            removed_tab.hide()
            removed_tab.deleteLater()
        is_current_changed = current != self._current
        self._states, self._current = new_states, current
        changed = [self._make_tab(each).show_state(each, each.key == current) for each in new_states]
        if had_focus and is_current_changed and current in self.tabs:
            self.tabs[current].setFocus(Qt.FocusReason.OtherFocusReason)
        self._update_layout(reveals_current=is_current_changed)
        if any(changed):
            self.updateGeometry()

    def _make_tab(self, state: TabState) -> BehaviourTab:
        key = state.key
        if key not in self.tabs:
            tab = self.tabs[key] = BehaviourTab(self._theme, self._clip_area)
            tab.selected.connect(lambda: self.selected.emit(key))
            tab.close_pressed.connect(lambda: self.close_requested.emit(key))
            tab.dragged.connect(lambda x: self._drag(key, x))
            tab.step_requested.connect(self._step)
            tab.rename_requested.connect(lambda: self.edit(key))
            tab.show()
        return self.tabs[key]

    def _show_tab_list(self) -> None:
        menu = Menu(self._theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        for state in self._states:
            entry = menu.addAction(plain.escape_menu_text(state.name))
            entry.setCheckable(True)
            entry.setChecked(state.key == self._current)
            entry.triggered.connect(lambda _on=False, key=state.key: self.selected.emit(key))
        open_below(menu, self.list)

    # -- drops of blocks ----------------------------------------------------------------------------------

    def target_at(self, position: QPoint) -> str:
        """Return the drop target at a screen position: the key of a tab, `NEW_TAB` for "+", or ""."""
        if not self.isVisible():
            return ""
        local_position = self.mapFromGlobal(position)
        if self.add.isVisible() and self.add.geometry().contains(local_position):
            return NEW_TAB
        if not self._clip_area.geometry().contains(local_position):
            return ""
        return next((key for key, tab in self.tabs.items() if tab.geometry().contains(local_position)), "")

    def scroll_at(self, position: QPoint) -> bool:
        """Scroll the tabs if a position is near an end of the bar. Return True if the tabs moved.

        Args:
            position: Screen position of the drag.
        """
        local_position, room = self.mapFromGlobal(position), self._clip_area.geometry()
        if not self.isVisible() or not room.contains(local_position):
            return False
        margin = min(round(self._theme.scaled(SCROLL_MARGIN)), room.width() // 3)
        before = self._scroll_offset
        if local_position.x() < room.left() + margin:
            self._scroll_offset -= SCROLL_STEP
        elif local_position.x() > room.right() - margin:
            self._scroll_offset += SCROLL_STEP
        self._update_layout()
        return self._scroll_offset != before

    def highlight_target(self, key: str) -> None:
        """Highlight a drop target: the key of a tab, `NEW_TAB` for "+", or "" for none."""
        for tab_key, tab in self.tabs.items():
            tab.set_drop_target(tab_key == key)
        self.add.set_drop_target(key == NEW_TAB)

    # -- renaming -----------------------------------------------------------------------------------------

    def edit(self, key: str) -> None:
        """Start in-place editing of a tab's name."""
        if key not in self.tabs:
            return
        self._end_edit()
        state = self.tabs[key].state
        name = state.plain_name or state.name
        self._edited_key = key
        self.field = NameField(self._theme, name, lambda name: self.name_problem(key, name), self._clip_area)
        self.field.committed.connect(lambda name: self.renamed.emit(key, name))
        self.field.exited.connect(self._end_edit)
        self._update_layout(reveals_current=key == self._current)
        self.field.show()
        self.field.raise_()
        self.field.setFocus(Qt.FocusReason.OtherFocusReason)

    def _end_edit(self) -> None:
        field, self.field = self.field, None
        if field is None:
            return
        had_focus = field.hasFocus()
        field.hide()
        field.deleteLater()
        self.add.show()
        if had_focus and self._edited_key in self.tabs:
            self.tabs[self._edited_key].setFocus(Qt.FocusReason.OtherFocusReason)

    def _position_field(self) -> None:
        self.add.setVisible(self.field is None)  # the field may cover it
        if self.field is None or self._edited_key not in self.tabs:
            return
        tab = self.tabs[self._edited_key].geometry()
        width = min(max(tab.width(), round(self._theme.scaled(NAME_FIELD_WIDTH))), self._clip_area.width())
        height = max(tab.height(), self.field.sizeHint().height())
        left = max(0, min(tab.left(), self._clip_area.width() - width))
        self.field.setGeometry(left, max(0, (self.height() - height) // 2), width, height)

    def _step(self, step: int) -> None:
        keys = [each.key for each in self._states]
        self.selected.emit(keys[(keys.index(self._current) + step) % len(keys)])

    def _drag(self, key: str, x: int) -> None:
        keys = [each.key for each in self._states]
        index = keys.index(key)
        for step in (-1, 1):
            other = index + step
            if 0 <= other < len(keys):
                middle = self.tabs[keys[other]].geometry().center().x()
                if (x < middle) if step < 0 else (x > middle):
                    self.moved.emit(key, other)
                    return

    # -- layout -------------------------------------------------------------------------------------------

    def _restyle(self) -> None:
        self.updateGeometry()
        self._update_layout(reveals_current=True)

    def _widths(self) -> list[int]:
        # The active tab keeps its full width up to the available room; the others shrink down to
        # MIN_TAB_WIDTH.
        full_widths = [self.tabs[each.key].sizeHint().width() for each in self._states]
        room = self._available_width(is_scrollable=False) - GAP * len(full_widths)
        min_width = round(self._theme.scaled(MIN_TAB_WIDTH))
        keys = [each.key for each in self._states]
        max_current_width = max(min_width, self._available_width(is_scrollable=len(keys) > 1))

        def limit_widths(limit: int) -> list[int]:
            pairs = zip(keys, full_widths, strict=True)
            return [min(width, max_current_width if key == self._current else limit) for key, width in pairs]

        max_width = max(full_widths, default=min_width)
        while max_width > min_width and sum(limit_widths(max_width)) > room:
            max_width -= 4
        return limit_widths(max(max_width, min_width))

    def _available_width(self, *, is_scrollable: bool) -> int:
        reserved = self.add.sizeHint().width() + GAP
        return self.width() - reserved - (self.list.sizeHint().width() + GAP if is_scrollable else 0)

    def _update_layout(self, *, reveals_current: bool = False) -> None:
        widths = self._widths()
        total = sum(widths) + GAP * max(0, len(widths) - 1)
        is_scrollable = total > self._available_width(is_scrollable=False)
        room = self._available_width(is_scrollable=is_scrollable)
        if reveals_current:
            self._scroll_offset = self._offset_for_current(widths, room)
        self._scroll_offset = max(0.0, min(self._scroll_offset, float(total - room)))
        self._clip_area.setGeometry(0, 0, max(0, room), self.height())
        x = -self._scroll_offset
        for state, width in zip(self._states, widths, strict=True):
            tab = self.tabs[state.key]
            height = tab.sizeHint().height()
            tab.setGeometry(round(x), (self.height() - height) // 2, width, height)
            x += width + GAP
        side = self.add.sizeHint().height()
        self.add.setGeometry(min(round(x), room + GAP), (self.height() - side) // 2, side, side)
        self.add.raise_()
        self.list.setVisible(is_scrollable)
        self.list.setGeometry(self.width() - side, (self.height() - side) // 2, side, side)
        self.list.raise_()
        self._position_field()

    def _offset_for_current(self, widths: list[int], room: int) -> float:
        x = 0.0
        for state, width in zip(self._states, widths, strict=True):
            if state.key == self._current:
                return min(max(self._scroll_offset, x + width - room), x)
            x += width + GAP
        return self._scroll_offset

    def sizeHint(self) -> QSize:
        tabs = [self.tabs[each.key].sizeHint() for each in self._states]
        height = max([28, *(size.height() for size in tabs)])
        return QSize(sum(size.width() + GAP for size in tabs) + self.add.sizeHint().width(), height)

    def minimumSizeHint(self) -> QSize:
        width = round(self._theme.scaled(MIN_TAB_WIDTH)) + GAP + self.add.sizeHint().width()
        if len(self._states) > 1:
            width += GAP + self.list.sizeHint().width()
        return QSize(width, self.sizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._update_layout(reveals_current=True)

    def wheelEvent(self, event: QWheelEvent) -> None:
        delta = event.angleDelta().y() or event.angleDelta().x()
        self._scroll_offset -= delta / 2
        self._update_layout()
        event.accept()

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        tab_key = next((key for key, tab in self.tabs.items() if tab.geometry().contains(event.pos())), None)
        if tab_key is None:
            return
        self.menu_of(tab_key).popup(event.globalPos())
        event.accept()

    def menu_of(self, key: str) -> Menu:
        """Return the context menu of a tab."""
        menu = Menu(self._theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        rename = menu.addAction(self._theme.icon("pencil"), f"{_('Rename')}\tF2")
        rename.triggered.connect(lambda: self.edit(key))
        entries: tuple[tuple[str, str, Callable[[str], Intent] | None], ...] = (
            (_("Duplicate"), "copy", DuplicateTab),
            (_("Save"), "save", SaveTab),
            (_("Save as"), "", SaveTabAs),
            (_("Show in folder"), "folder-open", ShowTabFolder),
            ("", "", None),
            (_("Close"), "x", CloseBehaviour),
            (_("Close other behaviours"), "", CloseOtherTabs),
        )
        for text, icon, make in entries:
            if make is None:
                menu.addSeparator()
                continue
            action = menu.addAction(text)
            if icon:
                action.setIcon(self._theme.icon(icon))
            action.triggered.connect(lambda _on=False, make=make: self.intent_requested.emit(make(key)))
            if make is ShowTabFolder:
                action.setEnabled(self.tabs[key].state.has_file)
            if make is CloseOtherTabs:
                action.setEnabled(len(self.tabs) > 1)
        return menu


class BehaviourTitle(QWidget):
    """Widget that replaces the panel's title: tabs and buttons."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.tabs = BehaviourTabs(theme)
        self.undo = IconButton(theme, "rotate-ccw", _("Undo"), "Ctrl+Z", size=32)
        self.redo = IconButton(theme, "rotate-cw", _("Redo"), "Ctrl+Shift+Z", size=32)
        self.undo.setProperty("command", "edit.undo")
        self.redo.setProperty("command", "edit.redo")
        self.copy = Button(theme, _("Copy"), "copy", size="small")
        self.copy.setAccessibleName(_("Copy the program"))
        self.copy.hide()
        modes = [("blocks", _("Blocks"), None), ("python", _("Python"), None)]
        self.mode = Segments(theme, modes, name=_("Show as"))
        for button in (self.undo, self.redo):
            button.setEnabled(False)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(4)
        row.addWidget(self.tabs, 1)
        for widget in (self.undo, self.redo, self.copy):
            row.addWidget(widget)
        row.addSpacing(8)
        row.addWidget(self.mode)

    def show_mode(self, mode: str) -> None:
        """Show the buttons of a mode: undo and redo for blocks, copy for the program."""
        self.mode.set_value(mode)
        self.undo.setVisible(mode == "blocks")
        self.redo.setVisible(mode == "blocks")
        self.copy.setVisible(mode == "python")
