"""Tests of exceptions in Qt overrides: each is logged once per call, and Qt gets a neutral result."""

from __future__ import annotations

import ast
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import QAbstractListModel, QByteArray, QModelIndex, QObject, QRect, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QHBoxLayout, QListView, QWidget

import app.ui
from app.ui.overrides import NEUTRAL_RESULTS
from tests.syntax import nodes, parse


def wrong_number() -> object:
    return int("x")  # raised in C, which used to end the process


def no_attribute() -> object:
    return None.no_such  # type: ignore[attr-defined]


def raised() -> object:
    raise KeyError("no icon 'split'")


@pytest.fixture(params=[wrong_number, no_attribute, raised])
def fail(request: pytest.FixtureRequest) -> Callable[[], object]:
    return request.param


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the exception types passed to `sys.excepthook`."""
    found: list[str] = []
    monkeypatch.setattr("sys.excepthook", lambda kind, _error, _trace: found.append(kind.__name__))
    return found


def test_widget_with_raising_overrides_is_still_shown(qtbot, fail, told: list[str]) -> None:
    class Bad(QWidget):
        def paintEvent(self, _event: QPaintEvent) -> None:
            painter = QPainter(self)  # still active when fail() raises
            painter.drawLine(0, 0, 9, 9)
            fail()

        def sizeHint(self) -> QSize:
            fail()
            return QSize(1, 1)

        def event(self, event: object) -> bool:
            return super().event(event)

        def eventFilter(self, _watched: QObject, _event: object) -> bool:
            return bool(fail())

    window = QWidget()
    qtbot.addWidget(window)
    bad = Bad()
    QHBoxLayout(window).addWidget(bad)
    window.installEventFilter(bad)
    window.show()
    qtbot.waitUntil(lambda: len(told) > 3)
    window.removeEventFilter(bad)
    count = len(told)
    bad.resize(20, 20)
    assert bad.grab().width() > 0  # the painter of the failed paint event was ended
    assert len(told) > count
    assert bad.isVisible()


def test_errors_in_layout_and_model_overrides_are_logged(qtbot, fail, told: list[str]) -> None:
    class Row(QHBoxLayout):
        def heightForWidth(self, _width: int) -> int:
            fail()
            return 1

        def hasHeightForWidth(self) -> bool:
            return True

        def setGeometry(self, _rect: QRect) -> None:
            fail()

    class Names(QAbstractListModel):
        def rowCount(self, _parent: QModelIndex = QModelIndex()) -> int:  # noqa: B008  Qt's default
            return 2

        def data(self, _index: QModelIndex, _role: int = Qt.ItemDataRole.DisplayRole) -> object:
            return fail()

        def roleNames(self) -> dict[int, QByteArray]:
            return {}

    window = QWidget()
    qtbot.addWidget(window)
    view = QListView()
    view.setModel(Names(view))
    row = Row(window)
    row.addWidget(view)
    window.show()
    qtbot.waitExposed(window)
    view.grab()
    assert told
    assert view.model().index(0).data() is None


def test_exception_in_a_method_that_is_no_qt_override_propagates(qapp) -> None:
    class Own(QWidget):
        def count(self) -> int:
            return int("x")

    with pytest.raises(ValueError, match="invalid literal"):
        Own().count()


@pytest.mark.usefixtures("syntax_trees")
def test_every_qt_override_is_guarded() -> None:
    """A camelCase name is a Qt override: it must be guarded or known to need no guard."""
    # Not called by Qt: called by pyqtgraph while painting, or only declared in a protocol of Qt methods.
    ours = {"setText", "installEventFilter", "insertWidget", "columnWidth"}
    ours |= {"tickSpacing", "tickStrings"}
    found: set[str] = set()
    for path in Path(app.ui.__file__).parent.rglob("*.py"):
        for node in nodes(parse(path), ast.ClassDef):
            found |= {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
    qt = {name for name in found if not name.islower() and "_" not in name}
    assert {name for name in qt if name not in NEUTRAL_RESULTS and not name.endswith("Event")} == ours
