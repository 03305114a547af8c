from __future__ import annotations

from dataclasses import dataclass, replace

import pytest
from PySide6.QtCore import QEvent, QModelIndex, QObject, QPoint, QRectF, Qt
from PySide6.QtGui import QImage, QPainter, QPaintEvent, QRegion
from PySide6.QtTest import QSignalSpy, QTest
from PySide6.QtWidgets import QTableView

from app.ui.theme.theme import Theme
from app.ui.widgets.table.columns import ColumnChoice
from app.ui.widgets.table.model import CELL_ROLE, Cell, Column, Order, TableModel
from app.ui.widgets.table.view import TableView


@dataclass
class Row:
    name: str
    rate: float | None = None


COLUMNS = (
    Column("name", "Name", 100, lambda row: Cell(row.name, mono=True), lambda row: row.name, stretch=True),
    Column("rate", "Rate", 60, lambda row: Cell("" if row.rate is None else f"{row.rate:.1f}"),
           lambda row: row.rate, is_numeric=True, tip=lambda row: f"{row.rate} a second"),
)  # fmt: skip


@pytest.fixture
def model() -> TableModel[Row]:
    made: TableModel[Row] = TableModel(COLUMNS, lambda row: row.name)
    made.set_rows([Row("b", 2.0), Row("a", 1.0), Row("c")])
    return made


def names(model: TableModel[Row]) -> list[str]:
    return [model.data(model.index(row, 0)) for row in range(model.rowCount())]  # type: ignore[misc]


def test_model_obeys_qt_rules_while_rows_are_added_removed_and_moved(qtmodeltester, model) -> None:
    qtmodeltester.check(model)
    for wanted in (["c", "a", "d", "b"], ["a"], [], ["x", "y", "z"], ["z", "y", "x"], ["y", "q"]):
        model.set_rows([Row(name) for name in wanted])
        assert names(model) == wanted
        qtmodeltester.check(model)


def test_removing_many_rows_emits_a_single_model_reset(qtbot, model) -> None:
    model.set_rows([Row(f"{number:05}") for number in range(2000)])
    removed = QSignalSpy(model.rowsRemoved)
    with qtbot.waitSignal(model.modelReset):
        model.set_rows([Row(f"{number:05}") for number in range(0, 2000, 2)])
    assert removed.count() == 0
    assert model.rowCount() == 1000


def test_cell_provides_data_for_delegate_tooltip_and_screen_reader(model) -> None:
    rate = model.index(0, 1)
    assert model.data(rate) == "2.0"
    assert model.data(rate, CELL_ROLE) == Cell("2.0")
    assert model.data(rate, Qt.ItemDataRole.ToolTipRole) == "2.0 a second"
    assert model.data(rate, Qt.ItemDataRole.AccessibleTextRole) == "Rate, 2.0"
    assert model.data(QModelIndex()) is None
    assert int(model.data(rate, Qt.ItemDataRole.TextAlignmentRole)) & int(Qt.AlignmentFlag.AlignRight)


def test_unknown_values_are_sorted_last_in_both_directions() -> None:
    rows = [Row("none"), Row("two", 2.0), Row("one", 1.0)]
    rising, falling = Order(COLUMNS[1]), Order(COLUMNS[1], is_descending=True)
    assert [row.name for row in rising.sort(rows)] == ["one", "two", "none"]
    assert [row.name for row in falling.sort(rows)] == ["two", "one", "none"]
    assert [row.name for row in Order().sort(rows)] == ["none", "two", "one"]


@pytest.fixture
def view(qtbot, model) -> TableView[Row]:
    made: TableView[Row] = TableView(Theme("light"), model)
    qtbot.addWidget(made)
    made.resize(300, 200)
    made.show()
    return made


def test_selected_row_is_kept_when_rows_are_added_and_the_order_changes(view, model) -> None:
    view.select_key("a")
    model.set_rows([Row("0"), Row("b"), Row("a"), Row("c")])
    assert view.selected_key() == "a"
    model.set_rows([Row("c"), Row("b"), Row("a")])
    assert view.selected_key() == "a"


def test_click_and_return_open_a_row_and_slash_emits_filter_requested(qtbot, view) -> None:
    opened: list[str] = []
    view.opened.connect(opened.append)
    QTest.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(40, 26 + 13))
    QTest.keyClick(view, Qt.Key.Key_Down)
    QTest.keyClick(view, Qt.Key.Key_Return)
    assert opened == ["a", "c"]
    with qtbot.waitSignal(view.filter_requested):
        QTest.keyClicks(view, "/")


def test_click_on_a_header_sorts_and_a_second_click_reverses_the_order(qtbot, view) -> None:
    with qtbot.waitSignal(view.order_changed):
        view.horizontalHeader().sectionClicked.emit(1)
    assert (view.order.column, view.order.is_descending) == (COLUMNS[1], True)  # numbers: descending first
    view.horizontalHeader().sectionClicked.emit(1)
    assert view.order.is_descending is False


def test_visible_rows_are_updated_with_a_single_signal(qapp, view, model) -> None:
    model.set_rows([Row(f"{number:05}", 1.0) for number in range(10_000)])
    qapp.processEvents()  # the view lays out its rows
    told = QSignalSpy(model.dataChanged)
    view.scrollTo(model.index(5000, 0))
    view.refresh_visible()
    assert told.count() == 1
    first, last = told.at(0)[0], told.at(0)[1]
    assert 4990 <= first.row() <= last.row() <= 5020


class Brush(QObject):
    """Event filter that records the repainted region of a view."""

    def __init__(self, view: TableView[Row]) -> None:
        super().__init__()
        self.painted = QRegion()
        view.viewport().installEventFilter(self)

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if isinstance(event, QPaintEvent):
            self.painted += event.region()
        return False


@pytest.fixture
def brush(qapp, view) -> Brush:
    qapp.processEvents()
    made = Brush(view)
    view.viewport().repaint()
    assert made.painted.boundingRect() == view.viewport().rect()
    made.painted = QRegion()
    return made


def test_only_changed_cells_are_repainted(qapp, view, model, brush) -> None:
    view.refresh_visible()
    qapp.processEvents()
    assert brush.painted.isEmpty()
    model.row_at(model.index(1, 0)).rate = 7.5
    view.refresh_visible()
    qapp.processEvents()
    assert brush.painted == QRegion(view.visualRect(model.index(1, 1)))


def test_cell_that_changed_during_another_repaint_is_repainted(qapp, view, model, brush) -> None:
    row = model.row_at(model.index(0, 0))
    row.rate = 7.5
    view.viewport().repaint()
    row.rate = 2.0  # the value of the last refresh
    brush.painted = QRegion()
    view.refresh_visible()
    qapp.processEvents()
    assert brush.painted == QRegion(view.visualRect(model.index(0, 1)))


def test_cache_of_painted_cells_is_bounded(qapp, view, model, monkeypatch) -> None:
    limit = 400
    monkeypatch.setattr("app.ui.widgets.table.cells.MAX_CACHED_CELLS", limit)
    model.set_rows([Row(f"{number:05}", 1.0) for number in range(limit)])
    for first in range(0, limit, 5):
        view.scrollTo(model.index(first, 0), QTableView.ScrollHint.PositionAtTop)
        view.viewport().repaint()
        view.refresh_visible()
    assert len(view._cells._painted_cells) <= limit + 50


def test_stretch_column_takes_the_remaining_width(view) -> None:
    assert view.columnWidth(0) == view.viewport().width() - view.columnWidth(1)
    view.resize(150, 200)
    assert view.columnWidth(0) == 100  # not below its own width


def test_large_row_height_uses_the_large_font(view) -> None:
    view.set_row_height(36, large=True)
    assert view.rowHeight(0) == 36
    assert view.cell_font(Cell("x")).pixelSize() == 14


def test_column_shown_by_the_user_is_not_hidden_when_space_is_short(view) -> None:
    columns = (
        COLUMNS[0],
        replace(COLUMNS[1], hide_order=1),
        Column("own", "Own", 60, lambda _row: Cell(), is_hidden_by_default=True),
    )
    choice = ColumnChoice(columns)
    assert choice.fitting_columns([100, 60, 60], 300) == {0, 1}
    assert choice.fitting_columns([100, 60, 60], 120) == {0}
    choice.show("own", True)
    assert choice.fitting_columns([100, 60, 60], 120) == {0, 2}
    choice.show("name", False)
    assert choice.fitting_columns([100, 60, 60], 300) == {0, 1, 2}  # the first column names the row


def test_column_visibility_is_saved_and_invalid_state_is_ignored() -> None:
    choice = ColumnChoice(COLUMNS)
    choice.show("rate", False)
    again = ColumnChoice(COLUMNS)
    again.restore({**choice.saved_state(), "gone": True, "name": "yes"})
    assert again.saved_state() == {"rate": False}
    again.restore("nonsense")
    assert not again.changed


@pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)
def test_context_menu_of_the_header_lists_the_columns(qtbot, qapp, view) -> None:
    view.horizontalHeader().customContextMenuRequested.emit(QPoint(10, 10))
    menu = qapp.activePopupWidget()
    assert menu is not None
    assert [action.text() for action in menu.actions() if action.text()] == ["Rate", "Default columns"]
    menu.close()


@pytest.mark.parametrize(("width", "shows_chip"), [(220, True), (120, False)])
def test_cell_shows_its_chip_only_beside_the_full_text(view, width: int, shows_chip: bool) -> None:
    image = QImage(width, 26, QImage.Format.Format_RGB32)
    image.fill(view.theme.colour("panel"))
    painter = QPainter(image)
    cell = Cell("camera_driver", "chevron-right", chip="new")
    view.itemDelegate()._paint_cell(painter, QRectF(0, 0, width, 26), cell, "text", is_numeric=False)
    painter.end()
    colours = [image.pixelColor(x, 6) for x in range(width)]
    assert (view.theme.colour("accentTint") in colours) is shows_chip


def test_cell_paints_its_sparkline(qapp, view, model) -> None:
    delegate = view.itemDelegate()
    image = QImage(80, 26, QImage.Format.Format_RGB32)
    image.fill(view.theme.colour("panel"))
    painter = QPainter(image)
    delegate._paint_cell(painter, QRectF(0, 0, 80, 26), Cell(curve=(0.0, 1.0)), "text", is_numeric=False)
    painter.end()
    inked = [
        x for x in range(80) if any(image.pixelColor(x, y) != view.theme.colour("panel") for y in range(26))
    ]
    assert len(inked) > 60
