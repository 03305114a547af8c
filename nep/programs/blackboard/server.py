"""BlackboardServer: one blackboard that other programs ask, in any language. `nep blackboard` runs one.

`/NAME/changes` is a topic: a map with "blackboard", "key", "value", "cause" and what is known of the value.
`NAME/get` is asked with a "key", and answers "found", "value" and "age_s"; or with a "pattern", and answers
"entries", and how many "more" there are; "max_age_s" leaves out what is older. `NAME/set` takes a "key" and
its "value", or a map "values", and "lives_s". `NAME/keys` takes a "pattern", and answers "keys" and "more".

What cannot be done is refused: the caller gets the sentence as `ServiceError`. NaN is `null`, as in all JSON.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import orjson

from nep.errors import BadKeyError, NepError
from nep.i18n import _
from nep.messages.codecs import numpy_option
from nep.nodes.node import Node
from nep.programs.blackboard.board import Blackboard, BlackboardChange, BlackboardEntry
from nep.system.arguments import seconds
from nep.text import bounded_str

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["DEFAULT_NAME", "MOST_ENTRIES", "BlackboardServer", "service_of"]

DEFAULT_NAME = "blackboard"
MOST_ENTRIES = 10_000
"""An answer has so many at most, and tells how many more there are."""
_MOST_ANSWER_BYTES = 32 * 2**20


def service_of(name: str, what: str) -> str:
    """The service of a blackboard of this name: `what` is "get", "set" or "keys"."""
    return f"{name}/{what}"


class BlackboardServer:
    """Tells the changes of `board`, and answers for it, in the thread that spins `node`. A context manager.

    Raises as `Node.new_pub` and `Node.new_server` do.
    """

    def __init__(self, node: Node, board: Blackboard, name: str = DEFAULT_NAME) -> None:
        self._board = board
        self._name = name
        self._changes = node.new_pub(f"/{name.lstrip('/')}/changes", "json")
        board.ignore(self._changes.id)
        self._servers = [
            node.new_server(service_of(name, what), answer)
            for what, answer in (("get", self._get), ("set", self._set), ("keys", self._keys))
        ]
        self._end = board.on_change("**", self._tell)

    def _tell(self, change: BlackboardChange) -> None:
        told = {"blackboard": self._name, "cause": change.cause, **_as_map(change.entry)}
        if change.is_gone:
            told["value"] = None
        self._changes.publish(told)

    def _get(self, request: object) -> object:
        asked = _request(request)
        max_age_s = seconds("max_age_s", asked.get("max_age_s"))
        if "key" not in asked:
            return self._entries(_text(asked, "pattern", "**"), math.inf if max_age_s is None else max_age_s)
        key = _text(asked, "key")
        missing = object()
        value = self._board.get(key, missing, max_age_s=max_age_s)
        if value is missing:
            return {"found": False, "value": asked.get("default"), "age_s": None}
        return {"found": True, "value": _sendable(value), "age_s": _finite(self._board.age_s(key))}

    def _entries(self, pattern: str, max_age_s: float) -> object:
        young = [each for each in self._board.snapshot(pattern).values() if each.age_s <= max_age_s]
        entries: list[object] = []
        room = _MOST_ANSWER_BYTES
        for each in young[:MOST_ENTRIES]:
            entry = _as_map(each)
            room -= len(orjson.dumps(entry, option=orjson.OPT_NON_STR_KEYS | numpy_option()))
            if room < 0 and entries:
                break
            entries.append(entry)
        return {"entries": entries, "more": len(young) - len(entries)}

    def _set(self, request: object) -> object:
        asked = _request(request)
        lives_s = seconds("lives_s", asked.get("lives_s"))
        if "key" in asked and "value" in asked:
            values: Mapping[object, object] = {_text(asked, "key"): asked["value"]}
        else:
            given = asked.get("values")
            if not isinstance(given, Mapping) or not given:
                raise NepError(_("nothing is to be set; give 'key' and 'value', or a map 'values'"))
            values = given
        for key, value in values.items():
            self._board.put(key if isinstance(key, str) else bounded_str(key), value, lives_s=lives_s)
        return {"set": len(values)}

    def _keys(self, request: object) -> object:
        found = self._board.keys(_text(_request(request), "pattern", "**"))
        return {"keys": found[:MOST_ENTRIES], "more": max(0, len(found) - MOST_ENTRIES)}

    def close(self) -> None:
        """Tell and answer no more; the board stays. May be called twice."""
        self._end()
        for server in self._servers:
            server.close()
        self._changes.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def _request(request: object) -> Mapping[object, object]:
    if not isinstance(request, Mapping):
        raise NepError(
            _("a blackboard is asked with a map, such as {example}").format(example='{"key": "human.1"}')
        )
    return request


def _text(asked: Mapping[object, object], field: str, default: str | None = None) -> str:
    value = asked.get(field, default)
    if not isinstance(value, str):
        raise BadKeyError(bounded_str(value), _("give a text such as 'human.1.position'"))
    return value


def _as_map(entry: BlackboardEntry) -> dict[str, object]:
    """For others, as JSON has it."""
    return {
        "key": entry.key,
        "value": _sendable(entry.value),
        "age_s": entry.age_s,
        "age_by": entry.age_by,
        "source": entry.source,
        "robot": entry.robot,
        "left_s": _finite(entry.left_s),
    }


def _sendable(value: object) -> object:
    """`value` itself when JSON has it, else how Python writes it: one value must not hide all others."""
    try:
        orjson.dumps(value, option=orjson.OPT_NON_STR_KEYS | numpy_option())
    except (TypeError, ValueError, RecursionError):
        try:
            return ascii(value)
        except Exception:  # noqa: BLE001 - a value may be of any class, or have more digits than are written
            return type(value).__name__
    return value


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
