"""Which columns of a table are shown: a person's choice first, then what fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from PySide6.QtWidgets import QWidget

from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Column
from nep.i18n import _


class ColumnChoice:
    """What a person chose to see of the columns; what was not chosen is as it is at first."""

    def __init__(self, columns: Sequence[Column[Any]]) -> None:
        """The first column is always shown: it names the row."""
        self._columns = tuple(columns)
        self._chosen: dict[str, bool] = {}

    def wanted(self, column: Column[Any]) -> bool:
        """Whether the column is to be shown where there is room."""
        if column.when is not None and not column.when():
            return False
        return self._chosen.get(column.name, not column.off) or column is self._columns[0]

    def show(self, name: str, shown: bool) -> None:
        """Show a column, or not."""
        for column in self._columns[1:]:
            if column.name == name:
                self._chosen.pop(name, None)
                if shown is column.off:
                    self._chosen[name] = shown

    def reset(self) -> None:
        """Show the columns that are shown at first."""
        self._chosen.clear()

    @property
    def changed(self) -> bool:
        """Whether a person chose other columns than those at first."""
        return bool(self._chosen)

    def fit(self, widths: Sequence[int], room: int) -> set[int]:
        """The places of the columns to show in ``room`` pixels: those that yield go first.

        What a person asked for by name stays, also where it does not fit.
        """
        shown = {place for place, column in enumerate(self._columns) if self.wanted(column)}
        yielding = sorted(
            (self._columns[place].yields, place)
            for place in shown
            if self._columns[place].yields and not self._chosen.get(self._columns[place].name)
        )
        while yielding and sum(widths[place] for place in shown) > room:
            shown.discard(yielding.pop()[1])
        return shown

    def menu(self, theme: Theme, parent: QWidget, changed: Callable[[], object]) -> Menu:
        """A new menu as `fill` fills it."""
        menu = Menu(theme, parent, _("Columns"))
        self.fill(menu, changed)
        return menu

    def fill(self, menu: Menu, changed: Callable[[], object]) -> None:
        """Every column but the first, checked when shown, in place of what was in the menu.

        ``changed`` is called after each choice.
        """
        menu.clear()

        def choose(name: str, shown: bool) -> None:
            self.show(name, shown)
            changed()

        def begin_anew() -> None:
            self.reset()
            changed()

        for column in self._columns[1:]:
            if column.when is not None and not column.when():
                continue
            action = menu.addAction(column.called)
            action.setCheckable(True)
            action.setChecked(self.wanted(column))
            action.toggled.connect(lambda on, name=column.name: choose(name, on))
        menu.addSeparator()
        again = menu.addAction(_("Default columns"))
        again.setEnabled(self.changed)
        again.triggered.connect(lambda _on=False: begin_anew())

    def saved(self) -> dict[str, bool]:
        """The choices, for a layout."""
        return dict(self._chosen)

    def restore(self, saved: object) -> None:
        """Take over what `saved` gave; whatever does not fit is left out."""
        self._chosen.clear()
        if isinstance(saved, Mapping):
            for name, shown in saved.items():
                if isinstance(name, str) and isinstance(shown, bool):
                    self.show(name, shown)
