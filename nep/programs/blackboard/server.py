"""Blackboard server for programs in any language, used by `nep blackboard`.

Changes are published on the topic `/NAME/changes` as maps with "blackboard", "key", "value", "cause" and
details of the value. The services are:

- `NAME/get` takes "key" and replies with "found", "value" and "age_s"; or takes "pattern" and replies with
  "entries" and the number of omitted entries, "more". "max_age_s" excludes older values.
- `NAME/set` takes "key" and "value", or a map "values"; "lives_s" is optional.
- `NAME/keys` takes "pattern" and replies with "keys" and "more".

For an invalid request, the caller gets a `ServiceError`. NaN is sent as `null`, because JSON lacks NaN.
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
from nep.system.arguments import check_optional_time_limit
from nep.text import bounded_str

if TYPE_CHECKING:
    from typing_extensions import Self


DEFAULT_NAME = "blackboard"
MAX_ENTRIES = 10_000
"""Maximum number of entries in a reply. The reply contains the number of omitted entries."""
_MAX_REPLY_BYTES = 32 * 2**20


def service_name(name: str, operation: str) -> str:
    """Return the name of a service of a blackboard.

    Args:
        name: Name of the blackboard.
        operation: "get", "set" or "keys".
    """
    return f"{name}/{operation}"


class BlackboardServer:
    """Server that publishes the changes of a blackboard and replies to requests.

    Runs in the thread that spins the node. Usable as a context manager. The constructor raises the
    exceptions of `Node.new_pub` and `Node.new_server`.

    Args:
        node: Node of the server.
        board: Blackboard to serve.
        name: Name of the blackboard, which prefixes its topic and services.
    """

    def __init__(self, node: Node, board: Blackboard, name: str = DEFAULT_NAME) -> None:
        self._board = board
        self._name = name
        self._change_publisher = node.new_pub(f"/{name.lstrip('/')}/changes", "json")
        board.ignore(self._change_publisher.id)
        self._servers = [
            node.new_server(service_name(name, operation), handler)
            for operation, handler in (("get", self._get), ("set", self._set), ("keys", self._keys))
        ]
        self._remove_callback = board.on_change("**", self._publish_change)

    def _publish_change(self, change: BlackboardChange) -> None:
        change_map = {"blackboard": self._name, "cause": change.cause, **_entry_to_map(change.entry)}
        if change.is_gone:
            change_map["value"] = None
        self._change_publisher.publish(change_map)

    def _get(self, request: object) -> object:
        fields = _checked_request(request)
        max_age_s = check_optional_time_limit("max_age_s", fields.get("max_age_s"))
        if "key" not in fields:
            return self._entries(_text(fields, "pattern", "**"), math.inf if max_age_s is None else max_age_s)
        key = _text(fields, "key")
        missing = object()
        value = self._board.get(key, missing, max_age_s=max_age_s)
        if value is missing:
            return {"found": False, "value": fields.get("default"), "age_s": None}
        return {"found": True, "value": _to_sendable(value), "age_s": _finite_or_none(self._board.age_s(key))}

    def _entries(self, pattern: str, max_age_s: float) -> object:
        recent_entries = [
            board_entry
            for board_entry in self._board.snapshot(pattern).values()
            if board_entry.age_s <= max_age_s
        ]
        entries: list[object] = []
        remaining_bytes = _MAX_REPLY_BYTES
        for board_entry in recent_entries[:MAX_ENTRIES]:
            entry = _entry_to_map(board_entry)
            remaining_bytes -= len(orjson.dumps(entry, option=orjson.OPT_NON_STR_KEYS | numpy_option()))
            if remaining_bytes < 0 and entries:
                break
            entries.append(entry)
        return {"entries": entries, "more": len(recent_entries) - len(entries)}

    def _set(self, request: object) -> object:
        fields = _checked_request(request)
        lives_s = check_optional_time_limit("lives_s", fields.get("lives_s"))
        if "key" in fields and "value" in fields:
            values: Mapping[object, object] = {_text(fields, "key"): fields["value"]}
        else:
            value_map = fields.get("values")
            if not isinstance(value_map, Mapping) or not value_map:
                raise NepError(_("the values are missing; specify 'key' and 'value', or a map 'values'"))
            values = value_map
        for key, value in values.items():
            self._board.put(key if isinstance(key, str) else bounded_str(key), value, lives_s=lives_s)
        return {"set": len(values)}

    def _keys(self, request: object) -> object:
        keys = self._board.keys(_text(_checked_request(request), "pattern", "**"))
        return {"keys": keys[:MAX_ENTRIES], "more": max(0, len(keys) - MAX_ENTRIES)}

    def close(self) -> None:
        """Stop publishing and serving; the blackboard stays open. Idempotent."""
        self._remove_callback()
        for server in self._servers:
            server.close()
        self._change_publisher.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


def _checked_request(request: object) -> Mapping[object, object]:
    if not isinstance(request, Mapping):
        raise NepError(
            _("a request to a blackboard must be a map, such as {example}").format(
                example='{"key": "human.1"}'
            )
        )
    return request


def _text(fields: Mapping[object, object], field: str, default: str | None = None) -> str:
    value = fields.get(field, default)
    if not isinstance(value, str):
        raise BadKeyError(bounded_str(value), _("use a string such as 'human.1.position'"))
    return value


def _entry_to_map(entry: BlackboardEntry) -> dict[str, object]:
    return {
        "key": entry.key,
        "value": _to_sendable(entry.value),
        "age_s": entry.age_s,
        "age_by": entry.age_by,
        "source": entry.source,
        "robot": entry.robot,
        "left_s": _finite_or_none(entry.left_s),
    }


def _to_sendable(value: object) -> object:
    # Falls back to Python's notation for values that JSON lacks, so that one value doesn't hide the others.
    try:
        orjson.dumps(value, option=orjson.OPT_NON_STR_KEYS | numpy_option())
    except (TypeError, ValueError, RecursionError):
        try:
            return ascii(value)
        except Exception:  # noqa: BLE001 - any class may raise; ints have a digit limit
            return type(value).__name__
    return value


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
