"""Tests of shared widgets: appearance and keyboard control."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QImage, QPainter, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QLabel,
    QStyleOptionButton,
    QStyleOptionComboBox,
    QVBoxLayout,
    QWidget,
)

from app.core.storage.settings import Mode
from app.ui.theme.style_sheet import BUTTON_COLOURS
from app.ui.theme.theme import Theme
from app.ui.widgets import (
    Button,
    Chip,
    ComboBox,
    EmptyAction,
    EmptyState,
    IconButton,
    RunButton,
    SearchField,
    Segments,
    SliderWithUnit,
    Sparkline,
    StatusItem,
    SteadyLabel,
    StopButton,
    Switch,
    ValueBar,
    paint,
)
from app.ui.widgets.buttons import Kind
from app.ui.widgets.cards import AlertRow
from app.ui.widgets.indicators import paint_sparkline
from app.ui.widgets.inputs.check_box import CheckBox
from app.ui.widgets.inputs.fields import LongTextField
from app.ui.widgets.inputs.slider import SliderTrack, decimals_of
from app.ui.widgets.keyboard import tab_stops_of
from app.ui.widgets.labels import IconLabel
from app.ui.widgets.lists.scroll_areas import ContentScrollArea, ScrollColumn

pytest_plugins = ["tests.ui.shell_fixtures"]


def colours(widget: QWidget) -> set[str]:
    """Return the colours of all pixels of a widget."""
    image = widget.grab().toImage()
    return {image.pixelColor(x, y).name() for x in range(image.width()) for y in range(image.height())}


def wheel(widget: QWidget, steps: int) -> None:
    event = QWheelEvent(
        QPointF(5, 5), QPointF(5, 5), QPoint(0, 0), QPoint(0, 120 * steps), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(widget, event)


def shown(qtbot, widget: QWidget) -> QWidget:
    qtbot.addWidget(widget)
    widget.show()
    return widget


@pytest.fixture
def slider(qtbot, theme: Theme) -> SliderWithUnit:
    made = SliderWithUnit(theme, -1, 1, step=0.05, value=0.5, default=0.25, unit="m", name="Distance")
    shown(qtbot, made)
    return made


def test_slider_steps_by_keyboard(qtbot, slider: SliderWithUnit) -> None:
    told: list[float] = []
    slider.changed.connect(told.append)
    keys = (Qt.Key.Key_Right, Qt.Key.Key_PageDown, Qt.Key.Key_Home, Qt.Key.Key_End)
    for key in keys:
        QTest.keyClick(slider.track, key)
    assert told == pytest.approx([0.55, 0.05, -1.0, 1.0])
    assert slider.field.text() == "1.00"


def test_wheel_changes_the_slider_only_with_focus(qtbot, slider: SliderWithUnit) -> None:
    slider.activateWindow()
    slider.field.setFocus()
    qtbot.waitUntil(slider.field.hasFocus)
    wheel(slider.track, 1)
    assert slider.value == 0.5
    slider.track.setFocus()
    qtbot.waitUntil(slider.track.hasFocus)
    wheel(slider.track, 1)
    assert slider.value > 0.5


def test_double_click_on_the_slider_restores_its_default(slider: SliderWithUnit) -> None:
    QTest.mouseDClick(slider.track, Qt.MouseButton.LeftButton)
    assert slider.value == 0.25


def test_click_on_the_track_moves_the_slider_to_the_click_position(slider: SliderWithUnit) -> None:
    place = QPoint(slider.track.width() - 10, slider.track.height() // 2)
    QTest.mouseClick(slider.track, Qt.MouseButton.LeftButton, pos=place)
    assert slider.value == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("typed", "sentence"),
    [
        ("2", "The maximum is 1 m."),
        ("-3", "The minimum is -1 m."),
        ("far", "Enter a number."),
        ("nan", "Enter a number."),
    ],
)
def test_invalid_number_is_kept_and_the_reason_is_shown(
    slider: SliderWithUnit, typed: str, sentence: str
) -> None:
    slider.field.setText(typed)
    slider.field.editingFinished.emit()
    assert slider.field.text() == typed
    assert slider.field.problem == sentence
    assert slider.field.property("wrong") == "true"
    assert slider.value == 0.5
    slider.field.setText("0,75")
    slider.field.editingFinished.emit()
    assert slider.value == 0.75
    assert slider.field.problem == ""


def test_slider_with_an_empty_range_raises(theme: Theme) -> None:
    with pytest.raises(ValueError, match="no range from 1 to 1"):
        SliderWithUnit(theme, 1, 1)


@pytest.mark.parametrize(("step", "digits"), [(1, 0), (5, 0), (0.5, 1), (0.05, 2), (1e-9, 6)])
def test_number_of_decimals_is_derived_from_the_step(step: float, digits: int) -> None:
    assert decimals_of(step) == digits


def test_segments_are_selected_by_arrow_keys_and_only_user_changes_emit_a_signal(qtbot, theme: Theme) -> None:
    made = Segments(theme, [("a", "One", None), ("b", "Two", "bot")], "a", check=True)
    shown(qtbot, made)
    told: list[str] = []
    made.changed.connect(told.append)
    made.set_value("b")
    assert (made.value, told) == ("b", [])
    made.set_value("z")
    assert made.value == "b"
    first = made.findChildren(QWidget)[0]
    made.activateWindow()
    qtbot.waitUntil(made.isActiveWindow)
    QTest.mouseClick(first, Qt.MouseButton.LeftButton)
    assert (made.value, told) == ("a", ["a"])
    qtbot.waitUntil(first.hasFocus)
    QTest.keyClick(first, Qt.Key.Key_Right)
    assert (made.value, told) == ("b", ["a", "b"])


def test_chip_without_text_is_hidden_and_chip_without_parent_opens_no_window(qtbot, theme: Theme) -> None:
    holder = QWidget()
    chip = Chip(theme, "", "ok", parent=holder)
    loose = Chip(theme, "ready", "ok")
    shown(qtbot, holder)
    qtbot.addWidget(loose)
    assert not loose.isVisible()
    assert chip.isHidden()
    chip.set("silent for 4 s", "error")
    assert chip.isVisible()
    assert chip.accessibleName() == "silent for 4 s"
    assert theme.colour("errorTint").name() in colours(chip)
    with pytest.raises(KeyError):
        chip.set("x", "sparkling")


def test_primary_button_is_filled_only_while_enabled(qtbot, theme: Theme) -> None:
    theme.apply()
    holder = QWidget()
    primary = Button(theme, "Try", "play", kind="primary", parent=holder)
    shown(qtbot, holder)
    assert theme.colour("accent").name() in colours(primary)
    primary.setEnabled(False)
    assert theme.colour("accent").name() not in colours(primary)


def test_icon_button_names_its_action_and_shortcut(theme: Theme) -> None:
    button = IconButton(theme, "pause", "Pause", "F8")
    assert (button.accessibleName(), button.toolTip()) == ("Pause", "Pause (F8)")


def test_run_button_keeps_its_width_when_its_text_is_resume(theme: Theme) -> None:
    button = RunButton(theme, "Run", "play", longest_text="Resume")
    before = button.sizeHint()
    button.set_label("Resume")
    assert button.sizeHint() == before


@pytest.mark.parametrize(
    ("place", "least"), [("runBar", (164, 44)), ("toolBar", (132, 30)), ("appBar", (112, 30))]
)
def test_stop_keeps_its_size_and_red_colour_in_every_state(qtbot, theme: Theme, place: str, least) -> None:
    stop = StopButton(theme, place)  # type: ignore[arg-type]
    shown(qtbot, stop)
    before = stop.sizeHint()
    assert (before.width() - 8, before.height() - 8) >= least
    for word, ring in (("Stop", False), ("Stopping", True), ("Stop again", False)):
        stop.show_state(word, has_ring=ring)
        assert stop.sizeHint() == before
        assert stop.isEnabled()
        assert theme.colour("stop").name() in colours(stop)
        assert stop.accessibleName() == word


def test_value_bar_clamps_its_fraction_and_is_empty_for_nan(theme: Theme) -> None:
    bar = ValueBar(theme)
    assert bar.fraction is None
    bar.set_fraction(1.7)
    assert bar.fraction == 1.0
    bar.set_fraction(float("nan"))
    assert bar.fraction is None


def test_sparkline_paints_a_stroke(qtbot, theme: Theme) -> None:
    spark = Sparkline(theme)
    shown(qtbot, spark)
    before = colours(spark)
    spark.set_values([1, 5, 2, 8])
    assert len(colours(spark)) > len(before)


def stroke(values: list[float]) -> list[int]:
    """Return the rows (0 to 15) in which a sparkline of the values has dark pixels."""
    image = QImage(56, 16, QImage.Format.Format_RGB32)
    image.fill(Qt.GlobalColor.white)
    painter = QPainter(image)
    paint_sparkline(painter, QRectF(0, 0, 56, 16), values, QColor("black"))
    painter.end()
    return [y for y in range(16) if any(image.pixelColor(x, y).lightness() < 128 for x in range(56))]


def test_sparkline_has_a_baseline_of_zero(qapp) -> None:
    steady = stroke([30.0, 29.0, 30.0, 29.5])
    assert max(steady) <= 3, "a rate that changes little is a level line at the top"
    assert min(stroke([0.0, 0.0, 0.0])) >= 13, "none is on the ground"
    fell = stroke([30.0, 30.0, 0.0, 0.0])
    assert (min(fell) <= 3, max(fell) >= 13) == (True, True)
    assert max(stroke([30.0, 15.0])) <= 9, "half of it is half as high"
    assert min(stroke([-10.0, -10.0])) >= 13
    assert stroke([1.0, float("nan")]) == stroke([float("inf"), 2.0]) == []


def test_empty_state_button_runs_its_action(qtbot, theme: Theme) -> None:
    done: list[str] = []
    made = EmptyState(
        theme,
        "bot",
        "No robot",
        "Connect one.",
        [EmptyAction("Apply", lambda: done.append("used"), is_primary=True)],
    )
    shown(qtbot, made)
    QTest.mouseClick(made.findChildren(Button)[0], Qt.MouseButton.LeftButton)
    assert done == ["used"]
    made.set_actions([])
    assert made._buttons == []


def test_switch_is_toggled_with_space(qtbot, theme: Theme) -> None:
    theme.apply()
    switch = Switch(theme, "loud")
    shown(qtbot, switch)
    QTest.keyClick(switch, Qt.Key.Key_Space)
    assert switch.isChecked()
    assert theme.colour("accent").name() in colours(switch)


def test_combo_box_ignores_unknown_values(theme: Theme) -> None:
    choice = ComboBox(theme, [("en", "English"), ("fr", "French")], name="Language")
    choice.set_value("fr")
    choice.set_value("xx")
    assert choice.value == "fr"
    wheel(choice, 1)
    assert choice.value == "fr"


def test_status_item_without_text_is_hidden(qtbot, theme: Theme) -> None:
    holder = QWidget()
    item = StatusItem(theme, "lock", "This computer only")
    item.setParent(holder)
    shown(qtbot, holder)
    item.set("", "")
    assert item.isHidden()
    item.set("triangle-alert", "12 lost in 30 s", "warn")
    assert not item.isHidden()


def test_search_field_shows_its_shortcut_only_while_empty(qtbot, theme: Theme) -> None:
    field = SearchField(theme, "Filter", "/")
    field.resize(200, 28)
    shown(qtbot, field)
    key_cap = QRect(170, 0, 30, 28)
    empty = field.grab(key_cap).toImage()
    field.setText("x")
    with_text = field.grab(key_cap).toImage()
    assert with_text != empty
    without_key = SearchField(theme, "Filter")
    without_key.resize(200, 28)
    shown(qtbot, without_key)
    assert without_key.grab(key_cap).toImage() == with_text
    assert field.accessibleName() == "Filter"


@pytest.mark.parametrize("percent", [100, 150, 200])
def test_button_and_chip_fit_their_text_at_every_text_size(theme: Theme, percent: int) -> None:
    theme.set_text_percent(percent)
    button = Button(theme, "Use the virtual robot", "bot", size="large")
    font = QFontMetricsF(theme.font("button"))
    assert button.sizeHint().height() >= font.height()
    assert button.sizeHint().width() >= font.horizontalAdvance("Use the virtual robot") + 20
    chip = Chip(theme, "virtual, ready")
    assert chip.sizeHint().height() >= QFontMetricsF(theme.font("small")).height()


def test_empty_state_in_a_low_panel_hides_its_image(qtbot, theme: Theme) -> None:
    theme.apply()
    empty = EmptyState(theme, "eye", "No robot connected", "Connect a robot to see what it feels.")
    place = QWidget()
    qtbot.addWidget(place)
    empty.setParent(place)
    empty.resize(384, 98)
    place.show()
    title, text = (each for each in empty.findChildren(QLabel) if each.text())
    assert not empty._tile.isVisible()
    qtbot.waitUntil(lambda: title.geometry().bottom() <= text.mapTo(empty, QPoint(0, 0)).y())
    empty.resize(384, 300)
    assert empty._tile.isVisible()


def test_empty_state_in_a_very_low_panel_keeps_its_button_visible(qtbot, theme: Theme) -> None:
    theme.apply()
    step = EmptyAction("New variable", lambda: None)
    words = "A variable keeps a number, a text or a list, and shows here what it is while the program runs."
    empty = EmptyState(theme, "variable", "No variables yet", words, [step])
    place = QWidget()
    qtbot.addWidget(place)
    empty.setParent(place)
    empty.resize(384, 84)
    place.show()
    title, text = (each for each in empty.findChildren(QLabel) if each.text())
    button = empty.findChild(Button)
    qtbot.waitUntil(lambda: button.mapTo(empty, QPoint(0, button.height())).y() <= 84)
    assert not text.isVisible()
    assert title.toolTip() == words
    empty.resize(384, 300)
    qtbot.waitUntil(text.isVisible)
    assert title.toolTip() == ""


@pytest.mark.parametrize(("ratio", "thick"), [(1.0, 1), (1.25, 1), (1.5, 1), (2.0, 2)])
@pytest.mark.parametrize("edge", [Qt.Edge.TopEdge, Qt.Edge.BottomEdge, Qt.Edge.LeftEdge, Qt.Edge.RightEdge])
def test_hairline_has_the_same_thickness_at_every_position_and_scale(
    qapp, ratio: float, thick: int, edge: Qt.Edge
) -> None:
    for place in range(1, 9):
        image = QImage(60, 60, QImage.Format.Format_RGB32)
        image.setDevicePixelRatio(ratio)
        image.fill(QColor("white"))
        painter = QPainter(image)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        paint.hairline(painter, QRectF(place, place, 20, 20), edge, QColor("black"))
        painter.end()
        dark = [(x, y) for x in range(60) for y in range(60) if image.pixelColor(x, y).value() < 255]
        assert all(image.pixelColor(x, y) == QColor("black") for x, y in dark), "none is blurred"
        across = (
            {y for _x, y in dark} if edge in {Qt.Edge.TopEdge, Qt.Edge.BottomEdge} else {x for x, _y in dark}
        )
        assert len(across) == thick


def test_scroll_area_grows_with_longer_text(qtbot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    words = QLabel("short")
    words.setWordWrap(True)
    about = ContentScrollArea(words)
    column = QVBoxLayout(window)
    column.addWidget(QWidget(), 1)
    column.addWidget(about)
    window.resize(300, 300)
    window.show()
    before = about.height()
    words.setText("much longer words " * 8)
    qtbot.waitUntil(lambda: about.height() > before)
    qtbot.waitUntil(lambda: about.height() >= words.heightForWidth(about.viewport().width()))
    words.setText("short")
    qtbot.waitUntil(lambda: about.height() == before)


def test_tab_stops_exclude_the_popup_of_a_combo_box(qtbot) -> None:
    column = ScrollColumn("Rows")
    qtbot.addWidget(column)
    choice = QComboBox()
    choice.addItems(["left", "right"])
    dropped = choice.view()
    column.column.insertWidget(0, choice)  # a Qt warning would fail the test
    assert dropped.window() is not choice.window()
    assert tab_stops_of(choice) == [choice]


def test_steady_label_changes_its_size_hint_only_for_wider_or_empty_text(qtbot) -> None:
    label = SteadyLabel("body", "text")
    qtbot.addWidget(label)
    label.setText("15 fps (15 shown)")
    wide = label.sizeHint()
    label.setText("1/s")
    assert (label.text(), label.accessibleName(), label.sizeHint()) == ("1/s", "1/s", wide)
    label.setText("shown 15 of 15/s, or more")
    assert label.sizeHint().width() > wide.width()
    label.setText("")
    assert label.sizeHint().width() < 10
    assert label.text() == ""


def test_button_shows_ampersands_and_elides_text_that_does_not_fit(qtbot, theme: Theme) -> None:
    button, option = Button(theme, "Salt & pepper"), QStyleOptionButton()
    shown(qtbot, button)
    button.resize(button.sizeHint())
    button.initStyleOption(option)
    assert option.text == "Salt && pepper"
    button.resize(60, button.height())
    button.initStyleOption(option)
    assert option.text.endswith("…")
    assert button.text() == "Salt & pepper"


@pytest.mark.parametrize("kind", ["plain", "ghost", "primary", "run", "stop"])
def test_button_shows_that_it_is_pressed(qtbot, theme: Theme, kind: Kind) -> None:
    theme.apply()
    holder = QWidget()
    button = Button(theme, "Try", kind=kind, parent=holder)
    shown(qtbot, holder)
    pressed = theme.colour(BUTTON_COLOURS[kind].pressed or "").name()
    assert pressed not in colours(button)
    button.setDown(True)
    assert pressed in colours(button)


@pytest.mark.parametrize("kind", [CheckBox, Switch])
def test_check_box_shows_ampersands_and_elides_text_that_does_not_fit(
    qtbot, theme: Theme, kind: type[CheckBox]
) -> None:
    theme.apply()
    box, option = kind(theme, "Salt & pepper"), QStyleOptionButton()
    shown(qtbot, box)
    box.resize(box.sizeHint())
    box.initStyleOption(option)
    assert option.text == "Salt && pepper"
    assert not box.toolTip()
    box.resize(90, box.height())
    box.initStyleOption(option)
    assert option.text.endswith("…")
    assert "Salt" in box.toolTip()


@pytest.mark.parametrize("mode", ["light", "dark"])
def test_check_mark_and_knob_have_the_colours_of_the_theme(qtbot, theme: Theme, mode: Mode) -> None:
    theme.set_mode(mode)
    holder = QWidget()
    column = QVBoxLayout(holder)
    box, switch = CheckBox(theme, ""), Switch(theme, "")
    for each in (box, switch):
        column.addWidget(each)
    shown(qtbot, holder)
    accent, mark = theme.colour("accent").name(), theme.colour("onAccent").name()
    assert accent not in colours(box) | colours(switch)
    assert theme.colour("controlBorder").name() in colours(switch)
    for each in (box, switch):
        each.setChecked(True)
        assert {accent, mark} <= colours(each)
    switch.setEnabled(False)
    assert accent not in colours(switch)


def test_combo_box_elides_text_that_does_not_fit(qtbot, theme: Theme) -> None:
    theme.apply()
    choice, option = ComboBox(theme, [("a", "a text that doesn't fit")]), QStyleOptionComboBox()
    shown(qtbot, choice)
    choice.resize(choice.sizeHint())
    choice.initStyleOption(option)
    assert option.currentText == "a text that doesn't fit"
    choice.resize(90, choice.height())
    choice.initStyleOption(option)
    assert option.currentText.endswith("…")


@pytest.mark.parametrize("direction", [Qt.LayoutDirection.LeftToRight, Qt.LayoutDirection.RightToLeft])
def test_slider_is_filled_up_to_its_value(qtbot, theme: Theme, direction: Qt.LayoutDirection) -> None:
    theme.apply()
    holder = QWidget()
    holder.setLayoutDirection(direction)
    track = SliderTrack(theme, 100)
    track.setParent(holder)
    track.resize(200, track.sizeHint().height())
    track.setValue(75)
    shown(qtbot, holder)
    image, middle = track.grab().toImage(), track.height() // 2
    assert image.pixelColor(50, middle) == theme.colour("accent")
    assert image.pixelColor(180, middle) == theme.colour("borderStrong")


def test_alert_shows_the_colours_and_icon_of_its_status(qtbot, theme: Theme) -> None:
    theme.apply()
    row = AlertRow(theme)
    row.resize(300, 60)
    shown(qtbot, row)
    for status in ("error", "warn"):
        row.set_texts(status, "No master answers", "")
        values = theme.status(status)
        assert {theme.colour(str(values.tint)).name(), theme.colour(values.colour).name()} <= colours(row)


def test_icon_of_a_button_is_mirrored_in_a_right_to_left_layout(qtbot, theme: Theme) -> None:
    theme.apply()
    holder = QWidget()
    button = IconTextButton(theme, holder)
    shown(qtbot, holder)
    assert button.icon_is_left()
    holder.setLayoutDirection(Qt.LayoutDirection.RightToLeft)
    assert not button.icon_is_left()


class IconTextButton(Button):
    """Button whose icon has a colour of its own."""

    def __init__(self, theme: Theme, parent: QWidget) -> None:
        super().__init__(theme, "Try", "play", parent=parent)
        self.icon_role = "error"

    def icon_is_left(self) -> bool:
        image, red = self.grab().toImage(), self._theme.colour("error").name()
        columns = [
            x
            for x in range(image.width())
            for y in range(image.height())
            if image.pixelColor(x, y).name() == red
        ]
        return sum(columns) / len(columns) < image.width() / 2


def test_frame_of_a_field_shows_focus_and_invalid_text(qtbot, theme: Theme) -> None:
    theme.apply()
    holder = QWidget()
    field = LongTextField(theme, "Text")
    QVBoxLayout(holder).addWidget(field)
    shown(qtbot, holder)
    accent, error = theme.colour("accent").name(), theme.colour("error").name()
    assert accent not in colours(field)
    holder.activateWindow()
    field.setFocus()
    qtbot.waitUntil(lambda: accent in colours(field))
    field.set_invalid(is_invalid=True)
    assert field.is_invalid
    assert error in colours(field)


def test_icon_label_follows_the_theme(qtbot, theme: Theme) -> None:
    icon = IconLabel(theme, "check", "text")
    qtbot.addWidget(icon)
    before = icon.pixmap().toImage()
    theme.set_mode("dark")
    assert icon.pixmap().toImage() != before
    theme.set_text_percent(200)
    assert icon.pixmap().width() == 32 * icon.devicePixelRatioF()
