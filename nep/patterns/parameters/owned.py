"""Parameters: those of a node, which it declares and others may set. `Node.parameters`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Protocol

from nep.errors import ClosedError, ParameterError, did_you_mean
from nep.i18n import _
from nep.patterns.parameters.parameter import NodeParameter, declared, shown
from nep.text import bounded_str, escaped

__all__ = ["MSG_TYPE", "OnChange", "ParameterHost", "Parameters", "place_of"]

MSG_TYPE = "nep/patterns/parameters"
"""The type of the topic on which a node tells its parameters, latched."""
_MOST = 1_000

OnChange = Callable[[Mapping[str, object]], "str | None"]
"""Is asked before values change, with those that are to; a sentence refuses all of them."""


class StateTopic(Protocol):
    """Where the parameters are told."""

    def publish(self, payload: object) -> None:
        """Tell them."""


class ParameterHost(Protocol):
    """The node, as its parameters need it."""

    name: str
    id: str

    def open_parameters(self, place: str, answer: Callable[[object], object]) -> StateTopic:
        """Let others call `answer`, where the back end has services, and read the topic of this name."""


def place_of(node_id: str) -> str:
    """The name of the service, and of the topic, of a node's parameters."""
    return f"/nep/parameters/{node_id}"


class Parameters:
    """The parameters of a node, by name. May be used from any thread.

    Others see them from the first `declare` on, which raises as `Node.new_pub` does. Where a back end has no
    services they can be read from outside, and not set.
    """

    def __init__(self, host: ParameterHost) -> None:
        self._host = host
        self._known: Mapping[str, NodeParameter] = {}
        self._watchers: tuple[OnChange, ...] = ()
        self._changing = threading.RLock()
        self._topic: StateTopic | None = None

    # ---- declaring and reading

    def declare(
        self,
        name: str,
        default: object,
        *,
        type: type | str | None = None,  # noqa: A002 - what everybody calls it
        description: str = "",
        min: float | None = None,  # noqa: A002 - the same
        max: float | None = None,  # noqa: A002 - the same
        choices: Sequence[object] = (),
        read_only: bool = False,
    ) -> object:
        """A new parameter with this value, which is returned; `type` is that of `default` when it is None.

        `type`: bool, int, float, str, list or dict, or a dataclass, TypedDict or Enum of the program's own:
        then values are instances of that here, and others see and set the map of its fields, or the member's
        value, which have to fit. `description`: for people. `min`: the least number, itself included. `max`:
        the greatest. `choices`: the only values there are. `read_only`: others cannot set it. Raises
        `ParameterError` for a value that its own limits refuse, and for a name that there is already, and as
        `Node.new_pub`.
        """
        made = declared(
            name,
            default,
            kind=type,
            description=description,
            minimum=min,
            maximum=max,
            choices=choices,
            is_read_only=read_only,
        )
        with self._changing:
            if name in self._known:
                raise ParameterError(name, shown(default), _("it is declared already; use 'set'"))
            if len(self._known) >= _MOST:
                raise ParameterError(
                    name, shown(default), _("a node has {most} parameters at most").format(most=_MOST)
                )
            if self._topic is None:
                self._topic = self._host.open_parameters(place_of(self._host.id), self._answer)
            self._known = {**self._known, name: made}
            self._tell()
        return made.typed_value

    def get(self, name: str) -> object:
        """The value of a parameter. Raises `ParameterError` when there is none of this name."""
        return self.describe(name).typed_value

    def describe(self, name: str) -> NodeParameter:
        """A parameter with all that is known of it. Raises as `get` does."""
        try:
            return self._known[name]
        except KeyError:
            raise self._unknown(name) from None

    def list(self) -> tuple[NodeParameter, ...]:
        """All parameters, in the order in which they were declared."""
        return tuple(self._known.values())

    def __getitem__(self, name: str) -> object:
        return self.get(name)

    def __setitem__(self, name: str, value: object) -> None:
        self.set(name, value)

    def __contains__(self, name: object) -> bool:
        return name in self._known

    # ---- changing

    def set(self, name: str, value: object) -> None:
        """Give a parameter another value. Raises `ParameterError` when it cannot have it, or is refused."""
        self.set_all({name: value})

    def set_all(self, values: Mapping[str, object]) -> None:
        """Give several parameters other values: all of them, or none. Raises as `set` does."""
        self._set(values, is_own=True)

    def on_change(self, callback: OnChange) -> None:
        """Ask `callback` whenever values are to change, with those that are, by name; before they do.

        What it returns, a sentence, refuses all of them; None lets them pass. It is asked in the thread that
        sets: for others that is a thread of the node's own. What it raises comes out of `set`, and refuses.
        """
        with self._changing:
            self._watchers = (*self._watchers, callback)

    def _set(self, values: Mapping[str, object], *, is_own: bool) -> None:
        with self._changing:
            changed: dict[str, NodeParameter] = {}
            for name, value in values.items():
                before = self.describe(name)
                after = before.with_value(value)
                if after.value == before.value and type(after.value) is type(before.value):
                    continue
                if before.is_read_only and not is_own:
                    raise ParameterError(name, shown(value), _("only its node may set it"))
                changed[name] = after
            if not changed:
                return
            for watcher in self._watchers:
                said = watcher({name: each.typed_value for name, each in changed.items()})
                if isinstance(said, str) and said:
                    raise ParameterError(", ".join(changed), "", said)
            self._known = {**self._known, **changed}
            self._tell()

    def _unknown(self, name: str) -> ParameterError:
        known = tuple(self._known)
        shown = escaped(bounded_str(name, 60))
        said = did_you_mean(shown, known) if known else _("there are none")
        return ParameterError(shown, "", _("there is none; {said}").format(said=said))

    # ---- for others

    def _tell(self) -> None:
        if self._topic is not None:
            with suppress(ClosedError):  # the node is closed: nobody looks
                self._topic.publish(self._state())

    def _state(self) -> dict[str, object]:
        return {"node": self._host.name, "parameters": [each.as_map() for each in self._known.values()]}

    def _answer(self, request: object) -> object:
        """To a call of another program, in a thread of the server's."""
        values = request.get("set", {}) if isinstance(request, Mapping) else None
        if not isinstance(values, Mapping) or not all(isinstance(each, str) for each in values):
            return {"refused": _("a call of parameters is a map; 'set' in it maps names to values")}
        try:
            self._set(values, is_own=False)
        except Exception as error:  # noqa: BLE001 - what a callback raises refuses, in the words of the error
            return {"refused": str(error) or type(error).__name__}
        return self._state()

    def forked(self) -> None:
        """In a child that was forked: they are the parent's, and told to nobody. Takes no lock."""
        self._changing = threading.RLock()
        self._topic = None
