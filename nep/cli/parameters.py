"""`nep param`: the parameters of a node: list, get, set, and all of them to a file and back."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import orjson
import typer

from nep.cli.complete import complete_node
from nep.cli.options import JsonOption, MasterOption
from nep.cli.publish import read_file
from nep.cli.screen import UNKNOWN, TextColumn, say, show_json, show_table, write
from nep.cli.typer_words import TranslatedGroup
from nep.cli.values import json_of, presented
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.nodes.node import Node
from nep.patterns.parameters.remote import RemoteParameters
from nep.system.replace_file import replace_file
from nep.text import escaped, shortened

app = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("Values of a node that can be set while it runs."),
)
_COLUMNS = (
    TextColumn(lazy("parameter"), style="bold", is_whole=True),
    TextColumn(lazy("value"), style="green"),
    TextColumn(lazy("type")),
    TextColumn(lazy("allowed")),
    TextColumn(lazy("description")),
)
_NodeArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("NODE"),
        help=_("The node, by its name or id."),
        show_default=False,
        autocompletion=complete_node,
    ),
]
_NameArgument = Annotated[
    str, typer.Argument(metavar=_("NAME"), help=_("The parameter."), show_default=False)
]


@app.command("list")
def list_parameters(node: _NodeArgument, master: MasterOption = None, as_json: JsonOption = False) -> None:
    """List the parameters of a node, with their types and limits."""
    with _parameters(node, master) as theirs:
        found = theirs.list()
    if as_json:
        show_json(list(found))
    elif found:
        show_table(_COLUMNS, [_row(each) for each in found])
    else:
        say(_("it has none now"))


@app.command("get")
def get(
    node: _NodeArgument, name: _NameArgument, master: MasterOption = None, as_json: JsonOption = False
) -> None:
    """Write the value of a parameter."""
    with _parameters(node, master) as theirs:
        value = theirs.get(name)
    if as_json:
        show_json(value)
    else:
        write(f"{presented(value, whole=True)}\n")


@app.command("set")
def set_value(
    node: _NodeArgument,
    name: _NameArgument,
    value: Annotated[
        str,
        typer.Argument(
            metavar=_("VALUE"),
            help=_("JSON, such as 0.5, true or [1, 2]; anything else is a text."),
            show_default=False,
        ),
    ],
    master: MasterOption = None,
) -> None:
    """Give a parameter another value; the node may refuse it and says why."""
    with _parameters(node, master) as theirs:
        kinds = {each.get("name"): each.get("type") for each in theirs.list()}
        theirs.set(name, value if kinds.get(name) == "str" else _meant(value))


@app.command("dump")
def dump(
    node: _NodeArgument,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar=_("FILE"), help=_("Where to; the output when nothing is said."), show_default=False
        ),
    ] = None,
    master: MasterOption = None,
) -> None:
    """Write all parameters as JSON, for `nep param load`."""
    with _parameters(node, master) as theirs:
        values = {str(each.get("name")): each.get("value") for each in theirs.list()}
    data = json_of(values, indent=True) + b"\n"
    if file is None:
        write(data.decode())
        return
    try:
        unfinished = file.with_name(f"{file.name}.{os.getpid()}.part")
        unfinished.write_bytes(data)
        replace_file(unfinished, file)
    except OSError as error:
        said = _("'{file}' cannot be written: {problem}; choose another place")
        raise NepError(said.format(file=escaped(str(file)), problem=error.strerror or error)) from error


@app.command("load")
def load(
    node: _NodeArgument,
    file: Annotated[
        Path, typer.Argument(metavar=_("FILE"), help=_("What `nep param dump` wrote."), show_default=False)
    ],
    master: MasterOption = None,
) -> None:
    """Set the parameters that a file has: all of them, or none."""
    shown = escaped(str(file))
    try:
        values = orjson.loads(read_file(file, "json"))
    except orjson.JSONDecodeError as error:
        raise NepError(_("'{file}' is no JSON: {reason}").format(file=shown, reason=error)) from error
    if not isinstance(values, dict):
        raise NepError(_("'{file}' has no map of names and values").format(file=shown))
    with _parameters(node, master) as theirs:
        theirs.set_all(values)


@contextmanager
def _parameters(node: str, master: str | None) -> Iterator[RemoteParameters]:
    with Node(f"nep-param-{os.getpid()}", master=master) as own, own.parameters_of(node) as theirs:
        yield theirs


def _meant(word: str) -> object:
    try:
        return orjson.loads(word)
    except orjson.JSONDecodeError:
        return word


def _row(parameter: Mapping[str, object]) -> tuple[str, ...]:
    return (
        escaped(str(parameter.get("name"))),
        presented(parameter.get("value"), whole=False),
        escaped(str(parameter.get("type"))),
        _allowed(parameter),
        escaped(shortened(str(parameter.get("description") or ""), 200)),
    )


def _allowed(parameter: Mapping[str, object]) -> str:
    if parameter.get("read_only"):
        return _("read only")
    choices = parameter.get("choices")
    if choices:
        return presented(choices, whole=False)
    least, most = parameter.get("min"), parameter.get("max")
    if least is None and most is None:
        return UNKNOWN
    return "".join((
        "" if least is None else f"{presented(least, whole=True)} ≤ ",
        "…",
        "" if most is None else f" ≤ {presented(most, whole=True)}",
    ))  # fmt: skip
