"""Shapes of typed messages' values: what JSON has for a type, what Python has, and what is wrong with one.

`nep.messages.typed` makes them of annotations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date, datetime, time
from enum import Enum, Flag
from typing import Any

from nep.i18n import _, listed
from nep.text import escaped, shortened

__all__ = [
    "ANYTHING",
    "SCALARS",
    "Misfit",
    "ValueShape",
    "enum_shape",
    "list_shape",
    "literal_shape",
    "map_shape",
    "missing",
    "shown",
    "tuple_shape",
    "union_shape",
    "wrong",
]

_LEAST, _MOST = -(1 << 63), (1 << 64) - 1
"""Whole numbers that JSON carries here."""
_LONGEST = 100
"""Letters of a key, or of a value, in a sentence."""


class Misfit(Exception):  # noqa: N818 - never seen by a caller
    """A value that does not fit, and why. `steps` lead to it, the last one first."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        self.steps: list[str] = []
        super().__init__(reason)

    def inside(self, name: object) -> Misfit:
        """Itself, now told of the value that has the misfit in its field `name`."""
        self.steps.append(f".{escaped(shortened(str(name), _LONGEST))}")
        return self

    @property
    def place(self) -> str:
        """Where in the payload it is, such as "pose.position.x" or "joints[3]"; empty for the whole."""
        return "".join(reversed(self.steps)).removeprefix(".")

    @property
    def sentence(self) -> str:
        """Where it is, and why."""
        place = self.place or _("it")
        return f"{place} {self.reason}"


class ValueShape:
    """How values of one type are read and written.

    Made empty and filled later, because a dataclass may have fields of its own type. `read` makes a value of
    what JSON has, `write` the other way round; both raise `Misfit`.
    """

    __slots__ = ("_say", "as_it_is", "forms", "name", "read", "write")

    read: Callable[[Any], Any]
    write: Callable[[Any], Any]

    def __init__(
        self,
        name: str,
        as_it_is: type | None = None,
        forms: Iterable[type] = (),
        say: Callable[[], str] | None = None,
    ) -> None:
        self.name = name
        self.forms = frozenset(forms) if as_it_is is None else frozenset({as_it_is})
        """What its values are in JSON, as types of Python; none: anything."""
        self.as_it_is = as_it_is
        """Values of just this type are read as they are."""
        self._say = say

    @property
    def says(self) -> str:
        """What to give, such as "a 'float'", in the language of now."""
        return _("a '{name}'").format(name=self.name) if self._say is None else self._say()


def wrong(value: object, says: str) -> Misfit:
    """That a value is of a wrong type."""
    return Misfit(_("is a '{kind}'; give {wanted}").format(kind=type(value).__name__, wanted=says))


def missing(shape: ValueShape) -> Misfit:
    """That there is none."""
    return Misfit(_("is missing; give {wanted}").format(wanted=shape.says))


def shown(value: object) -> str:
    """As a sentence shows it."""
    return escaped(shortened(repr(value), _LONGEST))


# ---- numbers and words


def _of_numpy(value: object) -> object:
    """Numbers and arrays of numpy as Python's own."""
    to_list = getattr(value, "tolist", None)
    return to_list() if callable(to_list) else value


def _float() -> ValueShape:
    shape = ValueShape("float", float)

    def read(value: object) -> float:
        if isinstance(value, float):
            return value
        if value is None:
            return math.nan
        return write(value)

    def write(value: object) -> float:
        if isinstance(value, float):
            return float(value)
        plain = value if isinstance(value, int) else _of_numpy(value)
        if isinstance(plain, int | float) and not isinstance(plain, bool):
            try:
                return float(plain)
            except OverflowError:
                raise Misfit(_("is too large; give {wanted}").format(wanted=shape.says)) from None
        raise wrong(value, shape.says)

    shape.read, shape.write = read, write
    return shape


def _int() -> ValueShape:
    shape = ValueShape("int", int)

    def read(value: object) -> int:
        if isinstance(value, int) and not isinstance(value, bool):
            return value
        raise wrong(value, shape.says)

    def write(value: object) -> int:
        plain = value if isinstance(value, int) else _of_numpy(value)
        if not isinstance(plain, int) or isinstance(plain, bool):
            raise wrong(value, shape.says)
        if not _LEAST <= plain <= _MOST:
            raise Misfit(_("is beyond 64 bits; give {wanted}").format(wanted=shape.says))
        return int(plain)

    shape.read, shape.write = read, write
    return shape


def _str() -> ValueShape:
    shape = ValueShape("str", str)

    def read(value: object) -> str:
        if isinstance(value, str):
            return value
        raise wrong(value, shape.says)

    def write(value: object) -> str:
        if not isinstance(value, str):
            raise wrong(value, shape.says)
        if not value.isascii():
            _check_letters(value)
        return str(value)

    shape.read, shape.write = read, write
    return shape


def _check_letters(value: str) -> None:
    try:
        value.encode("utf-8")
    except UnicodeEncodeError:
        raise Misfit(_("holds half of a surrogate pair; give whole letters")) from None


def _bool() -> ValueShape:
    shape = ValueShape("bool", bool)

    def both(value: object) -> bool:
        plain = value if isinstance(value, bool) else _of_numpy(value)
        if isinstance(plain, bool):
            return plain
        raise wrong(value, shape.says)

    shape.read = shape.write = both
    return shape


def _none() -> ValueShape:
    shape = ValueShape("None", forms={type(None)}, say=lambda: "None")

    def both(value: object) -> None:
        if value is not None:
            raise wrong(value, shape.says)

    shape.read = shape.write = both
    return shape


def _anything() -> ValueShape:
    shape = ValueShape("Any")

    def both(value: object) -> object:
        return value

    shape.read = shape.write = both
    return shape


def _moment(kind: type[datetime | date | time]) -> ValueShape:
    shape = ValueShape(kind.__name__, forms={str})

    def is_one(value: object) -> bool:
        return isinstance(value, kind) and (kind is not date or not isinstance(value, datetime))

    def read(value: object) -> object:
        if is_one(value):  # msgpack has them
            return value
        if not isinstance(value, str):
            raise wrong(value, _("text such as {example}").format(example=_EXAMPLES[kind]))
        whole = f"{value[:-1]}+00:00" if value.endswith("Z") else value  # Python 3.10 does not know Z
        try:
            return kind.fromisoformat(whole)
        except ValueError:
            raise Misfit(
                _("is {value}; give text such as {example}").format(
                    value=shown(value), example=_EXAMPLES[kind]
                )
            ) from None

    def write(value: Any) -> str:  # noqa: ANN401 - checked here
        if not is_one(value):
            raise wrong(value, shape.says)
        return str(value.isoformat())

    shape.read, shape.write = read, write
    return shape


_EXAMPLES: Mapping[type, str] = {
    datetime: "'2026-01-31T12:00:00+00:00'",
    date: "'2026-01-31'",
    time: "'12:00:00'",
}
ANYTHING = _anything()
SCALARS: Mapping[Any, ValueShape] = {
    float: _float(),
    int: _int(),
    str: _str(),
    bool: _bool(),
    None: _none(),
    type(None): _none(),
    Any: ANYTHING,
    object: ANYTHING,
    **{each: _moment(each) for each in (datetime, date, time)},
}


# ---- one of several


def _is_same(value: object, allowed: object) -> bool:
    """1 is not True, and neither is 1.0; a float may have come as a whole number."""
    if value != allowed or isinstance(value, bool) is not isinstance(allowed, bool):
        return False
    return isinstance(value, type(allowed)) or isinstance(allowed, float)


def literal_shape(values: Sequence[object]) -> ValueShape | None:
    """One of these; None when one of them has no form."""
    if not all(
        (each is None or isinstance(each, str | int)) and not isinstance(each, Enum) for each in values
    ):
        return None
    forms = map(type, values)
    shape = ValueShape("Literal", forms=forms, say=lambda: listed([repr(each) for each in values], "or"))

    def both(value: object) -> object:
        for each in values:
            if _is_same(value, each):
                return each
        raise Misfit(_("is {value}; give {wanted}").format(value=shown(value), wanted=shape.says))

    shape.read = shape.write = both
    return shape


def enum_shape(kind: type[Enum]) -> ValueShape | None:
    """A member, as its value; None when a value has no form."""
    members = list(kind)
    if not all(isinstance(each.value, str | int | float | None) for each in members):
        return None
    shape = ValueShape(kind.__name__, forms=(type(each.value) for each in members))
    is_flag = issubclass(kind, Flag)

    def read(value: object) -> object:
        for each in members:
            if _is_same(value, each.value):
                return each
        if is_flag and isinstance(value, int) and not isinstance(value, bool):
            try:
                return kind(value)
            except ValueError:
                pass
        wanted = shape.says if is_flag else listed([repr(each.value) for each in members], "or")
        raise Misfit(_("is {value}; give {wanted}").format(value=shown(value), wanted=wanted))

    def write(value: object) -> object:
        if not isinstance(value, kind):
            raise wrong(value, shape.says)
        return value.value

    shape.read, shape.write = read, write
    return shape


def union_shape(shapes: Sequence[ValueShape]) -> ValueShape | None:
    """The first of these that fits; None before all others, because null is that before it is NaN.

    None when two of them are the same in JSON: nobody could tell which one was meant.
    """
    forms = [form for each in shapes for form in each.forms]
    if len(forms) > len(set(forms)):
        return None
    none = SCALARS[None]
    others = [each for each in shapes if each.name != none.name]
    others.sort(key=lambda each: float in each.forms)  # which takes whole numbers, too
    nones = [none] if len(others) < len(shapes) else []
    ordered = [*nones, *others]
    shape = ValueShape(
        "Union", forms=forms, say=lambda: listed([each.says for each in (*others, *nones)], "or")
    )

    def first(value: object, ways: Sequence[Callable[[Any], Any]]) -> object:
        misfit = None
        for way in ways:
            try:
                return way(value)
            except Misfit as found:
                misfit = found
        if misfit is not None and misfit.steps and len(others) == 1:
            raise misfit  # it says what is wrong inside
        raise wrong(value, shape.says)

    # Asked when they are used: a dataclass may be filled later.
    shape.read = lambda value: first(value, [each.read for each in ordered])
    shape.write = lambda value: first(value, [each.write for each in ordered])
    return shape


# ---- several of one kind


def _each(way: Callable[[Any], Any], values: Iterable[Any], first: int = 0) -> list[Any]:
    made: list[Any] = []
    try:
        for each in values:
            made.append(way(each))  # noqa: PERF401 - its length says which one it was
    except Misfit as misfit:
        misfit.steps.append(f"[{first + len(made)}]")
        raise
    return made


def _items(value: object, says: str) -> list[Any] | tuple[Any, ...]:
    plain = value if isinstance(value, list | tuple) else _of_numpy(value)
    if not isinstance(plain, list | tuple):
        raise wrong(value, says)
    return plain


def list_shape(item: ValueShape, kind: type) -> ValueShape:
    """Any number of `item`; `kind` is list or tuple."""
    shape = ValueShape(kind.__name__, forms={list})
    exact = {item.as_it_is} - {None}

    def read(value: object) -> object:
        values = _items(value, shape.says)
        # Thousands of numbers at once; a list may be another reader's, too.
        made = values if exact and set(map(type, values)) <= exact else _each(item.read, values)
        return kind(made)

    def write(value: object) -> object:
        values = _items(value, shape.says)
        if item.as_it_is is float and set(map(type, values)) <= exact:
            return list(values)
        return _each(item.write, values)

    shape.read, shape.write = read, write
    return shape


def tuple_shape(items: Sequence[ValueShape]) -> ValueShape:
    """Just these, in their order."""
    shape = ValueShape("tuple", forms={list}, say=lambda: _("{count} values").format(count=len(items)))

    def each(value: object, ways: Sequence[Callable[[Any], Any]]) -> list[Any]:
        values = _items(value, shape.says)
        if len(values) != len(ways):
            raise Misfit(_("has {count} values; give {wanted}").format(count=len(values), wanted=shape.says))
        made: list[Any] = []
        for way, part in zip(ways, values, strict=True):
            made += _each(way, (part,), len(made))
        return made

    shape.read = lambda value: tuple(each(value, [item.read for item in items]))
    shape.write = lambda value: each(value, [item.write for item in items])
    return shape


def map_shape(item: ValueShape) -> ValueShape:
    """Names, and an `item` for each."""
    shape = ValueShape("dict", forms={dict})
    word = SCALARS[str]

    def each(value: object, way: Callable[[Any], Any]) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise wrong(value, shape.says)
        made: dict[str, Any] = {}
        for key, part in value.items():
            try:
                made[word.write(key)] = way(part)
            except Misfit as misfit:
                raise misfit.inside(key) from misfit.__cause__
        return made

    shape.read = lambda value: each(value, item.read)
    shape.write = lambda value: each(value, item.write)
    return shape
