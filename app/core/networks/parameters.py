"""Parameters of the selected node: current values, recent changes, and setting of values.

Values are received on the node's parameter topic. A value is set by a service call in a background
thread.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import orjson

from app.core.faults import error_text
from app.core.network.nodes import NodeEntry
from app.core.network.source import Job
from app.core.network.topics import Topic, key_of
from app.core.network.watches import WatchHandle
from app.core.storage.background_worker import BackgroundWorker
from app.robots.description.typed_number import TypedNumberError, parse_number
from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.patterns.parameters.node_parameters import parameters_topic
from nep.patterns.parameters.remote import RemoteParameters
from nep.text import bounded_str

REPLY_TIMEOUT_S = 3.0
"""Timeout in seconds of the call that sets a parameter."""
MAX_MESSAGE_BYTES = 4 * 2**20
"""Maximum size in bytes of a message that is decoded in the main thread."""
MAX_TEXT_LENGTH = 20_000
MAX_PARAMETERS = 1000
"""Maximum number of parameters of a node; further ones are not shown."""
_MAX_DESCRIPTION_LENGTH = 2_000
"""Maximum number of characters of a description that are shown."""


@dataclass(frozen=True, slots=True)
class ReportedParameter:
    """Parameter as reported by its node.

    Attributes:
        kind: "bool", "int", "float", "str", "list" or "dict".
        minimum: Lower limit of a number, or None.
        maximum: Upper limit of a number, or None.
        choices: Allowed values; empty if any value is allowed.
        is_read_only: True if only the node itself can set the parameter.
        text: Value as editable text.
    """

    name: str
    value: object
    kind: str
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[object, ...] = ()
    is_read_only: bool = False
    text: str = ""


class ParameterSetter:
    """Client that sets parameters of native nodes. Not thread-safe; use it from the main thread."""

    def __init__(self, submit: Callable[[str, Job], None]) -> None:
        # `submit` runs a job with Studio's node (`app.core.network.source.Source.submit`).
        self._submit = submit
        self._worker: BackgroundWorker[bool] = BackgroundWorker("studio-parameters")

    def set(self, node_id: str, name: str, value: object) -> None:
        """Start to set a parameter; `has_been_set` returns the result."""
        owner = f"{node_id} {name}"
        self._submit(
            "", lambda node: self._worker.submit(owner, partial(_set_parameter, node, node_id, name, value))
        )

    def has_been_set(self, node_id: str, name: str) -> bool:
        """Return True if the parameter was set since the last call, else False.

        Raises `NepError` with the reason if the parameter could not be set.
        """
        return self._worker.pop_result(f"{node_id} {name}") is True

    def close(self) -> None:
        """Wait at most 2 s for a call in flight."""
        self._worker.close()


def _set_parameter(node: Node, node_id: str, name: str, value: object) -> bool:
    try:
        with RemoteParameters(
            node.new_client(parameters_topic(node_id), timeout_s=REPLY_TIMEOUT_S)
        ) as remote_parameters:
            remote_parameters.set(name, value)
    except NepError:
        raise
    except Exception as error:
        raise NepError(error_text(error)) from error
    return True


class NodeParameters:
    """Parameters of the selected node. Not thread-safe; use it from the main thread.

    Attributes:
        change_times_s: Time of the last change of each parameter, by name (monotonic seconds).
        revision: Counter that increases with every change.
    """

    def __init__(
        self,
        watch: Callable[[str], WatchHandle],
        topic: Callable[[str], Topic | None],
        setter: ParameterSetter,
        has_master: Callable[[], bool] = lambda: True,
    ) -> None:
        # `watch` opens a watch by topic key, `topic` returns its state; `has_master`: whether nodes can be
        # called.
        self._watch, self._topic, self._setter, self._has_master = watch, topic, setter, has_master
        self.watch_handle: WatchHandle | None = None
        self.node: NodeEntry | None = None
        self.all: tuple[ReportedParameter, ...] = ()
        self.change_times_s: dict[str, float] = {}
        self.has_received = False
        """True if the node has reported its parameters since it was selected."""
        self.problem = ""
        """Why the message with the parameters can't be read, or ""."""
        self.pending_name = ""
        """Name of the parameter that is being set, or ""."""
        self.rejection_reason = ""
        """Why the last request to set a parameter was rejected, or ""."""
        self.revision = 0
        self._applied_message: Message | None = None

    def show(self, node: NodeEntry | None) -> None:
        """Show the parameters of a node. None, or a node that declares no parameters, shows nothing."""
        displayed = node if node is not None and node.has_parameters else None
        if displayed is self.node:
            return
        self.close()
        self.node = displayed
        if displayed is not None:
            self.watch_handle = self._watch(key_of(displayed.network, parameters_topic(displayed.id)))

    def close(self) -> None:
        """Stop showing a node."""
        if self.watch_handle is not None:
            self.watch_handle.close()
        self.watch_handle = self.node = self._applied_message = None
        self.all, self.change_times_s, self.has_received = (), {}, False
        self.problem = self.pending_name = self.rejection_reason = ""
        self.revision += 1

    def find(self, name: str) -> ReportedParameter | None:
        """Return the parameter with this name, or None."""
        return next((each for each in self.all if each.name == name), None)

    def refresh(self, now: float) -> None:
        """Apply the received values and the result of a pending change.

        Args:
            now: Monotonic time in seconds.
        """
        node = self.node
        if node is None:
            return
        topic = self._topic(key_of(node.network, parameters_topic(node.id)))
        newest = topic.newest if topic is not None else None
        if newest is not None and newest is not self._applied_message:
            self._applied_message = newest
            self._apply(newest, now)
        if self.pending_name:
            self._check_result(node)

    def _apply(self, message: Message, now: float) -> None:
        self.revision += 1
        try:
            if message.size_bytes > MAX_MESSAGE_BYTES:
                raise NepError(_("they are too large to show here; use nep param list"))
            parameters = parse_parameters(message.payload)
        except NepError as error:  # also a `DecodeError`
            self.problem = str(error)
            return
        previous_values = {each.name: each.value for each in self.all}
        if self.has_received:
            self.change_times_s.update(
                {
                    each.name: now
                    for each in parameters
                    if each.name not in previous_values
                    or not _are_equal(previous_values[each.name], each.value)
                }
            )
        self.all, self.has_received, self.problem = parameters, True, ""

    def _check_result(self, node: NodeEntry) -> None:
        try:
            is_done = self._setter.has_been_set(node.id, self.pending_name)
        except NepError as error:
            self.rejection_reason, self.pending_name = str(error), ""
            self.revision += 1
        else:
            if is_done:
                self.pending_name = ""
                self.revision += 1

    def set(self, name: str, text: str) -> None:
        """Parse a text and start to set the parameter to the resulting value.

        If that fails, `rejection_reason` contains the reason.
        """
        node, parameter = self.node, self.find(name)
        self.revision += 1
        self.rejection_reason = ""
        if node is None or parameter is None:
            return
        self.rejection_reason = read_only_reason(node, parameter)
        if not self.rejection_reason and not self._has_master():
            self.rejection_reason = _("no master responds, so the parameter can't be set; try again later")
        if self.rejection_reason:
            return
        try:
            value = parse_value(text, parameter.kind)
        except ValueError as error:
            self.rejection_reason = str(error)
            return
        self.pending_name = name
        self._setter.set(node.id, name, value)


def read_only_reason(node: NodeEntry, parameter: ReportedParameter) -> str:
    """Return the reason why a parameter can't be set from Studio, or ""."""
    if node.gone_s is not None:
        return _("the node has left")
    if len(parameter.text) > MAX_TEXT_LENGTH:
        return _("the value is too long to edit here; use nep param set")
    if not node.can_set_parameters:
        return _("parameters on this network are read-only")
    return _("only the node itself can change this parameter") if parameter.is_read_only else ""


def parse_parameters(state: object) -> tuple[ReportedParameter, ...]:
    """Parse and validate a parameter message. Raises `NepError` if it contains no list of parameters.

    Validation is necessary, because any node can publish on a parameter topic. Elements that aren't
    objects and elements beyond `MAX_PARAMETERS` are ignored; of equal names, the last one is used.
    """
    entries = state.get("parameters") if isinstance(state, Mapping) else None
    if not isinstance(entries, list):
        raise NepError(_("the message contains no list of parameters"))
    parameters = [_parse_parameter(each) for each in entries[:MAX_PARAMETERS] if isinstance(each, Mapping)]
    return tuple({each.name: each for each in parameters}.values())


def _parse_parameter(entry: Mapping[str, object]) -> ReportedParameter:
    choices = entry.get("choices")
    return ReportedParameter(
        bounded_str(entry.get("name")),
        entry.get("value"),
        bounded_str(entry.get("type")),
        bounded_str(entry.get("description") or "", _MAX_DESCRIPTION_LENGTH),
        _number(entry.get("min")),
        _number(entry.get("max")),
        tuple(choices[:MAX_PARAMETERS]) if isinstance(choices, list) else (),
        entry.get("read_only") is True,
        format_value(entry.get("value")),
    )


def _number(value: object) -> float | None:
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


def _are_equal(value: object, other: object) -> bool:
    # 1, 1.0 and True are different values.
    return type(value) is type(other) and value == other


def format_value(value: object) -> str:
    """Format a value for editing: strings unchanged, anything else as JSON.

    A value that JSON can't represent is shown as shortened text.
    """
    if isinstance(value, str):
        return value
    try:
        return orjson.dumps(value).decode()
    except TypeError:  # a value that JSON lacks, from another program
        return bounded_str(value)


def parse_value(text: str, kind: str) -> object:
    """Parse the text of a value.

    Args:
        text: Text that the user entered.
        kind: Kind of the parameter, see `ReportedParameter`.

    Raises:
        ValueError: The text isn't a value of this kind. The message is for the user.
    """
    if kind == "str":
        return text
    stripped = text.strip()
    if kind == "int":
        return _parse_int(stripped)
    if kind == "float":
        return _parse_float(stripped)
    try:
        value: object = orjson.loads(stripped)
    except orjson.JSONDecodeError:
        if kind not in {"bool", "list", "dict"}:
            raise ValueError(_("enter a value as JSON, such as {example}").format(example='"text"')) from None
        value = None
    if kind == "bool" and not isinstance(value, bool):
        raise ValueError(_("enter true or false"))
    if kind == "list" and not isinstance(value, list):
        raise ValueError(_("enter a list as JSON, such as [1, 2]"))
    if kind == "dict" and not isinstance(value, dict):
        raise ValueError(_("enter an object as JSON, such as {example}").format(example='{"x": 1}'))
    return value


def _parse_int(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(_("enter a whole number")) from None


def _parse_float(text: str) -> float:
    try:
        return parse_number(text)
    except TypedNumberError as error:
        if error.has_separators:
            raise ValueError(_("enter a number with at most one comma or point")) from None
        raise ValueError(_("enter a number")) from None
