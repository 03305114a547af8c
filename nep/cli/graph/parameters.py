"""`nep param`: list, get, set and watch parameters of a node; save them to a file and load them."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated

import orjson
import typer

from nep.cli.complete import complete_node
from nep.cli.json_input import decode_text, parse_json
from nep.cli.options import JsonOption, MasterOption, TimeoutOption
from nep.cli.screen import UNKNOWN, TextColumn, print_status, show_json, show_table, write
from nep.cli.topics.publish import read_file
from nep.cli.typer_texts import TranslatedGroup
from nep.cli.values import encode_json, format_payload
from nep.errors import DecodeError, MasterUnreachable, NepError, WaitTimeoutError, did_you_mean
from nep.i18n import _, lazy
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.patterns.parameters.node_parameters import MSG_TYPE, parameters_topic
from nep.patterns.parameters.remote import RemoteParameters, node_with_parameters
from nep.system.replace_file import replace_file
from nep.text import bounded_str, escaped, shortened

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("List, get, set and watch parameters of a running node."),
)
_COLUMNS = (
    TextColumn(lazy("parameter"), style="bold", is_folded_last=True),
    TextColumn(lazy("value"), style="green"),
    TextColumn(lazy("type")),
    TextColumn(lazy("allowed")),
    TextColumn(lazy("description")),
)
_PRESENCE_CHECK_S = 1.0
"""Interval in seconds at which the command checks that the node still exists."""
_NodeArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("NODE"),
        help=_("Name or id of the node."),
        show_default=False,
        autocompletion=complete_node,
    ),
]
_NameArgument = Annotated[
    str, typer.Argument(metavar=_("NAME"), help=_("Name of the parameter."), show_default=False)
]


@app.command("list")
def list_parameters(node: _NodeArgument, master: MasterOption = None, as_json: JsonOption = False) -> None:
    """List the parameters of a node, with their types and limits."""
    with _open_parameters(node, master) as parameters:
        parameter_list = parameters.list()
    if as_json:
        show_json(list(parameter_list))
    elif parameter_list:
        show_table(_COLUMNS, [_row(each) for each in parameter_list])
    else:
        print_status(_("the node has no parameters"))


@app.command("get")
def get(
    node: _NodeArgument, name: _NameArgument, master: MasterOption = None, as_json: JsonOption = False
) -> None:
    """Print the value of a parameter."""
    with _open_parameters(node, master) as parameters:
        value = parameters.get(name)
    if as_json:
        show_json(value)
    else:
        write(f"{format_payload(value, in_full=True)}\n")


@app.command("set")
def set_value(
    node: _NodeArgument,
    name: _NameArgument,
    value: Annotated[
        str,
        typer.Argument(
            metavar=_("VALUE"),
            help=_("Value as JSON, such as 0.5, true or [1, 2]; anything else is treated as text."),
            show_default=False,
        ),
    ],
    master: MasterOption = None,
) -> None:
    """Set a parameter. Fails with the reason if the node rejects the value."""
    with _open_parameters(node, master) as parameters:
        kinds = {each.get("name"): each.get("type") for each in parameters.list()}
        parameters.set(name, value if kinds.get(name) == "str" else _parse_value(value))


@app.command("watch")
def watch(
    node: _NodeArgument,
    name: Annotated[
        str | None,
        typer.Argument(metavar=_("NAME"), help=_("Parameter to watch (default: all)."), show_default=False),
    ] = None,
    count: Annotated[
        int, typer.Option("--count", "-n", min=0, metavar="N", help=_("Exit after N lines (0: never)."))
    ] = 0,
    timeout_s: TimeoutOption = None,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the parameters of a node, and again whenever one changes, until Ctrl+C."""
    with Node(f"nep-param-{os.getpid()}", master=master) as own_node:
        node_id = node_with_parameters(own_node.graph(), node)
        with own_node.new_sub(parameters_topic(node_id), MSG_TYPE) as subscriber:
            changes = _changes(_receive_states(own_node, subscriber, node_id, timeout_s), name)
            for changed_name, value in itertools.islice(changes, count or None):
                if as_json:
                    show_json({"name": changed_name, "value": value})
                else:
                    write(f"{escaped(changed_name)}: {format_payload(value, in_full=True)}\n")


@app.command("dump")
def dump(
    node: _NodeArgument,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar=_("FILE"), help=_("File to write (default: standard output)."), show_default=False
        ),
    ] = None,
    master: MasterOption = None,
) -> None:
    """Write all parameters of a node as JSON, for `nep param load`."""
    with _open_parameters(node, master) as parameters:
        values = {bounded_str(each.get("name")): each.get("value") for each in parameters.list()}
    data = encode_json(values, indent=True) + b"\n"
    if file is None:
        write(data.decode())
        return
    try:
        part_file = file.with_name(f"{file.name}.{os.getpid()}.part")
        part_file.write_bytes(data)
        replace_file(part_file, file)
    except OSError as error:
        template = _("can't write '{file}': {problem}; choose another file")
        raise NepError(template.format(file=escaped(str(file)), problem=error.strerror or error)) from error


@app.command("load")
def load(
    node: _NodeArgument,
    file: Annotated[
        Path,
        typer.Argument(metavar=_("FILE"), help=_("File written by `nep param dump`."), show_default=False),
    ],
    master: MasterOption = None,
) -> None:
    """Set parameters from a file. If one is rejected, none is changed."""
    shown_path = escaped(str(file))
    values = parse_json(decode_text(read_file(file, "json"), str(file)), file=str(file))
    if not isinstance(values, dict):
        raise NepError(_("'{file}' isn't a JSON object of names and values").format(file=shown_path))
    with _open_parameters(node, master) as parameters:
        parameters.set_all(values)


@contextmanager
def _open_parameters(node: str, master: str | None) -> Iterator[RemoteParameters]:
    with (
        Node(f"nep-param-{os.getpid()}", master=master) as own_node,
        own_node.parameters_of(node) as parameters,
    ):
        yield parameters


def _receive_states(
    own_node: Node, subscriber: Subscriber, node_id: str, timeout_s: float | None
) -> Iterator[Mapping[str, object]]:
    # Yields name → value, now and after each change. Raises `WaitTimeoutError`, or `NepError` when the node
    # leaves.
    deadline = None if timeout_s is None else time.monotonic() + timeout_s
    check_at = time.monotonic() + _PRESENCE_CHECK_S
    while True:
        slice_s = (
            _PRESENCE_CHECK_S
            if deadline is None
            else min(_PRESENCE_CHECK_S, max(0.0, deadline - time.monotonic()))
        )
        message = subscriber.receive(slice_s)
        if message is not None:
            values = _parse_values(message)
            if values is not None:
                yield values
            deadline = None if timeout_s is None else time.monotonic() + timeout_s
        elif deadline is not None and time.monotonic() >= deadline:
            raise WaitTimeoutError(_("a change of the parameters"), timeout_s or 0.0)
        if time.monotonic() >= check_at:
            check_at = time.monotonic() + _PRESENCE_CHECK_S
            with suppress(MasterUnreachable):  # connections survive while the master is down
                if node_id not in own_node.graph().nodes:
                    raise NepError(
                        _("the node has left the network; run the command again after the node restarts")
                    )


def _parse_values(message: Message) -> Mapping[str, object] | None:
    try:
        state = message.payload
    except DecodeError:
        return None
    entries = state.get("parameters") if isinstance(state, Mapping) else None
    if not isinstance(entries, list):
        return None
    maps = [each for each in entries if isinstance(each, Mapping)]
    return {bounded_str(each.get("name")): each.get("value") for each in maps}


def _changes(states: Iterator[Mapping[str, object]], name: str | None) -> Iterator[tuple[str, object]]:
    # Yields names and values that are new or have changed. Raises `NepError` if `name` does not exist.
    previous_values: dict[str, object] = {}
    for values in states:
        if name is not None and not previous_values and name not in values:
            hint = did_you_mean(name, tuple(values)) if values else _("the node has no parameters")
            raise NepError(_("unknown parameter '{name}'; {said}").format(name=escaped(name), said=hint))
        for key, value in values.items():
            is_same = key in previous_values and encode_json(previous_values[key]) == encode_json(
                value
            )  # 1 and 1.0 and True differ
            if not is_same:
                previous_values[key] = value
                if name in {None, key}:
                    yield key, value


def _parse_value(text: str) -> object:
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError:
        return text


def _row(parameter: Mapping[str, object]) -> tuple[str, ...]:
    return (
        escaped(str(parameter.get("name"))),
        format_payload(parameter.get("value"), in_full=False),
        escaped(str(parameter.get("type"))),
        _allowed_values(parameter),
        escaped(shortened(str(parameter.get("description") or ""), 200)),
    )


def _allowed_values(parameter: Mapping[str, object]) -> str:
    if parameter.get("read_only"):
        return _("read-only")
    choices = parameter.get("choices")
    if choices:
        return format_payload(choices, in_full=False)
    minimum, maximum = parameter.get("min"), parameter.get("max")
    if minimum is None and maximum is None:
        return UNKNOWN
    return "".join((
        "" if minimum is None else f"{format_payload(minimum, in_full=True)} ≤ ",
        "…",
        "" if maximum is None else f" ≤ {format_payload(maximum, in_full=True)}",
    ))  # fmt: skip
