"""Field paths: where a value is in a message: ``pose.x[2]``, ``joints[*].position``.

A path is parsed once; then it only looks. A key that is no plain word stands in brackets as a JSON string,
as in ``people["first name"]``, and ``[*]`` means every element of a list. The value of a message that is no
object or list is called ``value``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final, Literal

from app.errors import CurveError
from nep.errors import nearest
from nep.i18n import _

EVERY: Final = "*"
"""The step that means every element of a list; as a key it would stand in brackets and quotes."""
MOST_STEPS, MOST_EVERY, MOST_FIELDS = 32, 65, 2000
LONGEST = 400
ALONE = "value"
_STEP = re.compile(
    r"""\.?(?P<name>[^.\[\]"\s]+)|\[(?P<index>-?\d{1,9})\]"""
    r"""|\[(?P<every>\*)\]|\[(?P<key>"(?:[^"\\]|\\.)*")\]"""
)
_PLAIN = re.compile(r"""[^.\[\]"\s,()+*/%^-]+\Z""")
"""Keys that are nothing to calculate: `head-yaw` would be a difference, so it is written `["head-yaw"]`."""

FieldKind = Literal["number", "state", "list"]


class Missing:
    """What a path finds where there is nothing."""

    def __repr__(self) -> str:
        """Its name."""
        return "MISSING"


MISSING: Final = Missing()


class Every:
    """The step ``[*]``."""

    def __repr__(self) -> str:
        """As it is written."""
        return "[*]"


ALL: Final = Every()
Step = str | int | Every


def is_list(value: object) -> bool:
    """Whether a value is a list; text and bytes are values."""
    return isinstance(value, Sequence) and not isinstance(value, (str, bytes, bytearray, memoryview))


@dataclass(frozen=True, slots=True)
class FieldPath:
    """The steps from a message to a value: keys, indexes, `ALL`."""

    steps: tuple[Step, ...]

    @classmethod
    def parse(cls, text: str) -> FieldPath:
        """The path that is written so. Raises `CurveError` that says where it can't be read."""
        steps: list[Step] = []
        at = 0
        while at < len(text):
            found = _STEP.match(text, at)
            bare = found is not None and found["name"] is not None and bool(steps) and text[at] != "."
            if found is None or bare or len(steps) >= MOST_STEPS or len(text) > LONGEST:
                raise CurveError(_("'{path}' is not a field path").format(path=text[:80]))
            steps.append(_step_of(found))
            at = found.end()
        if not steps:
            raise CurveError(_("the field after the topic is missing"))
        return cls(tuple(steps))

    @property
    def has_every(self) -> bool:
        """Whether it means several values."""
        return ALL in self.steps

    def __str__(self) -> str:
        """As people write it; `parse` reads it back."""
        written = "".join(_written(step) for step in self.steps)
        return written.removeprefix(".")

    def value_in(self, payload: object) -> object:
        """The value in a decoded message; `MISSING` when it has none there."""
        here = payload
        for step in self.steps:
            if type(here) is dict or isinstance(here, Mapping):  # which takes ten times as long to be asked
                here = here.get(step, MISSING)
            elif isinstance(step, int) and is_list(here):
                few: Sequence[object] = here  # type: ignore[assignment]
                here = few[step] if -len(few) <= step < len(few) else MISSING
            elif self.steps == (ALONE,) and not is_list(here):
                return here
            else:
                return MISSING
        return here

    def expanded(self, payload: object) -> list[FieldPath]:
        """The paths without `ALL` that a message has for it, 65 at most; itself when it has none.

        That is one more than a plot has curves, so that too many are told and not cut off.
        """
        if not self.has_every:
            return [self]
        place = self.steps.index(ALL)
        above = FieldPath(self.steps[:place]).value_in(payload) if place else payload
        count = min(len(above), MOST_EVERY) if is_list(above) else 0  # type: ignore[arg-type]
        found: list[FieldPath] = []
        for number in range(count):
            one = FieldPath((*self.steps[:place], number, *self.steps[place + 1 :]))
            found += one.expanded(payload)
        return found[:MOST_EVERY]


def _step_of(found: re.Match[str]) -> Step:
    if found["name"] is not None:
        return found["name"]
    if found["index"] is not None:
        return int(found["index"])
    if found["every"] is not None:
        return ALL
    try:
        key = json.loads(found["key"])
    except ValueError:
        raise CurveError(_("'{path}' is not a field path").format(path=found["key"][:80])) from None
    return str(key)


def _written(step: Step) -> str:
    if isinstance(step, Every):
        return "[*]"
    if isinstance(step, int):
        return f"[{step}]"
    return f".{step}" if _PLAIN.match(step) else f"[{json.dumps(step, ensure_ascii=False)}]"


@dataclass(frozen=True, slots=True)
class FieldFound:
    """A value of a message that can be plotted: a number, a state (text, yes or no), or a list of such."""

    path: FieldPath
    kind: FieldKind
    value: object
    count: int = 1


def fields_of(payload: object, most: int = MOST_FIELDS) -> Iterator[FieldFound]:
    """What of a message can be plotted, upper levels first; of a list the first elements and ``[*]``."""
    waiting: list[tuple[tuple[Step, ...], object]] = [((), payload)]
    if not isinstance(payload, Mapping) and not is_list(payload):
        waiting = [((ALONE,), payload)]
    told = 0
    while waiting and told < most:
        steps, here = waiting.pop(0)
        kind = kind_of_value(here)
        if kind is not None:
            told += 1
            count = len(here) if kind == "list" else 1  # type: ignore[arg-type]
            yield FieldFound(FieldPath((*steps, ALL) if kind == "list" else steps), kind, here, count)
        if len(steps) >= MOST_STEPS or len(waiting) > most:
            continue
        if isinstance(here, Mapping):
            named = ((key, below) for key, below in here.items() if isinstance(key, str))
            waiting += [((*steps, key), below) for key, below in islice(named, most)]
        elif is_list(here):
            waiting += [((*steps, place), below) for place, below in enumerate(islice(here, 4))]  # type: ignore[call-overload]


def kind_of_value(value: object) -> FieldKind | None:
    """How a value can be plotted; None for objects, bytes, null, and lists of anything but numbers."""
    if isinstance(value, (bool, str)):
        return "state"
    if isinstance(value, (int, float)):
        return "number"
    if is_list(value):
        few = list(islice(value, 8))  # type: ignore[call-overload]
        numbers = all(isinstance(each, (int, float)) and not isinstance(each, bool) for each in few)
        return "list" if few and numbers else None
    return None


def completed(text: str, known: Sequence[str]) -> str:
    """``text`` completed to the next dot, bracket or end in which all of ``known`` that begin so agree."""
    fitting = [each for each in known if each.startswith(text)]
    if not fitting:
        return text
    common = fitting[0]
    for each in fitting[1:]:
        while not each.startswith(common):
            common = common[:-1]
    ends = [place for place in range(len(text) + 1, len(common)) if common[place] in ".[/"]
    return common[: ends[0] + 1] if ends else common


def meant_field(path: FieldPath, payload: object) -> str | None:
    """The nearest field that a message does have, as it is written; None when none is near."""
    return nearest(str(path), [str(each.path) for each in fields_of(payload)])
