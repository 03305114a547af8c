"""Console: what happened, line by line, the newest first."""

from __future__ import annotations

import time
from collections.abc import Mapping
from itertools import islice
from typing import TYPE_CHECKING

from PySide6.QtCore import (
    QAbstractListModel,
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QRect,
    QRectF,
    QSize,
    Qt,
)
from PySide6.QtGui import QAction, QGuiApplication, QKeySequence, QPainter
from PySide6.QtWidgets import (
    QAbstractItemView,
    QListView,
    QStackedWidget,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QVBoxLayout,
)

from app.ui.icons import paint_icon
from app.ui.panels.base import Density, Panel, PanelContext, PanelWidget
from app.ui.theme import Theme
from app.ui.widgets import EmptyState, IconButton, paint
from app.ui.widgets.menus import Menu, drop_below

if TYPE_CHECKING:
    from app.core.console import LogRecord

Index = QModelIndex | QPersistentModelIndex
RECORD_ROLE = int(Qt.ItemDataRole.UserRole)
LEVELS = {
    "info": ("circle-check", "textTertiary"),
    "warn": ("triangle-alert", "warn"),
    "error": ("circle-x", "error"),
}
SHOWN = {"all": ("info", "warn", "error"), "warn": ("warn", "error"), "error": ("error",)}
WORDS = {"all": "Everything", "warn": "Warnings and errors", "error": "Errors only"}
ROW = {"compact": 22, "comfortable": 30}
_ROOT = QModelIndex()


def line_of(record: LogRecord) -> str:
    """A record as one line of text, for the clipboard."""
    clock = time.strftime("%H:%M:%S", time.localtime(record.stamp_s))
    return f"{clock} {record.level} {record.origin} {record.text}"


class ConsoleModel(QAbstractListModel):
    """The records of some levels, newest first; new ones are inserted above."""

    def __init__(self) -> None:
        super().__init__()
        self._records: list[LogRecord] = []  # oldest first: adding at the end is cheap

    def rowCount(self, parent: Index = _ROOT) -> int:
        return 0 if parent.isValid() else len(self._records)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid():
            return None
        record = self._records[-1 - index.row()]
        if role == RECORD_ROLE:
            return record
        if role in {Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole}:
            return line_of(record)
        return record.text if role == Qt.ItemDataRole.ToolTipRole else None

    def set_records(self, records: list[LogRecord]) -> None:
        """Show exactly these, oldest first; cheap when only new ones came."""
        known = len(self._records)
        grown = len(records) >= known and all(
            a is b for a, b in zip(islice(records, known), self._records, strict=False)
        )
        if not grown:
            self.beginResetModel()
            self._records = records
            self.endResetModel()
        elif len(records) > known:
            self.beginInsertRows(_ROOT, 0, len(records) - known - 1)
            self._records = records
            self.endInsertRows()


class LineDelegate(QStyledItemDelegate):
    """Paints one record: time, level with icon and word, origin, text."""

    def __init__(self, theme: Theme, panel: ConsolePanel) -> None:
        super().__init__(panel)
        self._theme, self._panel = theme, panel

    def sizeHint(self, _option: QStyleOptionViewItem, _index: Index) -> QSize:
        return QSize(100, round(self._theme.scaled(ROW[self._panel.density])))

    def paint(self, painter: QPainter, option: QStyleOptionViewItem, index: Index) -> None:
        record: LogRecord | None = index.data(RECORD_ROLE)
        if record is None:
            return
        theme = self._theme
        box = QRect(option.rect)
        if option.state & QStyle.StateFlag.State_Selected:
            painter.fillRect(box, theme.colour("selected"))
        rect = QRectF(box).adjusted(10, 0, -8, 0)
        font, small = self._panel.text_font(), theme.font("code")
        clock = time.strftime("%H:%M:%S", time.localtime(record.stamp_s))
        paint.words(painter, rect, clock, small, theme.colour("textTertiary"))
        rect.setLeft(rect.left() + paint.width_of(small, "00:00:00") + 14)
        icon, role = LEVELS.get(record.level, LEVELS["info"])
        paint_icon(painter, QRectF(rect.left(), rect.center().y() - 7, 14, 14), icon, theme.colour(role))
        rect.setLeft(rect.left() + 18)
        paint.words(painter, rect, record.level, font, theme.colour(role))
        rect.setLeft(rect.left() + max(38.0, paint.width_of(font, "error")) + 12)
        origin = QRectF(rect)
        origin.setWidth(min(paint.width_of(font, record.origin) + 1, rect.width() * 0.4))
        paint.words(painter, origin, record.origin, font, theme.colour("textTertiary"))
        rect.setLeft(origin.right() + 7)
        paint.words(painter, rect, record.text, font, theme.colour("text"))


class ConsolePanel(PanelWidget):
    """The lines, and which levels are shown."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, "Console")
        self._seen = (-1, "")
        self.level = "all"
        self.filter = IconButton(self.theme, "filter", "Choose what is shown", size=26)
        self.filter.clicked.connect(self._show_menu)
        self.header = [self.filter]
        self.model = ConsoleModel()
        self.list = QListView()
        self.list.setAccessibleName("What happened, newest first")
        self.list.setModel(self.model)
        self.list.setItemDelegate(LineDelegate(self.theme, self))
        self.list.setUniformItemSizes(True)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.list.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.list.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        copy = QAction("Copy", self.list)
        copy.setShortcut(QKeySequence(QKeySequence.StandardKey.Copy))
        copy.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)
        copy.triggered.connect(self.copy)
        self.list.addAction(copy)
        self.list.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.list.customContextMenuRequested.connect(self._show_actions)
        self.empty = EmptyState(
            self.theme, "terminal", "Nothing happened yet", "What programs and robots say appears here."
        )
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self.list)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 4, 0, 4)
        column.addWidget(self.pages)

    def refresh(self) -> None:
        now = (self.session.console.revision, self.level)
        if now == self._seen:
            return
        self._seen = now
        wanted = SHOWN[self.level]
        self.model.set_records([record for record in self.session.console.records if record.level in wanted])
        at_top = self.list.verticalScrollBar().value() == 0
        self.pages.setCurrentIndex(1 if self.model.rowCount() else 0)
        self._say_nothing()
        if at_top:
            self.list.scrollToTop()

    def _say_nothing(self) -> None:
        if self.level == "all":
            self.empty.say("Nothing happened yet", "What programs and robots say appears here.")
        else:
            self.empty.say("No problem was told", "Choose “Everything” to see all lines.")

    def set_level(self, level: str) -> None:
        """Show everything ("all"), from warnings on ("warn"), or errors ("error")."""
        if level in SHOWN:
            self.level = level
            self.filter.set_name(f"Shown: {WORDS[level]}")
            self.refresh()

    def _show_menu(self) -> None:
        menu = Menu(self.theme, self)
        for level, words in WORDS.items():
            action = menu.addAction(words)
            action.setCheckable(True)
            action.setChecked(level == self.level)
            action.triggered.connect(lambda _on=False, level=level: self.set_level(level))
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        drop_below(menu, self.filter)

    def _show_actions(self, at: QPoint) -> None:
        menu = Menu(self.theme, self)
        menu.addActions(self.list.actions())
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(self.list.viewport().mapToGlobal(at))

    def copy(self) -> None:
        """Put the chosen lines on the clipboard, oldest first."""
        chosen = sorted(self.list.selectedIndexes(), key=lambda index: -index.row())
        if chosen:
            QGuiApplication.clipboard().setText(
                "\n".join(line_of(index.data(RECORD_ROLE)) for index in chosen)
            )
            self.context.toast(f"Copied {len(chosen)} line{'' if len(chosen) == 1 else 's'}")

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        self.list.doItemsLayout()

    def save_state(self) -> dict[str, object]:
        return {"level": self.level}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self.set_level(str(state.get("level", "all")))


PANEL = Panel("console", "Console", "terminal", (), ConsolePanel)
