"""Bar below an image for brightness, contrast, colour map and value range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import exp, log

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from app.core.messages.image_style import COLOUR_MAPS, MAX_CONTRAST, PLAIN, PictureStyle
from app.core.messages.picture import Picture
from app.robots.description.typed_number import parse_number
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ComboBox, NumberEdit, ToggleButton, label
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.slider import SliderTrack
from nep.i18n import _, lazy

SLIDER_STEPS = 100
"""Number of slider steps on each side of the neutral middle."""
COLOUR_MAP_NAMES = {
    "grey": lazy("Grey"),
    "viridis": lazy("Viridis"),
    "turbo": lazy("Turbo"),
    "inferno": lazy("Inferno"),
    "jet": lazy("Jet"),
}
"""Displayed names of the colour maps."""


class _RangeEdit(NumberEdit):
    """Number field for an end of the value range, which formats numbers without trailing zeros."""

    def format_number(self, value: float) -> str:
        return f"{value:.7g}"


class StyleBar(QWidget):
    """Bar with display settings of an image; emits `changed` with the new `PictureStyle`.

    Args:
        picture: Returns the image shown, or None.
    """

    changed = Signal(object)

    def __init__(self, theme: Theme, picture: Callable[[], Picture | None]) -> None:
        super().__init__()
        self._picture = picture
        self._has_one_channel = True
        self.picture_style = PLAIN
        self.brightness = self._make_slider(theme, _("Brightness"), self._set_brightness)
        self.contrast = self._make_slider(theme, _("Contrast"), self._set_contrast)
        maps = [(name, _(COLOUR_MAP_NAMES[name])) for name in COLOUR_MAPS]
        names = [("", _("Default colours")), *maps]
        self.colour_map_choice = ComboBox(theme, names, name=_("Colour map"))
        self.colour_map_choice.activated.connect(
            lambda _at: self._apply(replace(self.picture_style, colour_map=self.colour_map_choice.value))
        )
        self.range_button = ToggleButton(theme, _("Custom range"), "ruler")
        self.range_button.toggled.connect(self._set_manual_range)
        self.low_field, self.high_field = (_RangeEdit(theme, None, None) for _end in range(2))
        for field, name in (
            (self.low_field, _("Value of the first colour")),
            (self.high_field, _("Value of the last colour")),
        ):
            field.setAccessibleName(name)
            field.setFixedWidth(92)
            field.number_entered.connect(lambda _value: self._apply_range())
        self.reset_button = Button(theme, _("Reset"), "undo-2", size="small")
        self.reset_button.clicked.connect(lambda: self._apply(PLAIN, updates_fields=True))
        flow = Flow(self, gap=8, row_gap=4)
        flow.setContentsMargins(12, 6, 12, 6)
        parts: tuple[QWidget, ...] = (
            label(_("Brightness"), "small", role="textSecondary"), self.brightness,
            label(_("Contrast"), "small", role="textSecondary"), self.contrast,
            self.colour_map_choice, self.range_button, self.low_field, self.high_field, self.reset_button,
        )  # fmt: skip
        for part in parts:
            flow.addWidget(part)
        self.show_style(PLAIN)

    def _make_slider(self, theme: Theme, name: str, on_change: Callable[[int], None]) -> SliderTrack:
        slider = SliderTrack(theme, 2 * SLIDER_STEPS)
        slider.setAccessibleName(name)
        slider.setMaximumWidth(120)
        slider.valueChanged.connect(on_change)
        slider.reset.connect(lambda: slider.setValue(SLIDER_STEPS))
        return slider

    def show_style(self, style: PictureStyle) -> None:
        """Show other settings without emitting `changed`."""
        self.picture_style = style
        slider_values = (
            (self.brightness, round(SLIDER_STEPS * (1 + style.brightness))),
            (self.contrast, round(SLIDER_STEPS * (1 + log(style.contrast) / log(MAX_CONTRAST)))),
        )
        for slider, value in slider_values:
            slider.blockSignals(True)
            slider.setValue(value)
            slider.blockSignals(False)
            slider.update()
        self.colour_map_choice.set_value(style.colour_map)
        has_range = style.low is not None and style.high is not None
        self.range_button.blockSignals(True)
        self.range_button.setChecked(has_range)
        self.range_button.blockSignals(False)
        for field, end in ((self.low_field, style.low), (self.high_field, style.high)):
            field.setVisible(has_range)
            if end is not None:
                field.show_number(end)

    def refresh(self) -> None:
        """Enable only the settings that affect the current image."""
        picture = self._picture()
        has_one_channel = picture is None or picture.has_one_channel
        if has_one_channel != self._has_one_channel:
            self._has_one_channel = has_one_channel
            for part in (self.colour_map_choice, self.range_button, self.low_field, self.high_field):
                part.setEnabled(has_one_channel)

    def _apply(self, style: PictureStyle, *, updates_fields: bool = False) -> None:
        if updates_fields:
            self.show_style(style)
        if style != self.picture_style or updates_fields:
            self.picture_style = style
            self.changed.emit(style)

    def _set_brightness(self, value: int) -> None:
        self._apply(replace(self.picture_style, brightness=value / SLIDER_STEPS - 1))

    def _set_contrast(self, value: int) -> None:
        self._apply(replace(self.picture_style, contrast=exp((value / SLIDER_STEPS - 1) * log(MAX_CONTRAST))))

    def _set_manual_range(self, is_enabled: bool) -> None:
        picture = self._picture()
        scale = picture.scale if picture is not None else None
        low, high = (scale.low, scale.high) if scale is not None else (0.0, 255.0)
        low, high = (low, high) if low < high else (low, low + 1)
        self._apply(
            replace(self.picture_style, low=low if is_enabled else None, high=high if is_enabled else None),
            updates_fields=True,
        )

    def _apply_range(self) -> None:
        try:
            low, high = (parse_number(field.text()) for field in (self.low_field, self.high_field))
        except ValueError:  # a field is incomplete; it marks itself
            return
        if low < high:
            self._apply(replace(self.picture_style, low=low, high=high))
