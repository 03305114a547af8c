"""Tests of the timeline widget with lanes that don't come from a recording: those of a program's trace."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QAccessible, QContextMenuEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.trace import AnyRecord, BlockBegan, BlockEnded, BlockWaiting, RecordsLost
from app.clock import VirtualClock
from app.core.timeline.lanes import TimelineContent, TimelineLane
from app.core.timeline.scale import MIN_SPAN_NS
from app.core.timeline.selection import TimelineSelection
from app.ui.theme.theme import Theme
from app.ui.timeline.view import TimelineView
from tests.blocks.fakes import Play
from tests.blocks.samples import block, number, started, text, workspace, write
from tests.ui.test_accessible import unsaid
from tests.ui.timeline.trace_lanes import ns, trace_content

pytest_plugins = ["tests.ui.shell_fixtures"]

SIZE = (900, 300)
TRACE: tuple[AnyRecord, ...] = (
    BlockBegan(0.0, 1, "greet"), BlockBegan(1.0, 2, "turn"), BlockBegan(4.0, 1, "wait"),
    BlockWaiting(4.0, 1, "wait", "time"), BlockEnded(6.0, 2, "turn", "failed", "no robot"),
    RecordsLost(7.0, 12, {1: "wait"}), RecordsLost(7.01, 3, {1: "wait"}), BlockEnded(10.0, 1, "wait"),
)  # fmt: skip


@dataclass
class Requests:
    """Requests of a timeline, which its owner would carry out."""

    positions: list[int] = field(default_factory=list)
    ranges: list[tuple[int, int]] = field(default_factory=list)
    lanes: list[str] = field(default_factory=list)
    opened: list[str] = field(default_factory=list)
    opened_marks: list[object] = field(default_factory=list)
    menus: list[str] = field(default_factory=list)


class Shown:
    """Timeline of a trace of ten seconds."""

    def __init__(self, view: TimelineView) -> None:
        self.view, self.requests = view, Requests()
        requests = self.requests
        view.position_requested.connect(requests.positions.append)
        view.range_requested.connect(lambda start, end: requests.ranges.append((start, end)))
        view.lane_selected.connect(requests.lanes.append)
        view.lane_opened.connect(requests.opened.append)
        view.mark_opened.connect(lambda mark: requests.opened_marks.append(mark.key))
        view.menu_requested.connect(lambda mark, _position: requests.menus.append(mark.text))

    def point(self, time_s: float, lane: int) -> QPoint:
        """Return a position in a lane, by its index."""
        return QPointF(
            self.view.x_of(ns(time_s)), self.view.geometry_of_lanes().lane_rect(lane).center().y()
        ).toPoint()

    def ruler_point(self, x: float) -> QPoint:
        return QPoint(round(x), 12)

    def click(self, point: QPoint) -> None:
        QTest.mouseClick(self.view.viewport(), Qt.MouseButton.LeftButton, pos=point)

    def press(self, key: Qt.Key, held: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
        QTest.keyClick(self.view, key, held)

    def turn_wheel(self, point: QPoint, delta: QPoint) -> None:
        place = QPointF(point)
        event = QWheelEvent(
            place, self.view.viewport().mapToGlobal(place), QPoint(), delta, Qt.MouseButton.NoButton,
            Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
        )  # fmt: skip
        QApplication.sendEvent(self.view.viewport(), event)

    def colours(self, points: list[QPoint]) -> list[str]:
        image, ratio = self.view.viewport().grab().toImage(), self.view.devicePixelRatioF()
        return [
            image.pixelColor(round(point.x() * ratio), round(point.y() * ratio)).name() for point in points
        ]


@pytest.fixture
def shown(qtbot, theme: Theme) -> Iterator[Shown]:
    view = TimelineView(theme, "Trace")
    qtbot.addWidget(view)
    view.resize(*SIZE)
    with qtbot.waitExposed(view):
        view.show()
    view.show_range(0, ns(10.0))
    view.set_content(trace_content(TRACE))
    view.grab()
    yield Shown(view)
    view.close()


def tooltips(view: TimelineView) -> list[str]:
    view.grab()
    return [painted.mark.tooltip for painted in view.marks if painted.mark.tooltip]


def test_blocks_of_a_program_are_shown_as_bars(qtbot, theme: Theme) -> None:
    wait = block("control_wait", "a", SECONDS=number(180))
    repeated = block(
        "control_repeat", "r", TIMES=number(2), BODY=[block("control_wait", "t", SECONDS=number(20))]
    )
    program = compile_behaviour(
        workspace(started(wait), started(repeated, write(text("x")) | {"id": "d"})), []
    )
    play = Play(program, clock=VirtualClock()).start().end()
    play.runtime.scheduler.record_stop()
    records = play.runtime.scheduler.take_trace()
    view = TimelineView(theme, "Trace")
    qtbot.addWidget(view)
    view.resize(*SIZE)
    view.show()
    view.show_range(0, ns(max(record.time_s for record in records)))
    view.set_content(trace_content(records))
    assert tooltips(view) == [f"block {id}" for id in "artrtr"]  # "d" takes no time
    bars = {painted.mark.text: painted.box for painted in view.marks if painted.mark.tooltip}
    assert bars["a"].left() == pytest.approx(view.x_of(0))
    assert bars["a"].right() == pytest.approx(view.x_of(ns(180.0)))
    view.close()


def test_bars_at_the_playhead_are_highlighted(shown: Shown) -> None:
    running = shown.view._theme.colour("running").name()
    edge = [shown.point(2.0, lane) - QPoint(0, 8) for lane in (0, 1)]
    shown.view.select(TimelineSelection(ns(8.0)))
    assert running not in shown.colours(edge)
    shown.view.select(TimelineSelection(ns(3.0)))
    assert shown.colours(edge) == [running, running]
    shown.view.select(TimelineSelection(ns(0.5)))
    assert [each == running for each in shown.colours(edge)] == [True, False]


def test_click_requests_a_position_and_selects_a_lane(shown: Shown) -> None:
    shown.click(shown.point(8.0, 1))
    assert shown.requests.lanes == ["script-2"]
    assert shown.view.selection.lane == "script-2"
    assert shown.requests.positions[-1] == pytest.approx(ns(8.0), abs=ns(0.02))
    shown.click(shown.point(5.0, 0))  # the bar of "wait"
    assert shown.requests.positions[-1] == ns(4.0)
    assert shown.requests.lanes == ["script-2"]
    QTest.mouseDClick(shown.view.viewport(), Qt.MouseButton.LeftButton, pos=shown.point(5.0, 0))
    QTest.mouseDClick(
        shown.view.viewport(), Qt.MouseButton.LeftButton, pos=QPoint(20, shown.point(0.0, 1).y())
    )
    assert (shown.requests.opened_marks, shown.requests.opened) == (["wait"], ["script-2"])


def test_dragging_an_edge_requests_a_range_that_is_not_empty(shown: Shown) -> None:
    view, viewport = shown.view, shown.view.viewport()
    view.select(TimelineSelection(ns(9.0), (ns(2.0), ns(6.0))))
    left, right = (view.x_of(ns(time_s)) for time_s in (2.0, 6.0))
    QTest.mousePress(viewport, Qt.MouseButton.LeftButton, pos=shown.ruler_point(left - 4))
    QTest.mouseMove(viewport, shown.ruler_point(view.x_of(ns(4.0))))
    QTest.mouseMove(viewport, shown.ruler_point(right + 40))
    QTest.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=shown.ruler_point(right + 40))
    ((start_ns, end_ns),) = shown.requests.ranges
    assert (start_ns, end_ns) == (pytest.approx(ns(4.0), abs=ns(0.02)), ns(6.0))
    assert shown.requests.positions == []
    QTest.mousePress(viewport, Qt.MouseButton.LeftButton, pos=shown.ruler_point(right + 4))
    QTest.mouseMove(viewport, shown.ruler_point(view.x_of(ns(7.0))))
    QTest.mouseRelease(viewport, Qt.MouseButton.LeftButton, pos=shown.ruler_point(view.x_of(ns(7.0))))
    assert shown.requests.ranges[-1] == (ns(2.0), pytest.approx(ns(7.0), abs=ns(0.02)))


def test_keys_zoom_and_select_lanes_with_an_announcement(
    shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    announced: list[str] = []
    monkeypatch.setattr(QAccessible, "isActive", lambda: True)
    monkeypatch.setattr(QAccessible, "updateAccessibility", lambda event: announced.append(event.message()))
    view = shown.view
    assert unsaid(view) == []
    shown.press(Qt.Key.Key_Down)
    shown.press(Qt.Key.Key_Down)
    shown.press(Qt.Key.Key_Up)
    assert shown.requests.lanes == ["script-2", "script-2", "script-1"]
    assert announced[-1] == "Script 1, Blocks 2"
    view.select(TimelineSelection(ns(5.0)))
    x = view.x_of(ns(5.0))
    shown.press(Qt.Key.Key_Plus)
    assert view.scale is not None
    assert view.scale.span_ns == pytest.approx(ns(10.0) / 1.5, abs=2)
    assert view.x_of(ns(5.0)) == pytest.approx(x, abs=0.01)
    shown.press(Qt.Key.Key_Minus)
    assert view.scale.is_full
    shown.press(Qt.Key.Key_Plus, Qt.KeyboardModifier.ShiftModifier)
    shown.press(Qt.Key.Key_0)
    assert view.scale.is_full


def test_wheel_zooms_to_its_limits_and_pans(shown: Shown) -> None:
    view, point = shown.view, shown.point(3.0, 0)
    at_ns = view.time_at(point.x())
    shown.turn_wheel(point, QPoint(0, 240))
    assert view.scale is not None
    assert view.scale.span_ns < ns(10.0)
    assert view.x_of(at_ns) == pytest.approx(point.x(), abs=0.01)
    before = view.scale
    shown.turn_wheel(point, QPoint(-1200, 0))
    assert view.scale.span_ns == before.span_ns
    assert view.scale.start_ns > before.start_ns
    shown.turn_wheel(point, QPoint(0, 2**31 - 1))
    assert view.scale.span_ns == MIN_SPAN_NS
    shown.turn_wheel(point, QPoint(0, -(2**31) + 1))
    assert view.scale.is_full


def test_moved_playhead_stays_visible(shown: Shown) -> None:
    view = shown.view
    view.zoom(0.1, 0)
    view.select(TimelineSelection(ns(9.0)))
    assert view.scale is not None
    assert view.scale.start_ns <= ns(9.0) <= view.scale.end_ns


def test_tooltips_describe_marks_adjacent_notches_and_lanes(shown: Shown) -> None:
    view = shown.view
    assert view.tooltip_at(QPointF(shown.point(5.0, 0))) == "block wait"
    assert view.tooltip_at(QPointF(shown.point(7.0, 1))) == "15 records lost"
    assert view.tooltip_at(QPointF(20, shown.point(0.0, 1).y())) == "Script 2"
    assert view.tooltip_at(QPointF(20, 12)) == ""


def test_context_menu_is_for_the_mark_under_the_mouse_or_the_flag_at_the_playhead(shown: Shown) -> None:
    view = shown.view

    def open_menu(reason: QContextMenuEvent.Reason, point: QPoint) -> None:
        QApplication.sendEvent(
            view.viewport(), QContextMenuEvent(reason, point, view.viewport().mapToGlobal(point))
        )

    open_menu(QContextMenuEvent.Reason.Mouse, shown.point(5.0, 0))
    open_menu(QContextMenuEvent.Reason.Mouse, shown.point(9.0, 1))
    open_menu(QContextMenuEvent.Reason.Keyboard, QPoint())
    assert shown.requests.menus == ["wait"]
    view.select(TimelineSelection(ns(6.0)))
    open_menu(QContextMenuEvent.Reason.Keyboard, QPoint())
    assert shown.requests.menus == ["wait", "script 2 ended"]


def test_selected_lane_among_many_is_scrolled_into_view(shown: Shown) -> None:
    view = shown.view
    view.set_content(
        TimelineContent(lanes=[TimelineLane(f"{number}", f"Lane {number}", "type") for number in range(1000)])
    )
    view.show_lane("900")
    rect = view.geometry_of_lanes().lane_rect(900)
    assert view.geometry_of_lanes().lanes_top <= rect.top() <= view.viewport().height() - rect.height()
    shown.press(Qt.Key.Key_Down)
    assert shown.requests.lanes == ["1"]
    assert view.geometry_of_lanes().lane_rect(1).top() >= view.geometry_of_lanes().lanes_top
    assert len(view.geometry_of_lanes().visible_lanes) < 20


def test_text_of_a_flag_is_edited_in_its_lane(shown: Shown) -> None:
    view, edited = shown.view, list[str]()

    def accept(name: str) -> bool:
        edited.append(name)
        return True

    view.edit("ends", ns(6.0), "script 2 ended", accept, "Name")
    assert view.field is not None
    assert view.field.x() == round(view.x_of(ns(6.0)))
    view.field.selectAll()
    QTest.keyClicks(view.field, "failure")
    QTest.keyClick(view.field, Qt.Key.Key_Return)
    assert edited[0] == "failure"
    assert view.field is None


@pytest.mark.parametrize("length_ns", [0, 1, 10 * 365 * 86_400 * 10**9])
@pytest.mark.parametrize("by_clock", [False, True])
def test_extreme_lengths_are_painted(shown: Shown, length_ns: int, by_clock: bool) -> None:
    view = shown.view
    view.show_range(0, length_ns)
    view.set_clock(is_shown=by_clock)
    view.set_content(trace_content([BlockBegan(0.0, 1, "a"), BlockEnded(length_ns / 1e9, 1, "a")]))
    assert tooltips(view) == ["block a"]


def test_cleared_timeline_ignores_mouse_and_keyboard(shown: Shown) -> None:
    view, point = shown.view, shown.point(5.0, 0)
    view.clear()
    view.grab()
    shown.click(point)
    shown.turn_wheel(point, QPoint(0, 240))
    for key in (Qt.Key.Key_Plus, Qt.Key.Key_0, Qt.Key.Key_Down):
        shown.press(key)
    assert shown.requests == Requests()
    assert view.tooltip_at(QPointF(point)) == ""
    assert view.scale is None


def test_narrow_timeline_shows_only_the_last_column(shown: Shown) -> None:
    view = shown.view
    assert view.geometry_of_lanes().has_all_columns
    view.resize(300, 200)
    geometry = view.geometry_of_lanes()
    assert not geometry.has_all_columns
    assert geometry.plot.width() >= 20
    view.set_content(TimelineContent())
    assert view.geometry_of_lanes().plot.width() > geometry.plot.width()
