"""Hostile values for the tests of every receiver of external data, in robots, Studio and nep.

All are bytes or fragments of JSON, because an encoder can't produce some of them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

LEVELS = 1_000
LONG_NAME_BYTES = 5_000_000
Message = Mapping[str, object] | list[object]
_PLACEHOLDER = "\x00hostile\x00"

VALUES: Mapping[str, str] = {
    "null": "null",
    "true": "true",
    "zero": "0",
    "negative": "-1",
    "2^64": str(2**64),
    "-2^63-1": str(-(2**63) - 1),
    "400 digits": "9" * 400,
    "5000 digits": "9" * 5_000,
    "1e308": "1e308",
    "1e999": "1e999",
    "-1e999": "-1e999",
    "NaN": "NaN",
    "empty text": '""',
    "lone surrogate": r'"\ud800"',
    "control characters": json.dumps("\x1b]0;x\x07\u202e\u2028\x00\n"),
    "path": '"../../etc/passwd"',
    "braces": '"{0} {name} %s %n {0.__class__}"',
    "long text": json.dumps("n" * 20_000),
    "empty list": "[]",
    "empty map": "{}",
    "list of lists": "[[[[]]], [1, null], {}]",
    "map of maps": '{"": {"a": {"b": null}}, "__proto__": []}',
    "lone surrogate as name": r'{"\udc80": 1}',
    "60 levels": "[" * 50 + "{}" + "]" * 50,
    "1000 lists": "[" * LEVELS + "]" * LEVELS,
    "1000 maps": '{"a":' * LEVELS + "1" + "}" * LEVELS,
    "many names": json.dumps({f"text{number}": 1 for number in range(2_000)}),
    "long list": json.dumps(list(range(5_000))),
}
"""Fragments of JSON by description."""

INVALID_PAYLOADS: tuple[bytes, ...] = (
    *(each.encode() for each in VALUES.values()),
    b"",
    b"{",
    b"\xff\xfe\x00",
    b"[" * 100_000,
    json.dumps("n" * LONG_NAME_BYTES).encode(),
    json.dumps({"n" * LONG_NAME_BYTES: 1}).encode(),
)
"""Complete payloads that are not a valid message for any receiver."""


def in_every_field(message: Message, share: int = 1) -> Iterator[bytes]:
    """Yield a valid message as JSON with hostile values in each of its fields, including nested ones.

    Each field gets all values, or every `share`-th value, starting at a different one in each field.
    """
    hole = json.dumps(_PLACEHOLDER)
    for number, place in enumerate(_places(message)):
        prepared = json.dumps(_replaced(message, place, _PLACEHOLDER))
        for value in list(VALUES.values())[number % share :: share]:
            yield prepared.replace(hole, value).encode()


def with_long_name(message: Mapping[str, object]) -> Iterator[bytes]:
    """Yield a valid message with a text of 5 MB in each of its fields."""
    for name in message:
        yield json.dumps({**message, name: "n" * LONG_NAME_BYTES}).encode()


def payloads(*messages: Message, share: int = 1) -> Iterator[bytes]:
    """Yield every hostile payload for a receiver of these messages. `share` as in `in_every_field`."""
    yield from INVALID_PAYLOADS
    for message in messages:
        yield from in_every_field(message, share)


def _places(value: object, above: tuple[object, ...] = ()) -> Iterator[tuple[object, ...]]:
    items: Iterator[tuple[object, object]] = iter(())
    if isinstance(value, Mapping):
        items = iter(value.items())
    elif isinstance(value, list):
        items = iter(enumerate(value))
    for name, item in items:
        yield (*above, name)
        yield from _places(item, (*above, name))


def _replaced(value: object, place: tuple[object, ...], new: object) -> object:
    if not place:
        return new
    name, *below = place
    if isinstance(value, Mapping):
        return {
            key: _replaced(item, tuple(below), new) if key == name else item for key, item in value.items()
        }
    assert isinstance(value, list)
    return [_replaced(item, tuple(below), new) if at == name else item for at, item in enumerate(value)]
