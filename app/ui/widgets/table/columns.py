"""Visible columns of a table: those that the user chose, then those that fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from PySide6.QtWidgets import QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Column
from nep.i18n import _


class ColumnChoice:
    """User's choice of columns; others have their default visibility."""

    def __init__(self, columns: Sequence[Column[Any]]) -> None:
        # The first column is always shown, because it identifies the row.
        self._columns = tuple(columns)
        self._chosen: dict[str, bool] = {}

    def should_show(self, column: Column[Any]) -> bool:
        """Return True if the column should be shown, provided that there is space."""
        if column.is_available is not None and not column.is_available():
            return False
        return self._chosen.get(column.name, not column.is_hidden_by_default) or column is self._columns[0]

    def show(self, name: str, shown: bool) -> None:
        """Show or hide a column."""
        for column in self._columns[1:]:
            if column.name == name:
                self._chosen.pop(name, None)
                if shown is column.is_hidden_by_default:
                    self._chosen[name] = shown

    def reset(self) -> None:
        """Restore the default visibility of all columns."""
        self._chosen.clear()

    @property
    def changed(self) -> bool:
        """True if the choice differs from the default."""
        return bool(self._chosen)

    def fitting_columns(self, widths: Sequence[int], room: int) -> set[int]:
        """Return the indexes of the columns that fit into ``room`` px. Columns that yield are hidden first.

        Columns that the user chose are included even if they do not fit.
        """
        shown = {place for place, column in enumerate(self._columns) if self.should_show(column)}
        yielding = sorted(
            (self._columns[place].hide_order, place)
            for place in shown
            if self._columns[place].hide_order and not self._chosen.get(self._columns[place].name)
        )
        while yielding and sum(widths[place] for place in shown) > room:
            shown.discard(yielding.pop()[1])
        return shown

    def menu(self, theme: Theme, parent: QWidget, changed: Callable[[], object]) -> Menu:
        """Return a new menu with the entries of `fill`."""
        menu = Menu(theme, parent, _("Columns"))
        self.fill(menu, changed)
        return menu

    def fill(self, menu: Menu, changed: Callable[[], object]) -> None:
        """Fill a menu with an entry for each column but the first; visible columns are checked.

        ``changed`` is called after each choice.
        """
        menu.clear()

        def set_shown(name: str, shown: bool) -> None:
            self.show(name, shown)
            changed()

        def restore_defaults() -> None:
            self.reset()
            changed()

        for column in self._columns[1:]:
            if column.is_available is not None and not column.is_available():
                continue
            action = menu.addAction(column.display_name)
            action.setCheckable(True)
            action.setChecked(self.should_show(column))
            action.toggled.connect(lambda on, name=column.name: set_shown(name, on))
        menu.addSeparator()
        again = menu.addAction(_("Default columns"))
        again.setEnabled(self.changed)
        again.triggered.connect(lambda _on=False: restore_defaults())

    def saved_state(self) -> dict[str, bool]:
        """Return the choices as JSON values for a layout."""
        return dict(self._chosen)

    def restore(self, saved: object) -> None:
        """Restore choices returned by `saved`; invalid values are ignored."""
        self._chosen.clear()
        if isinstance(saved, Mapping):
            for name, shown in saved.items():
                if isinstance(name, str) and isinstance(shown, bool):
                    self.show(name, shown)
