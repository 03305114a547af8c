from __future__ import annotations

import pytest

from app.robots.description.inputs import Choice
from app.robots.description.model import DataField, Sensor
from app.ui.panels.robots import sensors
from app.ui.panels.robots.sensors import PANEL, SensorRow, SensorsPanel
from app.ui.text.sensor_values import ReadingText, quantity_text, reading_text
from app.ui.theme import fonts
from app.ui.theme.theme import Theme
from tests.ui.fakes import Session
from tests.ui.panel_case import Window
from tests.ui.sample_data import pepper

POSE = Sensor("pose", "position", "object", "/p", fields=(
    DataField("x", "x", "number", "m"), DataField("y", "y", "number", "m"),
        DataField("theta", "facing", "number", "°")))  # fmt: skip


@pytest.mark.parametrize(
    ("sensor", "value", "reading"),
    [
        (Sensor("t", "touch", "boolean", "/t"), True, ReadingText("yes")),
        (Sensor("t", "touch", "boolean", "/t"), False, ReadingText("no")),
        (Sensor("t", "touch", "boolean", "/t"), None, ReadingText()),
        (Sensor("d", "d", "number", "/d", "m", 0, 2), 0.82, ReadingText("0.82 m", fraction=0.41)),
        (Sensor("d", "d", "number", "/d", "m", 0, 2), 7.0, ReadingText("7 m", fraction=1.0)),
        (Sensor("d", "d", "number", "/d", "dB"), 34.04, ReadingText("34.0 dB")),
        (Sensor("b", "b", "integer", "/b", "%", 0, 100), 84, ReadingText("84 %", fraction=0.84)),
        (Sensor("w", "word", "text", "/w"), "hello", ReadingText("“hello”")),
        (Sensor("w", "word", "text", "/w"), "", ReadingText("")),
        (Sensor("c", "c", "choice", "/c", choices=(Choice("en", "English"),)), "en", ReadingText("English")),
        (POSE, {"x": 1.284, "y": -0.307, "theta": 31.2}, ReadingText("1.3, \u22120.3 m", "facing 31°")),
        (POSE, {}, ReadingText("", "")),
        (Sensor("f", "faces", "detections", "/f"), {"count": 1, "name": "Aiko", "items": []},
        ReadingText("1", "Aiko")),
        (Sensor("f", "faces", "detections", "/f"), {"items": [{"name": "a"}, {"name": "b"}]},
        ReadingText("2", "a, b")),
        (Sensor("l", "list", "list", "/l"), ["x", "y"], ReadingText("2", "x, y")),
    ],
)  # fmt: skip
def test_sensor_value_is_formatted_in_words(sensor: Sensor, value: object, reading: ReadingText) -> None:
    found = reading_text(sensor, value)
    assert (found.value, found.details) == (reading.value, reading.details)
    assert found.fraction == (pytest.approx(reading.fraction) if reading.fraction is not None else None)


def test_numbers_have_significant_decimals() -> None:
    assert [quantity_text(value, "m") for value in (1.0, -0.3, 12.34, 123.4)] == [
        "1 m",
        "\u22120.30 m",
        "12.3 m",
        "123 m",
    ]
    assert quantity_text(31, "°") == "31°"


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


def test_sensors_except_images_are_listed_with_their_values(qtbot, window) -> None:
    panel = window.make(PANEL, (384, 300))
    qtbot.addWidget(panel)
    assert isinstance(panel, SensorsPanel)
    shown = {row.title: row.reading.value for row in panel.rows}
    assert "Camera" not in shown
    assert shown["Head touch"] == "no"
    assert shown["Distance"] == "0.82 m"
    assert shown["Position"] == "1.3, \u22120.3 m"
    assert window.session.looked_at == ["Pepper"]
    panel.dispose()
    assert window.session.looked_at == []


def test_common_sensors_come_first_and_no_row_is_clipped(qtbot, window) -> None:
    panel = window.make(PANEL, (384, 130))
    qtbot.addWidget(panel)
    assert isinstance(panel, SensorsPanel)
    panel.set_density("comfortable")
    assert [row.title for row in panel.rows[:3]] == ["Head touch", "Distance", "Battery"]
    heights = [28, 28, 28, 28, 0]
    qtbot.waitUntil(
        lambda: [row.visibleRegion().boundingRect().height() for row in panel.rows[:5]] == heights
    )
    panel.resize(384, 600)
    qtbot.waitUntil(lambda: panel.rows[-1].visibleRegion().boundingRect().height() == 28)


def test_values_are_updated_and_the_time_of_the_last_true_value_is_shown(qtbot, window, monkeypatch) -> None:
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert isinstance(panel, SensorsPanel)
    now = [100.0]
    monkeypatch.setattr(sensors.time, "monotonic", lambda: now[0])
    values = window.session.fleet.links[0].values
    touch = panel.rows[0]
    values["head_touched"] = True
    panel.refresh()
    assert touch.reading == ReadingText("yes")
    values["head_touched"] = False
    now[0] = 114.3
    panel.refresh()
    assert touch.reading == ReadingText("no", "14 s ago")
    assert touch.accessibleDescription() == "no 14 s ago"


def test_disconnected_robot_shows_no_sensor_values(qtbot, window) -> None:
    panel = window.make(PANEL, (384, 300))
    qtbot.addWidget(panel)
    assert isinstance(panel, SensorsPanel)
    window.session.fleet.links[0].is_connected = False
    panel.refresh()
    assert {row.reading for row in panel.rows} == {ReadingText()}


def test_rows_with_different_values_are_painted_differently(qtbot, window) -> None:
    panel = window.make(PANEL, (384, 300))
    qtbot.addWidget(panel)
    before = panel.grab().toImage()
    window.session.fleet.links[0].values["battery"] = 12
    panel.refresh()
    assert panel.grab().toImage() != before


def test_panel_without_a_robot_shows_an_empty_state_and_rows_follow_the_description(qtbot, qapp) -> None:
    window = Window(Session())
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert isinstance(panel, SensorsPanel)
    assert panel.empty.isVisible()
    link = window.session.join(pepper())
    panel.refresh()
    count = len(panel.rows)
    link.robot = type(link.robot)(**{**vars(link.robot), "sensors": link.robot.sensors[:2]})
    window.session.fleet.revision += 1
    panel.refresh()
    assert (count, len(panel.rows)) == (8, 2)
    assert window.session.looked_at == ["Pepper"]


def test_details_move_next_to_the_title_or_are_left_out_in_a_narrow_row(qtbot, qapp, monkeypatch) -> None:
    fonts.load()
    row = SensorRow(Theme("light"), POSE)
    qtbot.addWidget(row)
    row.show_value({"x": 1.284, "y": -0.307, "theta": 31.2}, 0.0)
    painted: dict[str, float] = {}
    monkeypatch.setattr(
        sensors.paint, "text_line", lambda _painter, rect, text, *_: painted.update({text: rect.left()})
    )
    details_left = []
    for width in (384, 290, 220):
        painted.clear()
        row.resize(width, 28)
        row.grab()
        assert {"Position", "1.3, \u22120.3 m"} <= set(painted)
        details_left.append(painted.get("facing 31°"))
    wide, narrow, hidden = details_left
    assert wide is not None
    assert narrow is not None
    assert wide > narrow
    assert hidden is None
    assert row.toolTip() == "facing 31°"
