"""Structural mutations of JSON and msgpack: values are replaced, removed, repeated or moved.

Random changes of bytes mostly produce invalid JSON, which never reaches the code behind the decoder.
"""

from __future__ import annotations

import json
import math
from random import Random

from nep.messages.packing import pack, unpack
from tests.fuzz.target import SEPARATOR

EDGES: tuple[object, ...] = (
    *(None, True, False, 0, 1, -1, 2, 255, 256, 2**31, 2**32 - 1, 2**53 + 1, 2**63 - 1, 2**63, 2**64 - 1),
    *(-(2**63), 10**25, 10**400, 0.0, -0.0, 0.5, 1e-320, 1e308, math.nan, math.inf, -math.inf),
    *("", " ", "a", "ñ", "\ud800", "\0", "\x1b[2J", "\u202e", "a.b", "/a/b", "*", "**", "{}", "x" * 300),
    *("127.0.0.1:0", "tcp://127.0.0.1:5000"),
    *([], {}, [[]], [None], {"": None}, {"a": {"b": []}}, [1, "a", None], [0] * 300),
)
DEEP = (60, 400, 2_000)


def mutated(data: bytes, chance: Random) -> bytes | None:
    """Return `data` with its decoded value changed in a few places, or None if `data` can't be decoded."""
    parts = data.split(SEPARATOR)
    at = chance.randrange(len(parts))
    try:
        value, write = json.loads(parts[at]), _json
    except (ValueError, RecursionError):
        try:
            value, write = unpack(parts[at]), pack
        except ValueError:
            return None
    for _time in range(chance.choice((1, 1, 1, 2, 3))):
        value = _changed(value, chance)
    try:
        parts[at] = write(value)
    except (ValueError, RecursionError):
        return None
    return SEPARATOR.join(parts)


def _json(value: object) -> bytes:
    return json.dumps(value, default=str).encode()


def _changed(value: object, chance: Random) -> object:
    """Return a copy of a value with one random change."""
    if isinstance(value, dict) and value and chance.random() < 0.85:
        return _changed_map(value, chance)
    if isinstance(value, list) and value and chance.random() < 0.85:
        at = chance.randrange(len(value))
        new = list(value)
        what = chance.random()
        if what < 0.7:
            new[at] = _changed(value[at], chance)
        elif what < 0.8:
            del new[at]
        else:
            new.insert(chance.randrange(len(value) + 1), value[at])
        return new
    return _other(value, chance)


def _changed_map(value: dict[object, object], chance: Random) -> dict[object, object]:
    key = chance.choice([*value])
    what = chance.random()
    new = dict(value)
    if what < 0.75:
        new[key] = _changed(value[key], chance)
    elif what < 0.85:
        del new[key]
    elif what < 0.95:
        new[chance.choice([*value])] = value[key]
    else:
        new[chance.choice(("", "\ud800", "a" * 300, f"{key}x"))] = value[key]
    return new


def _other(value: object, chance: Random) -> object:
    what = chance.random()
    if isinstance(value, str) and value and what < 0.3:
        at = chance.randrange(len(value))
        return value[:at] + chance.choice(("", "\ud800", "\n", "/", ".", value)) + value[at:]
    if isinstance(value, int | float) and not isinstance(value, bool) and what < 0.3:
        return value + chance.choice((1, -1, 1000)) if abs(value) < 2**70 else 0
    if what < 0.35:
        deep: object = value
        for _level in range(chance.choice(DEEP)):
            deep = [deep]
        return deep
    return chance.choice(EDGES)
