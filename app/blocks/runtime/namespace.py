"""The names that a running program may use, each bound to what it does."""

from __future__ import annotations

from app.blocks.runtime import calls, lists, values

_OWN = (
    "called", "fail", "newest", "number", "on_message", "on_start", "on_true", "publish", "robot", "step",
    "stop_program", "value", "wait", "wait_until", "write",
)  # fmt: skip
_PURE = (
    "is_known", "join", "length", "part", "random_number", "repeat", "rounded", "rounded_down", "rounded_up",
)  # fmt: skip
_LISTS = (
    "add_item", "contains", "each", "insert_item", "item", "join_items", "new_list", "position",
    "remove_item", "set_item", "split_text",
)  # fmt: skip


def namespace(runtime: object) -> dict[str, object]:
    """The names for one program: methods of its runtime, and pure functions."""
    return (
        {name: getattr(runtime, name) for name in _OWN}
        | {name: getattr(values, name) for name in _PURE}
        | {name: getattr(lists, name) for name in _LISTS}
        | {"stop_script": calls.stop_script}
    )
