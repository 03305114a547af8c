"""Curve with its display settings (axis, style, visibility), and formatting of values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite

from app.core.series.curves import Curve
from app.core.series.field_path import MISSING
from app.core.series.formula import FieldSource
from app.ui.panels.watch.plot.curve_style import CurveStyle
from app.ui.text.numbers import group_digits
from nep.i18n import number

MINUS = "\u2212"


@dataclass(slots=True, eq=False)
class PlotCurve:
    """Curve with its display settings.

    Attributes:
        curve: Curve with its data.
        style: Style.
        is_on_right_axis: True for the right axis, False for the left one.
        is_hidden: True if the user has hidden the curve.
    """

    curve: Curve
    style: CurveStyle
    is_on_right_axis: bool = False
    is_hidden: bool = False

    @property
    def name(self) -> str:
        """Expression of the curve as typed by the user, which is also its key."""
        return self.curve.text

    def to_json(self) -> dict[str, object]:
        """Return the state of the curve as a JSON object, which is saved with the layout."""
        source = self.curve.source
        state: dict[str, object] = {
            "text": self.name,
            "right": self.is_on_right_axis,
            "hidden": self.is_hidden,
            "colour": self.style.colour,
            "pattern": self.style.pattern,
        }
        if isinstance(source, FieldSource):
            state |= {"topic": source.topic, "path": str(source.path)}
        return state


def parse_style(saved: Mapping[str, object], default: CurveStyle) -> CurveStyle:
    """Return the style from a saved state.

    Args:
        saved: State from the layout.
        default: Style whose colour or pattern replaces an invalid entry.
    """
    colour, pattern = saved.get("colour"), saved.get("pattern")
    return CurveStyle(
        colour % 6 if isinstance(colour, int) else default.colour,
        pattern % 4 if isinstance(pattern, int) else default.pattern,
    )


def value_text(value: object) -> str:
    """Format a number, boolean or text (at most 60 characters) for the legend; "" for any other value."""
    if value is MISSING or value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        if abs(value) < 10**15:
            return group_digits(value).replace("-", MINUS)
        return str(value).replace("-", MINUS) if abs(value) < 10**21 else number_text(_to_float(value))
    if isinstance(value, float):
        return number_text(value)
    return value[:60] if isinstance(value, str) else ""


def number_text(value: float) -> str:
    """Format a number, such as 0.0042, 1.284, 128.4, 12840, 2.1e+09, ∞ or NaN."""
    if not isfinite(value):
        return {"inf": "∞", "-inf": f"{MINUS}∞"}.get(str(value), "NaN")
    size = abs(value)
    if size and not 1e-4 <= size < 1e7:
        return number(value, ".1e").replace("-", MINUS)
    digits = 0 if not size else 4 if size < 0.1 else 3 if size < 100 else 1 if size < 10_000 else 0
    text = number(round(value, digits) + 0.0, f".{digits}f")
    return text.replace("-", MINUS)


def _to_float(value: int) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")
