"""Tests of the plot panel: time axis, mouse and keyboard, saved state."""

from __future__ import annotations

import csv
import json
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QColor, QGuiApplication, QImage, QMouseEvent, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.core.network.mailbox import Batch
from app.ui.panels.watch.plot import PANEL
from app.ui.panels.watch.plot.curve_style import DASH_PATTERNS, CurveStyle
from app.ui.panels.watch.plot.export import CSV_KIND, PNG_KIND, SVG_KIND
from app.ui.panels.watch.plot.panel import IDLE_STATS_UPDATE_TICKS, PlotPanel
from app.ui.panels.watch.plot.plotted_curve import MINUS, value_text
from app.ui.panels.watch.plot.time_view import TimeView
from app.ui.widgets.field_drag import dropped_field, field_mime_data
from nep.messages.message import Message
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, has_keys, press

TOPICS = ("/odom", "/cmd")


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> Iterator[PlotPanel]:
    made = window.make(PANEL, (900, 620))
    qtbot.addWidget(made)
    assert isinstance(made, PlotPanel)
    yield made
    made.dispose()


def message(session: Session, topic: str, time_s: float, payload: object, seq: int | None = None) -> Message:
    stamp_ns = session.shown.series.origin_ns + round(time_s * 1e9)
    return Message(
        topic, json.dumps(payload).encode(), "json", "json", stamp_ns=stamp_ns, seq=seq, publisher=1
    )


def send(panel: PlotPanel, topic: str, rows, *, dropped: int = 0) -> None:
    messages = [message(panel.session, topic, time_s, payload) for time_s, payload in rows]
    panel.session.shown.series.dispatch({topic: Batch(messages, dropped)})


def show(panel: PlotPanel, *texts: str, right: bool = False) -> None:
    for text in texts:
        panel._add_curves(panel.curves.add(text, TOPICS), right=right)


def look(panel: PlotPanel, times: int = IDLE_STATS_UPDATE_TICKS) -> None:
    for _ in range(times):
        panel.refresh()


def sine(begin: float, end: float, step: float = 0.05) -> list[tuple[float, object]]:
    return [
        (t, {"speed": float(np.sin(t)), "mode": "up" if t % 4 < 2 else "down", "on": t % 4 < 2})
        for t in np.arange(begin, end, step).tolist()
    ]


def drawn(panel: PlotPanel, colour: QColor) -> list[int]:
    """Return the columns of the plot area that contain a colour, in logical pixels."""
    if panel.canvas.height() % 2:  # a centred line would be blended over two pixel rows
        panel.canvas.resize(panel.canvas.width(), panel.canvas.height() - 1)
        panel._draw()
    image = panel.canvas.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    ratio = image.devicePixelRatio()
    area = panel.canvas.area
    pixels = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1, 4)[..., 2::-1].astype(int)
    left, right = round(area.left() * ratio) + 1, round(area.right() * ratio) - 1
    part = pixels[round(area.top() * ratio) : round(area.bottom() * ratio), left:right]
    near = np.abs(part - [colour.red(), colour.green(), colour.blue()]).max(axis=2) < 60
    return [round((left + int(x)) / ratio - area.left()) for x in np.flatnonzero(near.any(axis=0))]


def _near(one: int, other: int) -> bool:
    return all(abs((one >> shift & 255) - (other >> shift & 255)) < 60 for shift in (0, 8, 16))


def cell(panel: PlotPanel, name: str, column: str) -> str:
    place = [each.name for each in panel.table.columns].index(column)
    row = panel.model.index_of(name).row()
    return panel.model.cell_at(row, place).text


# -- curves ------------------------------------------------------------------------------------------------


def test_plot_without_curves_offers_to_add_a_curve(panel, window) -> None:
    assert panel.pages.currentIndex() == 0
    assert window.session.shown.series.topics == ()
    press(button(panel.empty, "Add a curve"))
    assert has_keys(panel.add)


def test_field_added_by_another_panel_is_plotted_and_its_topic_watched(panel, window) -> None:
    panel.plot_field("/odom", "speed")
    assert window.session.shown.series.topics == ("/odom",)
    assert "/odom" in window.session.watched
    send(panel, "/odom", sine(0, 60))
    look(panel)
    assert cell(panel, "/odom.speed", "last") == value_text(float(np.sin(59.95)))
    assert panel.points.text() == "1\u2009200 points, all shown"
    columns = drawn(panel, panel.theme.series(0))
    assert len(columns) > 0.9 * panel.canvas.area.width()
    panel.remove("/odom.speed")
    assert window.session.shown.series.topics == ()
    assert panel.pages.currentIndex() == 0


def test_lost_messages_are_a_gap_in_the_curve(panel) -> None:
    show(panel, "/odom.speed")
    send(panel, "/odom", sine(0, 20))
    send(panel, "/odom", sine(40, 60), dropped=400)
    look(panel)
    columns = drawn(panel, panel.theme.series(0))
    wide = panel.canvas.area.width()
    assert not [x for x in columns if 0.36 * wide < x < 0.64 * wide]
    assert [x for x in columns if x < 0.3 * wide]
    assert [x for x in columns if x > 0.7 * wide]
    assert "400 messages lost (gaps in the curve)" in panel.caption.text()


def test_million_points_are_reduced_to_two_per_pixel(panel) -> None:
    show(panel, "/odom.speed")
    samples = panel.shown[0].curve.samples
    times = np.arange(1_000_000) / 1000
    samples.extend(times, np.sin(times), np.zeros(len(times), dtype=bool))
    panel._set_span("all")
    look(panel)
    assert panel.points.text() == "1\u2009000\u2009000 points, downsampled to 2 per pixel"
    (item,) = panel.canvas._lines.values()
    assert len(item.xData) < 3 * panel.canvas.columns
    assert len(drawn(panel, panel.theme.series(0))) > 0.9 * panel.canvas.area.width()


def test_states_have_lanes_and_booleans_show_only_true(panel) -> None:
    show(panel, "/odom.speed", "/odom.mode", "/odom.on")
    send(panel, "/odom", sine(0, 60))
    panel._curves_changed()
    look(panel)
    words = [(curve.name, run.value) for curve, run, _box in panel.lanes.boxes()]
    assert {word for name, word in words if name == "/odom.mode"} == {"up", "down"}
    assert {word for name, word in words if name == "/odom.on"} == {"true"}
    assert cell(panel, "/odom.mode", "axis") == "text"
    assert cell(panel, "/odom.on", "axis") == "yes or no"
    panel.states.click()
    look(panel)
    assert panel.lanes.isHidden()


def test_curves_differ_in_more_than_their_colour(panel) -> None:
    show(panel, *(f"/odom.x{number}" for number in range(8)))
    looks = [each.style for each in panel.shown]
    assert len({(each.colour, each.pattern) for each in looks}) == 8
    assert len({each.pattern for each in looks[:4]}) == 4
    pens = [CurveStyle(0, pattern).pen(panel.theme) for pattern in range(4)]
    assert [bool(pen.dashPattern()) for pen in pens] == [bool(dash) for dash in DASH_PATTERNS]


def test_nonexistent_field_suggests_a_similar_field(panel) -> None:
    show(panel, "/odom.sped")
    send(panel, "/odom", sine(0, 3))
    look(panel)
    assert panel.advice.text() == "/odom.sped doesn't exist. Did you mean /odom.speed?"
    panel.remove("/odom.sped")
    show(panel, "/odom.speed")
    send(panel, "/odom", sine(3, 4))
    look(panel)
    assert panel.advice.isHidden()


@pytest.mark.parametrize(
    "values", [[1.7e308, -1.7e308], [5e-324, 0], [2**64 - 1, 2**64 - 2], [7, 7], [1e300, 1e300]]
)
def test_largest_and_smallest_numbers_are_drawn(panel, values) -> None:
    show(panel, "/odom.speed")
    send(panel, "/odom", [(t / 10, {"speed": value}) for t, value in enumerate(values * 20)])
    look(panel)
    panel.canvas.reset_value_ranges()
    look(panel)
    shown = panel.canvas.ranges["left"]
    assert shown.low < shown.high
    assert drawn(panel, panel.theme.series(0))


def test_single_value_between_two_gaps_is_drawn_as_a_dot(panel) -> None:
    show(panel, "/odom.speed")
    for begin in (0, 20, 40):
        send(panel, "/odom", [(begin, {"speed": 5})], dropped=3)
    send(panel, "/odom", [(60, {"speed": 5})], dropped=3)
    look(panel)
    wide = panel.canvas.area.width()
    places = drawn(panel, panel.theme.series(0))
    assert {round(3 * x / wide) for x in places} >= {1, 2}
    assert len(places) < 20


def test_state_changes_within_one_pixel_are_painted_once(panel) -> None:
    show(panel, "/odom.mode")
    send(panel, "/odom", [(t / 100, {"mode": f"step {t}"}) for t in range(6000)])
    panel._curves_changed()
    look(panel)
    boxes = [box for _curve, _run, box in panel.lanes.boxes()]
    wide = panel.canvas.area.width()
    assert wide / 3 < len(boxes) < 2.5 * wide


def test_footer_reports_undecodable_messages_and_discarded_points(panel) -> None:
    show(panel, "/odom.speed")
    send(panel, "/odom", sine(0, 60))
    bad = Message("/odom", b"{", "json", "json", stamp_ns=panel.session.shown.series.origin_ns, publisher=1)
    panel.session.shown.series.dispatch({"/odom": Batch([bad])})
    send(panel, "/odom", [(30, {"speed": 1})])
    look(panel)
    assert "1 message can't be decoded" in panel.caption.text()
    assert "600 points discarded: the clock was set back" in panel.caption.text()


# -- time --------------------------------------------------------------------------------------------------


def test_plot_scrolls_with_new_data_and_keeps_receiving_it_while_paused(panel) -> None:
    show(panel, "/odom.speed")
    send(panel, "/odom", sine(0, 70))
    look(panel)
    assert panel.canvas.end_s == pytest.approx(69.95)
    assert panel.canvas.end_s - panel.canvas.begin_s == 60
    QTest.keyClick(panel.canvas, Qt.Key.Key_Space)
    assert panel.paused_chip.text == "paused; still collecting data"
    assert panel.freeze.text() == "Resume"
    send(panel, "/odom", sine(70, 90))
    look(panel)
    assert panel.canvas.end_s == pytest.approx(69.95)
    assert len(panel.shown[0].curve.samples) == 1800
    press(panel.freeze)
    look(panel)
    assert panel.canvas.end_s == pytest.approx(89.95)
    assert panel.paused_chip.text == ""


def wheel(panel: PlotPanel, steps: int, modifiers=Qt.KeyboardModifier.NoModifier) -> None:
    at = QPointF(panel.canvas.area.center())
    event = QWheelEvent(
        at, panel.canvas.mapToGlobal(at), QPoint(), QPoint(0, 120 * steps), Qt.MouseButton.NoButton,
        modifiers, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(panel.canvas.viewport(), event)
    look(panel)


def test_wheel_zooms_the_time_axis_and_ctrl_wheel_the_value_axis(panel) -> None:
    show(panel, "/odom.speed")
    send(panel, "/odom", sine(0, 70))
    look(panel)
    values = panel.canvas.ranges["left"].high - panel.canvas.ranges["left"].low
    wheel(panel, 2)
    assert panel.canvas.end_s - panel.canvas.begin_s == pytest.approx(60 / 1.44)
    assert panel.canvas.end_s == pytest.approx(69.95), "it still follows"
    assert panel.span.value == ""
    wheel(panel, 1, Qt.KeyboardModifier.ControlModifier)
    assert panel.canvas.ranges["left"].high - panel.canvas.ranges["left"].low == pytest.approx(values / 1.2)
    QTest.mouseDClick(
        panel.canvas.viewport(), Qt.MouseButton.LeftButton, pos=panel.canvas.area.center().toPoint()
    )
    look(panel)
    assert panel.span.value == "all"
    assert panel.canvas.begin_s == 0
    assert panel.canvas.ranges["left"].high - panel.canvas.ranges["left"].low == pytest.approx(
        values, rel=0.1
    )


def drag(widget: QWidget, begin: QPointF, end: QPointF) -> None:
    for kind, at, held in (
        (QEvent.Type.MouseButtonPress, begin, Qt.MouseButton.LeftButton),
        (QEvent.Type.MouseMove, (begin + end) / 2, Qt.MouseButton.LeftButton),
        (QEvent.Type.MouseMove, end, Qt.MouseButton.LeftButton),
        (QEvent.Type.MouseButtonRelease, end, Qt.MouseButton.NoButton),
    ):
        which = Qt.MouseButton.NoButton if kind == QEvent.Type.MouseMove else Qt.MouseButton.LeftButton
        nothing = Qt.KeyboardModifier.NoModifier
        QApplication.sendEvent(widget, QMouseEvent(kind, at, widget.mapToGlobal(at), which, held, nothing))


def test_drag_pans_the_plot_and_pauses_following(panel) -> None:
    show(panel, "/odom.speed")
    send(panel, "/odom", sine(0, 70))
    look(panel)
    middle = panel.canvas.area.center()
    drag(panel.canvas.viewport(), middle, middle + QPointF(panel.canvas.area.width() / 4, 0))
    look(panel)
    assert panel.canvas.end_s == pytest.approx(69.95 - 15, abs=0.2)
    assert panel.freeze.isChecked()


def test_zoom_keeps_the_time_span_within_its_limits() -> None:
    view = TimeView()
    for factor in (1e-30, 1e30, 1e30, 1e-5):
        view.zoom(factor, 5.0, view.visible_range(0.0, 10.0))
        begin, end = view.visible_range(0.0, 10.0)
        assert 0 < end - begin <= 1e9
    view.pause((1.0, 3.0))
    view.zoom(2.0, 2.0, (1.0, 3.0))
    assert view.visible_range(0.0, 99.0) == pytest.approx((0.0, 4.0)), "what is under the mouse stays there"
    view.set_span(0.0)
    assert view.visible_range(-7.0, 99.0) == (-7.0, 4.0)


# -- cursors A and B ---------------------------------------------------------------------------------------


def test_cursors_a_and_b_are_moved_by_mouse_and_keys(panel) -> None:
    show(panel, "/odom.speed", "/odom.mode")
    send(panel, "/odom", sine(0, 60))
    look(panel)
    panel._curves_changed()
    QTest.keyClick(panel.canvas, Qt.Key.Key_M)
    look(panel)
    assert set(panel.canvas.cursors) == {"A", "B"}
    x = panel.canvas.x_of(panel.canvas.cursors["A"])
    flag = panel.canvas._flag_rect(x).center()
    drag(panel.canvas.viewport(), flag, flag - QPointF(40, 0))
    assert panel.canvas.x_of(panel.canvas.cursors["A"]) == pytest.approx(x - 40, abs=1)
    panel._set_cursor("A", 10.0)
    QTest.keyClick(panel.canvas, Qt.Key.Key_Right)
    assert panel.canvas.cursors["A"] == pytest.approx(10.05)
    QTest.keyClick(panel.canvas, Qt.Key.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    assert panel.canvas.cursors["A"] == pytest.approx(9.55)
    panel._set_cursor("B", 20.0)
    look(panel)
    assert cell(panel, "/odom.speed", "a") == value_text(float(np.sin(9.55)))
    assert cell(panel, "/odom.speed", "difference") == value_text(float(np.sin(20.0) - np.sin(9.55)))
    inside = np.sin(np.arange(9.55, 20.01, 0.05))
    assert cell(panel, "/odom.speed", "max") == value_text(float(inside.max()))
    assert cell(panel, "/odom.speed", "mean") == value_text(float(inside.mean()))
    assert cell(panel, "/odom.mode", "difference") == "6 changes"
    assert panel.caption.text() == "Min, max and mean between A and B"
    QTest.keyClick(panel.canvas, Qt.Key.Key_M)
    assert panel.canvas.cursors == {}


# -- table -------------------------------------------------------------------------------------------------


def test_eye_icon_hides_a_curve_and_its_menu_changes_axis_and_colour(panel, window) -> None:
    show(panel, "/odom.speed", "/odom.turn")
    send(panel, "/odom", [(t, {"speed": 1, "turn": 1000 + t}) for t in range(50)])
    look(panel)
    index = panel.model.index(0, 0)
    QTest.mouseClick(
        panel.table.viewport(), Qt.MouseButton.LeftButton, pos=panel.table.visualRect(index).center()
    )
    assert panel.shown[0].is_hidden
    look(panel)
    assert list(panel.canvas._lines) == ["/odom.turn"]
    menu = panel.table.menu_of(panel.shown[1])
    actions = {action.text(): action for action in menu.actions()}
    actions["Right axis"].trigger()
    actions["Pink"].trigger()
    look(panel)
    assert panel.shown[1].is_on_right_axis
    assert panel.shown[1].style.colour == 3
    assert panel.canvas.ranges["right"].high > 1000
    assert not panel.canvas.plot.getAxis("left").style["showValues"]
    panel.table.setCurrentIndex(panel.model.index(1, 2))
    QTest.keyClick(panel.table, Qt.Key.Key_Delete)
    assert [each.name for each in panel.shown] == ["/odom.speed"]
    words, undo = window.toast_buttons[-1]
    assert (window.toasts[-1], words) == ("Removed /odom.turn", "Undo")
    undo()
    second = panel.shown[1]
    assert (second.name, second.is_on_right_axis, second.style.colour) == ("/odom.turn", True, 3)


def test_plot_shortcuts_work_while_the_table_has_focus(panel) -> None:
    show(panel, "/odom.speed")
    look(panel)
    panel.table.setFocus()
    QTest.keyClick(panel.table, Qt.Key.Key_Space)
    assert panel.freeze.isChecked()
    QTest.keyClick(panel.table, Qt.Key.Key_M)
    assert panel.cursors.isChecked()


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0, "0"), (0.0, "0"), (1.2839, "1.284"), (-0.30712, f"{MINUS}0.307"), (12.5, "12.500"),
        (2**64 - 1, "18446744073709551615"),
        (1e300, "1.0e+300"), (float("nan"), "NaN"), (float("-inf"), f"{MINUS}∞"), (True, "true"),
        (None, ""), ("up", "up"),
        (12345, "12\u2009345"), (4.2e-7, f"4.2e{MINUS}07"), (10**400, "∞"), ([1], ""),
    ],
)  # fmt: skip
def test_values_are_formatted_for_the_curve_table(value, words) -> None:
    assert value_text(value) == words


# -- adding curves -----------------------------------------------------------------------------------------


@pytest.fixture
def adding(panel, window, qtbot) -> PlotPanel:
    panel.activateWindow()
    panel.add.prompt("")
    qtbot.waitUntil(panel.add.hasFocus)
    session = window.session
    session.send("/odom", {"pose": {"x": 1.5, "y": 2}, "speed": 3, "ranges": [1, 2, 3]})
    panel.add._refresh_fields()
    return panel


def test_fields_are_suggested_with_values_and_accepted_by_enter(adding, window) -> None:
    panel = adding
    assert "/odom" in window.session.watched
    QTest.keyClicks(panel.add, "pos")
    offered = {
        line.entry.text: line.entry.note
        for line in panel.add.matches.list.line_model.lines
        if hasattr(line, "entry")
    }
    assert offered["/odom.pose.x"] == "1.500"
    QTest.keyClick(panel.add, Qt.Key.Key_Down)
    QTest.keyClick(panel.add, Qt.Key.Key_Return, Qt.KeyboardModifier.ShiftModifier)
    assert [(each.name, each.is_on_right_axis) for each in panel.shown] == [("/odom.pose.y", True)]
    assert panel.add.text() == ""
    assert window.session.shown.series.topics == ("/odom",)
    assert window.session.watched == ["/odom"], "nothing else is looked at any more"


def test_tab_key_completes_a_field_up_to_the_next_dot(adding) -> None:
    panel = adding
    panel.add.setText("/od")
    QTest.keyClick(panel.add, Qt.Key.Key_Tab)
    assert panel.add.text() == "/odom"
    QTest.keyClicks(panel.add, ".po")
    QTest.keyClick(panel.add, Qt.Key.Key_Tab)
    assert panel.add.text() == "/odom.pose."
    panel.add.setText("mean(/odom.sp")
    QTest.keyClick(panel.add, Qt.Key.Key_Tab)
    assert panel.add.text() == "mean(/odom.speed"


def test_expression_is_accepted_and_all_array_elements_can_be_added_together(adding, window) -> None:
    panel = adding
    QTest.keyClicks(panel.add, "/odom.speed * 2")
    QTest.keyClick(panel.add, Qt.Key.Key_Return)
    panel.add.prompt("/odom.ranges[*]")
    window.session.send("/odom", {"pose": {"x": 1.5, "y": 2}, "speed": 3, "ranges": [1, 2, 3]})
    QTest.keyClick(panel.add, Qt.Key.Key_Return)
    assert [each.name for each in panel.shown] == [
        "/odom.speed * 2", "/odom.ranges[0]", "/odom.ranges[1]", "/odom.ranges[2]",
    ]  # fmt: skip
    look(panel)
    assert panel.shown[0].curve.samples.values.tolist() == [6.0]


def test_nonexistent_topic_stays_in_the_input_with_a_suggestion(adding) -> None:
    panel = adding
    panel.add.setText("/odon.speed + 1")
    QTest.keyClick(panel.add, Qt.Key.Key_Return)
    assert panel.add.error_message == "Topic /odon doesn't exist; did you mean /odom?"
    assert panel.add.text() == "/odon.speed + 1"
    assert panel.shown == []
    QTest.keyClick(panel.add, Qt.Key.Key_Escape)
    assert panel.add.text() == ""


def test_image_topics_are_not_subscribed_to_find_numeric_fields(adding, window) -> None:
    codecs = {
        window.session.shown.topics[name].codec
        for name in window.session.watched
        if name in window.session.shown.topics
    }
    assert "image" not in codecs
    adding.add.dispose()
    assert window.session.watched == []


# -- fields from other panels ------------------------------------------------------------------------------


def test_field_round_trips_as_drag_data_and_invalid_data_is_ignored() -> None:
    data = field_mime_data("ros2 /odom", 'pose["first name"]')
    assert dropped_field(data) == ("ros2 /odom", 'pose["first name"]')
    assert data.text() == 'ros2 /odom.pose["first name"]'
    data.setData("application/x-nep-field", b"[1, 2]")
    assert dropped_field(data) is None
    data.setData("application/x-nep-field", b"\xff")
    assert dropped_field(data) is None


def test_topic_without_known_fields_prompts_for_the_field(panel) -> None:
    panel.plot_field("/odom", "")
    assert panel.add.text() == "/odom."
    QTest.keyClicks(panel.add, "x")
    assert panel.add.text() == "/odom.x"


# -- XY mode -----------------------------------------------------------------------------------------------


def test_second_curve_is_plotted_against_the_first_in_xy_mode(panel) -> None:
    show(panel, "/odom.x", "/odom.y")
    angles = np.linspace(0, 6, 300).tolist()
    send(panel, "/odom", [(a * 5, {"x": float(np.cos(a)), "y": float(np.sin(a))}) for a in angles])
    look(panel)
    panel.xy_toggle.click()
    panel.cursors.click()
    panel._set_cursor("A", 0.0)
    panel._set_cursor("B", 30.0)
    look(panel)
    assert panel.drawings.currentWidget() is panel.xy
    one, other = panel.xy.position_of(0, 0), panel.xy.position_of(1, 1)
    assert abs(other.x() - one.x()) == pytest.approx(abs(other.y() - one.y()), rel=1e-6), "equal scales"
    assert "A to B" in panel.caption.text()
    (path,) = panel.xy._paths
    assert len(path[2]) == 300
    panel.xy_toggle.click()
    assert panel.drawings.currentWidget() is panel.canvas


@pytest.mark.parametrize(
    "values", [[1.7e308, -1.7e308], [5e-324, 0], [2**64 - 1, 2**64 - 2], [7, 7], [1e300, 1e300], [10**400, 1]]
)
def test_largest_and_smallest_numbers_are_drawn_in_xy_mode(panel, values) -> None:
    show(panel, "/odom.x", "/odom.y")
    rows = [(t / 10, {"x": value, "y": value}) for t, value in enumerate(values * 20)]
    send(panel, "/odom", rows)
    panel.xy_toggle.click()
    panel.cursors.click()
    panel._set_cursor("A", 0.0)
    panel._set_cursor("B", 1.0)
    look(panel)
    assert panel.drawings.currentWidget() is panel.xy
    assert not panel.xy.grab().isNull()
    (path,) = panel.xy._paths
    assert len(path[2]) > 1


# -- saving and exporting ----------------------------------------------------------------------------------


def test_layout_restores_the_plot_even_if_topics_are_missing(qtbot, panel, window) -> None:
    show(panel, "/odom.speed", "/odom.speed - /cmd.linear", right=True)
    panel.shown[0].is_hidden = True
    panel._set_span("300")
    kept = json.loads(json.dumps(panel.save_state()))
    other = Window(Session()).make(PANEL, (600, 400))
    qtbot.addWidget(other)
    assert isinstance(other, PlotPanel)
    other.restore_state(kept)
    assert [(each.name, each.is_on_right_axis, each.is_hidden) for each in other.shown] == [
        ("/odom.speed", True, True),
        ("/odom.speed - /cmd.linear", True, False),
    ]
    assert other.span.value == "300"
    assert sorted(other.session.shown.series.topics) == ["/cmd", "/odom"]
    assert other.save_state() == panel.save_state()
    other.dispose()
    assert other.session.shown.series.topics == ()


@pytest.mark.parametrize(
    "state",
    [{}, {"curves": 5}, {"curves": [1, {}, {"text": "((("}, {"topic": "/a", "path": "]["}]},
     {"curves": [{"topic": "/a", "path": "b", "colour": "x", "pattern": -3, "right": 7}]},
     {"span": "x"}, {"span": float("inf")}, {"span": -1}, {"curves": None, "across": 3}],
)  # fmt: skip
def test_damaged_layout_restores_a_usable_plot(panel, state) -> None:
    panel.restore_state(state)
    show(panel, "/odom.speed")
    send(panel, "/odom", sine(0, 5))
    look(panel)
    assert panel.points.text().startswith("100 points")


def test_data_images_and_svg_are_exported(qtbot, panel, window, tmp_path: Path) -> None:
    show(panel, "/odom.speed", "/odom.mode")
    send(panel, "/odom", sine(0, 100))
    panel._curves_changed()
    look(panel)
    panel.exporter.write(tmp_path / "a.csv", CSV_KIND)
    qtbot.waitUntil(lambda: panel.refresh() or "Exported a.csv" in window.toasts)
    rows = list(csv.reader((tmp_path / "a.csv").read_text().splitlines()))
    assert rows[0] == ["stamp_ns", "time_utc", "/odom.speed", "/odom.mode"]
    assert len(rows) == 1 + 1201, "what is shown"
    panel.exporter.write(tmp_path / "a.png", PNG_KIND)
    image = QImage(str(tmp_path / "a.png"))
    assert image.width() == 2 * panel.drawings.width()
    row = image.height() // 3
    assert any(_near(image.pixel(x, row), panel.theme.series(0).rgb()) for x in range(image.width()))
    panel.exporter.write(tmp_path / "a.svg", SVG_KIND)
    assert (tmp_path / "a.svg").read_text().count("<path") + (tmp_path / "a.svg").read_text().count(
        "<poly"
    ) > 3
    assert window.toasts[-1] == "Exported a.svg"


def test_export_that_cannot_be_written_is_reported(qtbot, panel, window, tmp_path: Path) -> None:
    show(panel, "/odom.speed")
    look(panel)
    (tmp_path / "file").write_text("x")
    for kind in (CSV_KIND, PNG_KIND):
        panel.exporter.write(tmp_path / "file" / f"a{kind.suffix}", kind)
        qtbot.waitUntil(
            lambda: panel.refresh() or any(each.startswith("Can't export") for each in window.toasts)
        )
        window.toasts.clear()
    qtbot.waitUntil(lambda: "studio-plot-export" not in {each.name for each in threading.enumerate()})


def test_curve_name_is_copied(panel, window) -> None:
    show(panel, "/odom.speed")
    menu = panel.table.menu_of(panel.shown[0])
    next(action for action in menu.actions() if action.text() == "Copy name").trigger()
    assert QGuiApplication.clipboard().text() == "/odom.speed"
