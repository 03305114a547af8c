"""Base class of panels with one table, a filter in the title bar and an empty state."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QStackedWidget, QVBoxLayout, QWidget

from app.ui.panels.base import Blocker, Density, PanelContext, PanelWidget, filter_blocker
from app.ui.panels.row_actions import RowAction, fill_menu
from app.ui.theme.theme import Theme
from app.ui.widgets import ElidedLabel, EmptyAction, EmptyState, Separator, label
from app.ui.widgets.buttons import LinkButton
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _

Row = TypeVar("Row")


@dataclass(frozen=True)
class TableTexts:
    """Texts of a table panel, each wrapped in `lazy`.

    Attributes:
        title: Title of the panel, such as "Topics".
        filter: Placeholder of the filter, such as "Filter topics".
        no_matches: Title of the empty state if no row matches the filter.
        clear_filter_hint: Text of the empty state if no row matches the filter.
        not_recorded: Title of the empty state while a recording is open; "" for the same empty state
            as for the live network.
    """

    title: str
    filter: str
    no_matches: str
    clear_filter_hint: str
    not_recorded: str = ""


class TablePanel(PanelWidget, Generic[Row]):
    """Panel with one table.

    Subclasses implement `make_model`, `make_table`, `rebuild`, `open_row` and `update_empty_state`.

    Attributes:
        pages: Stack of the table and the empty state; `show_table` selects the page.
        empty: Empty state, shown without rows.
        line: Separator between the table and `foot`.
        foot: Short text below the table.
    """

    def __init__(self, context: PanelContext, texts: TableTexts, icon: str) -> None:
        self._table_texts = texts
        super().__init__(context, _(texts.title))
        theme = self.theme
        self.model = self.make_model()
        self.table = self.make_table(self.model)
        self.filter = FilterField(theme, _(texts.filter))
        self.filter.exited.connect(lambda: self.table.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.filter.textChanged.connect(self.rebuild)
        self.header: list[QWidget] = [self.filter]
        self.table.setAccessibleName(self.title())
        self.table.opened.connect(self.open_row)
        self.table.menu_requested.connect(self._show_row_menu)
        self.table.filter_requested.connect(self.focus_filter)
        self.table.order_changed.connect(self.rebuild)
        self.foot = label("", "small", role="textTertiary", wrap=True)
        self.foot.setContentsMargins(12, 5, 12, 6)
        self.foot.setMinimumWidth(0)
        self.line = Separator(theme)
        self.empty = EmptyState(theme, icon, "", "")
        self.doctor = DoctorLine(theme, lambda: context.open_doctor(self, ""))
        self.pages = QStackedWidget()
        self.pages.addWidget(self.table)
        self.pages.addWidget(self.empty)
        self.setFocusProxy(self.table)
        self._columns = Menu(theme, self, _("Columns"))  # refilled whenever the "more" menu opens
        self._columns.setIcon(theme.icon("columns-2"))

    def make_model(self) -> TableModel[Row]:
        """Create the model of the rows; called once."""
        raise NotImplementedError

    def make_table(self, model: TableModel[Row]) -> TableView[Row]:
        """Create the table view; called once."""
        raise NotImplementedError

    def rebuild(self) -> None:
        """Show the rows that match the filter, in the table's sort order."""
        raise NotImplementedError

    def open_row(self, key: str) -> None:
        """Open the row with this key; called on a click or Enter."""
        raise NotImplementedError

    def row_actions(self, key: str) -> Sequence[RowAction]:
        """Return the actions for a row's context menu; empty for no menu."""
        return (RowAction(_("Show"), "eye", lambda: self.open_row(key)),)

    def menu_of(self, key: str) -> Menu | None:
        """Return the context menu of a row, or None if it has no actions."""
        actions = self.row_actions(key)
        return fill_menu(Menu(self.theme, self), self.theme, actions) if actions else None

    def _show_row_menu(self, key: str, position: QPoint) -> None:
        menu = self.menu_of(key)
        if menu is not None:
            menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            menu.popup(position)

    def filter_words(self) -> list[str]:
        """Return the words of the filter. A row matches if it contains all of them."""
        return self.filter.text().casefold().split()

    def show_table(self, has_rows: bool, is_filtered: bool) -> None:
        """Show the table or the empty state.

        Args:
            has_rows: True if the table has rows.
            is_filtered: True if the filter is not empty; the empty state then offers to clear it.
        """
        self.pages.setCurrentIndex(0 if has_rows else 1)
        self.doctor.setVisible(not has_rows and not is_filtered)
        if has_rows:
            return
        if is_filtered:
            texts = self._table_texts
            self.empty.set_texts(_(texts.no_matches), _(texts.clear_filter_hint), "search")
            clear = EmptyAction(_("Clear the filter"), self.filter.clear, "x")
            topic = self.missing_topic()
            self.empty.set_actions([clear, self.doctor_action(topic)] if topic else [clear])
        elif not self.world.is_live and self._table_texts.not_recorded:
            self.doctor.hide()
            self.empty.set_texts(_(self._table_texts.not_recorded), "", "film")
            self.empty.set_actions([])
        elif self.session.live.master.kind == "none":
            text = _("A master lets programs find each other.")
            self.empty.set_texts(_("No master is running"), text, "radio-tower")
            start = self.session.launcher.ensure_master
            self.empty.set_actions([EmptyAction(_("Start a master here"), start, "play", is_primary=True)])
        else:
            self.update_empty_state()

    def missing_topic(self) -> str:
        """Return the name of a topic that was typed into the filter but does not exist, or ""."""
        return ""

    def blockers(self) -> list[Blocker]:
        filter_text = self.filter.text().strip()
        return [filter_blocker(self.title(), filter_text, self.filter.clear)] if filter_text else []

    def update_empty_state(self) -> None:
        """Set the texts of the empty state for a table without rows while a master is running."""
        raise NotImplementedError

    def focus_filter(self) -> bool:
        self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.filter.selectAll()
        return True

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        self.table.set_row_height(self.row_height(), large=density == "comfortable")

    def theme_changed(self) -> None:
        self.table.set_row_height(self.row_height(), large=self.density == "comfortable")

    def more_actions(self) -> list[QAction]:
        self.table.fill_column_menu(self._columns)
        return [self._columns.menuAction()]

    def save_state(self) -> dict[str, object]:
        return self.table.saved_state()

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.table.restore(state)


class DoctorLine(QWidget):
    """Line with the question "Is something missing?" and a link to the connection doctor."""

    def __init__(self, theme: Theme, on_click: Callable[[], object]) -> None:
        super().__init__()
        text_label = ElidedLabel("small", "textSecondary")
        text_label.setText(_("Is something missing?"))
        self.button = LinkButton(theme, _("Open the connection doctor"))
        self.button.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        self.button.clicked.connect(on_click)
        row = QHBoxLayout()
        row.setContentsMargins(12, 3, 12, 3)
        row.setSpacing(6)
        row.addStretch(1)
        row.addWidget(text_label)
        row.addWidget(self.button)
        row.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(Separator(theme))
        column.addLayout(row)
