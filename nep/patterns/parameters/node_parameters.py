"""Parameters of a node, which other nodes can read and set. See `Node.parameters`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Protocol

from nep.errors import ClosedError, ParameterError, did_you_mean
from nep.i18n import _
from nep.patterns.parameters.parameter import NodeParameter, new_parameter, short_repr
from nep.system.forks import call_in_child
from nep.text import bounded_str, escaped

MSG_TYPE = "nep/patterns/parameters"
"""Message type of the latched topic that publishes a node's parameters."""
_MAX_PARAMETERS = 1_000

OnChange = Callable[[Mapping[str, object]], "str | None"]
"""Callback invoked before values change; a returned string rejects the change."""


class StateTopic(Protocol):
    """Publisher of the latched topic with the state of a node's parameters."""

    def publish(self, payload: object) -> None:
        """Publish the parameters."""


class ParameterHost(Protocol):
    """Interface of the node that owns the parameters."""

    name: str
    id: str

    def open_parameters(self, name: str, callback: Callable[[object], object]) -> StateTopic:
        """Open the latched topic `name`, and the service `name` if the back end supports services.

        Args:
            name: Name of the topic and the service.
            callback: Callback of the service.
        """


def parameters_topic(node_id: str) -> str:
    """Return the name shared by the service and the topic of a node's parameters."""
    return f"/nep/parameters/{node_id}"


class Parameters:
    """Parameters of a node by name. Thread-safe. See `Node.parameters`.

    After the first `declare`, other nodes can read the parameters. If the back end supports services,
    other nodes can also set them.

        node.parameters.declare("speed", 0.3, min=0.0, max=1.0, description="m/s")
        node.parameters["speed"] = 0.5
    """

    def __init__(self, host: ParameterHost) -> None:
        self._host = host
        self._parameters: Mapping[str, NodeParameter] = {}
        self._watchers: tuple[OnChange, ...] = ()
        self._lock = threading.RLock()
        self._topic: StateTopic | None = None
        call_in_child(self._reset_in_child)

    # ---- declaring and reading

    def declare(
        self,
        name: str,
        default: object,
        *,
        type: type | str | None = None,  # noqa: A002 - the usual name
        description: str = "",
        min: float | None = None,  # noqa: A002 - the usual name
        max: float | None = None,  # noqa: A002 - the usual name
        choices: Sequence[object] = (),
        read_only: bool = False,
    ) -> object:
        """Declare a parameter and return its value.

        Args:
            name: Name of the parameter; the rules of topic names apply.
            default: Initial value.
            type: bool, int, float, str, list or dict; or a dataclass, TypedDict or Enum. With a class, `get`
                returns instances, while other nodes see and set the plain value (the fields as a map, or the
                member's value). Default: the type of `default`.
            description: Text for people.
            min: Minimum of a number, inclusive.
            max: Maximum of a number, inclusive.
            choices: Allowed values; empty for any value.
            read_only: Reject changes by other nodes.

        Raises:
            ParameterError: The name is declared already, or the default is not allowed.
            NepError: The topic of the parameters can't be opened, as in `Node.new_pub` (first parameter
                only).
        """
        parameter = new_parameter(
            name,
            default,
            kind=type,
            description=description,
            minimum=min,
            maximum=max,
            choices=choices,
            is_read_only=read_only,
        )
        with self._lock:
            if name in self._parameters:
                raise ParameterError(
                    name, short_repr(default), _("the parameter is already declared; use 'set'")
                )
            if len(self._parameters) >= _MAX_PARAMETERS:
                raise ParameterError(
                    name,
                    short_repr(default),
                    _("a node can have at most {most} parameters").format(most=_MAX_PARAMETERS),
                )
            if self._topic is None:
                self._topic = self._host.open_parameters(
                    parameters_topic(self._host.id), self._handle_request
                )
            self._parameters = {**self._parameters, name: parameter}
            self._publish()
        return parameter.typed_value

    def get(self, name: str) -> object:
        """Return the value of a parameter. Raises `ParameterError` for an unknown name."""
        return self.describe(name).typed_value

    def describe(self, name: str) -> NodeParameter:
        """Return a parameter with its type, limits and description.

        Raises `ParameterError` for an unknown name.
        """
        try:
            return self._parameters[name]
        except KeyError:
            raise self._unknown_error(name) from None

    def list(self) -> tuple[NodeParameter, ...]:
        """Return all parameters in the order of their declaration."""
        return tuple(self._parameters.values())

    def __getitem__(self, name: str) -> object:
        return self.get(name)

    def __setitem__(self, name: str, value: object) -> None:
        self.set(name, value)

    def __contains__(self, name: object) -> bool:
        return name in self._parameters

    # ---- changing

    def set(self, name: str, value: object) -> None:
        """Set a parameter.

        Raises `ParameterError` if the name is unknown, the value is invalid or a callback rejects it.
        """
        self.set_all({name: value})

    def set_all(self, values: Mapping[str, object]) -> None:
        """Set several parameters atomically: all of them, or none.

        Raises `ParameterError` if a name is unknown, a value is invalid or a callback rejects the
        change.
        """
        self._set(values, is_own=True)

    def on_change(self, callback: OnChange) -> None:
        """Register a callback that is called before parameters change, with the new values by name.

        The callback rejects the whole change by returning the reason as a string, or by raising an
        exception. It runs in the thread that calls `set`, or in a thread of the node if another node
        requested the change.
        """
        with self._lock:
            self._watchers = (*self._watchers, callback)

    def _set(self, values: Mapping[str, object], *, is_own: bool) -> None:
        with self._lock:
            changed: dict[str, NodeParameter] = {}
            for name, value in values.items():
                before = self.describe(name)
                after = before.with_value(value)
                if after.value == before.value and type(after.value) is type(before.value):
                    continue
                if before.is_read_only and not is_own:
                    raise ParameterError(name, short_repr(value), _("only its node can change it"))
                changed[name] = after
            if not changed:
                return
            for watcher in self._watchers:
                reason = watcher({name: each.typed_value for name, each in changed.items()})
                if isinstance(reason, str) and reason:
                    raise ParameterError(", ".join(changed), "", reason)
            self._parameters = {**self._parameters, **changed}
            self._publish()

    def _unknown_error(self, name: str) -> ParameterError:
        known_names = tuple(self._parameters)
        shown_name = escaped(bounded_str(name, 60))
        hint = did_you_mean(shown_name, known_names) if known_names else _("the node has no parameters")
        return ParameterError(shown_name, "", _("no such parameter; {said}").format(said=hint))

    # ---- for others

    def _publish(self) -> None:
        if self._topic is not None:
            with suppress(ClosedError):  # the node is closed
                self._topic.publish(self._state())

    def _state(self) -> dict[str, object]:
        return {"node": self._host.name, "parameters": [each.as_map() for each in self._parameters.values()]}

    def _handle_request(self, request: object) -> object:
        # Runs in a thread of the server.
        values = request.get("set", {}) if isinstance(request, Mapping) else None
        if not isinstance(values, Mapping) or not all(isinstance(each, str) for each in values):
            return {"refused": _("the request must be a map whose 'set' maps parameter names to values")}
        try:
            self._set(values, is_own=False)
        except Exception as error:  # noqa: BLE001 - an exception of a callback rejects the change
            return {"refused": str(error) or type(error).__name__}
        return self._state()

    def _reset_in_child(self) -> None:
        # The child's changes stay local.
        self._lock = threading.RLock()
        self._topic = None
        call_in_child(self._reset_in_child)
