"""Switch with two states."""

from __future__ import annotations

from app.ui.theme.style_sheet import SWITCH_WIDTH
from app.ui.theme.theme import Theme
from app.ui.widgets.inputs.check_box import CheckBox


class Switch(CheckBox):
    """Switch with two states and a label."""

    text_kind, gap, min_height, padding = "bodyLarge", 10, 24, 0

    def __init__(self, theme: Theme, text: str, on: bool = False) -> None:
        super().__init__(theme, text, on)
        self.setProperty("focusRadius", 10)

    def box_width(self) -> float:
        return SWITCH_WIDTH
