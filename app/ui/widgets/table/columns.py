"""Visibility of table columns: those that the user has selected, and as many others as fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from PySide6.QtWidgets import QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Column
from nep.i18n import _


class ColumnChoice:
    """Columns that the user has shown or hidden; all others have their default visibility."""

    def __init__(self, columns: Sequence[Column[Any]]) -> None:
        # The first column is always shown, because it identifies the row.
        self._columns = tuple(columns)
        self._visibility_by_column: dict[str, bool] = {}

    def should_show(self, column: Column[Any]) -> bool:
        """Return True if the column should be shown, provided that there is space."""
        if column.is_available is not None and not column.is_available():
            return False
        return (
            self._visibility_by_column.get(column.name, not column.is_hidden_by_default)
            or column is self._columns[0]
        )

    def show(self, name: str, is_visible: bool) -> None:
        """Show a column if `is_visible`, else hide it. Ignores the first column and unknown names."""
        for column in self._columns[1:]:
            if column.name == name:
                self._visibility_by_column.pop(name, None)
                if is_visible is column.is_hidden_by_default:
                    self._visibility_by_column[name] = is_visible

    def reset(self) -> None:
        """Restore the default visibility of all columns."""
        self._visibility_by_column.clear()

    @property
    def changed(self) -> bool:
        """True if the visibility of a column differs from its default."""
        return bool(self._visibility_by_column)

    def fitting_columns(self, widths: Sequence[int], room: int) -> set[int]:
        """Return the indexes of the columns to show in a given width.

        Columns with the hide order 0, and those that the user has shown, are included even if they
        don't fit.

        Args:
            widths: Widths of all columns in px.
            room: Available width in px.
        """
        visible_columns = {index for index, column in enumerate(self._columns) if self.should_show(column)}
        hideable = sorted(
            (self._columns[index].hide_order, index)
            for index in visible_columns
            if self._columns[index].hide_order
            and not self._visibility_by_column.get(self._columns[index].name)
        )
        while hideable and sum(widths[index] for index in visible_columns) > room:
            visible_columns.discard(hideable.pop()[1])
        return visible_columns

    def menu(self, theme: Theme, parent: QWidget, on_changed: Callable[[], object]) -> Menu:
        """Return a new menu to show and hide columns, see `fill`."""
        menu = Menu(theme, parent, _("Columns"))
        self.fill(menu, on_changed)
        return menu

    def fill(self, menu: Menu, on_changed: Callable[[], object]) -> None:
        """Replace the entries of a menu by entries to show and hide columns.

        There is a checkable entry for each available column except the first, and an entry that
        restores the default columns.

        Args:
            menu: Menu.
            on_changed: Called after a column was shown or hidden.
        """
        menu.clear()

        def set_column_visible(name: str, visible: bool) -> None:
            self.show(name, visible)
            on_changed()

        def restore_defaults() -> None:
            self.reset()
            on_changed()

        for column in self._columns[1:]:
            if column.is_available is not None and not column.is_available():
                continue
            action = menu.addAction(column.display_name)
            action.setCheckable(True)
            action.setChecked(self.should_show(column))
            action.toggled.connect(lambda on, name=column.name: set_column_visible(name, on))
        menu.addSeparator()
        reset_action = menu.addAction(_("Default columns"))
        reset_action.setEnabled(self.changed)
        reset_action.triggered.connect(lambda _on=False: restore_defaults())

    def saved_state(self) -> dict[str, bool]:
        """Return the visibility of the columns that the user has shown or hidden, for `restore`."""
        return dict(self._visibility_by_column)

    def restore(self, saved: object) -> None:
        """Restore the visibility of columns from a result of `saved_state`; invalid entries are ignored.

        If `saved` isn't a mapping, all columns have their default visibility.
        """
        self._visibility_by_column.clear()
        if isinstance(saved, Mapping):
            for name, visible in saved.items():
                if isinstance(name, str) and isinstance(visible, bool):
                    self.show(name, visible)
