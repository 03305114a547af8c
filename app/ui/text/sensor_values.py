"""Formatting of sensor values for the rows of a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeGuard

from app.robots.description.description import DataField, Sensor
from nep.i18n import _, number
from nep.text import bounded_str

MINUS = "\u2212"
_MAX_NAMES = 20


@dataclass(frozen=True, slots=True)
class ReadingText:
    """Formatted sensor value.

    Attributes:
        value: Value, shown in bold on the right.
        details: Details, shown in the middle.
        fraction: Position in the range (0 to 1), shown as a bar, or None.
    """

    value: str = ""
    details: str = ""
    fraction: float | None = None


def reading_text(sensor: Sensor, value: object) -> ReadingText:
    """Format the newest value of a sensor; all texts are empty if the value is None."""
    if value is None:
        return ReadingText()
    if sensor.kind == "boolean" or isinstance(value, bool):
        return ReadingText(yes_no_text(value))
    if sensor.kind == "detections" and isinstance(value, Mapping):
        return _detections_text(value)
    if isinstance(value, Mapping):
        return _object_text(sensor, value)
    if isinstance(value, (int, float)):
        return ReadingText(quantity_text(value, sensor.unit), fraction=_fraction(sensor, value))
    if isinstance(value, str):
        title = next((choice.title for choice in sensor.choices if choice.value == value), value)
        return ReadingText(title if sensor.kind == "choice" else f"“{title}”" if title else "")
    if isinstance(value, Sequence):
        return ReadingText(str(len(value)), ", ".join(_item_name(item) for item in value))
    return ReadingText(str(value))


def yes_no_text(value: object) -> str:
    """Return the translated "yes" or "no" for the truth value of an object."""
    return _("yes") if value else _("no")


def quantity_text(value: float, unit: str | None) -> str:
    """Format a number with a suitable number of decimals, such as "0.82 m", "84 %" or "31°".

    Args:
        value: Number.
        unit: Unit to append, or None.
    """
    if isinstance(value, int) or float(value).is_integer():
        text = f"{value:.0f}"
    elif abs(value) < 10:
        text = number(value, ".2f")
    else:
        text = number(value, ".1f" if abs(value) < 100 else ".0f")
    text = text.replace("-", MINUS)
    if not unit:
        return text
    return f"{text}{unit}" if unit.startswith("°") else f"{text} {unit}"


def _fraction(sensor: Sensor, value: float) -> float | None:
    low, high = sensor.minimum, sensor.maximum
    if low is None or high is None or high <= low:
        return None
    return min(1.0, max(0.0, (value - low) / (high - low)))


def _detections_text(value: Mapping[str, object]) -> ReadingText:
    items = value.get("items")
    detections = [item for item in items if isinstance(item, Mapping)] if isinstance(items, list) else []
    count = value.get("count")
    name = value.get("name")
    names = (
        bounded_str(name)
        if name
        else ", ".join(bounded_str(item.get("name", "")) for item in detections[:_MAX_NAMES])
    )
    return ReadingText(str(count if isinstance(count, int) else len(detections)), names)


def _object_text(sensor: Sensor, value: Mapping[str, object]) -> ReadingText:
    # Fields with the same unit are combined ("1.3, 0.3 m"); others follow ("facing 31°").
    fields = sensor.fields or tuple(DataField(str(name), str(name), "number") for name in value)
    values = [(field, value.get(field.name)) for field in fields]
    numbers = [(field, measured) for field, measured in values if _is_number(measured)]
    if not numbers:
        return ReadingText(
            "",
            ", ".join(
                f"{field.title} {field_value}" for field, field_value in values if field_value is not None
            ),
        )
    unit = numbers[0][0].unit
    same_unit_texts = [
        number(measured, ".1f").replace("-", MINUS) for field, measured in numbers if field.unit == unit
    ]
    other_unit_values = [(field, measured) for field, measured in numbers if field.unit != unit]
    details = ", ".join(
        f"{field.title} {quantity_text(round(measured), field.unit)}" for field, measured in other_unit_values
    )
    return ReadingText(f"{', '.join(same_unit_texts)}{f' {unit}' if unit else ''}", details)


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _item_name(item: object) -> str:
    return bounded_str(item.get("name", item) if isinstance(item, Mapping) else item)
