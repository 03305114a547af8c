"""The command `nep` put together: its groups, its help, and how it ends."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from inspect import cleandoc
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.main import get_command, get_group
from typer.models import CommandInfo

from nep.cli.screen import say_error, write
from nep.cli.typer_words import TranslatedCommand, TranslatedGroup
from nep.errors import NepError
from nep.i18n import _
from nep.system.addresses import MASTER_VARIABLE, master_address
from nep.system.lazy_import import lazy_module
from nep.system.streams import output_problem, words_given
from nep.version import __version__

if TYPE_CHECKING:
    from nep.cli import (
        blackboard,
        bridge,
        doctor,
        log,
        masters,
        nodes,
        parameters,
        play,
        record,
        recordings,
        services,
        top,
        topics,
        watch,
        web,
        wire,
    )
else:  # each command line needs one of them
    blackboard, bridge = lazy_module("nep.cli.blackboard"), lazy_module("nep.cli.bridge")
    doctor, log = lazy_module("nep.cli.doctor"), lazy_module("nep.cli.log")
    masters, nodes = lazy_module("nep.cli.masters"), lazy_module("nep.cli.nodes")
    parameters, play = lazy_module("nep.cli.parameters"), lazy_module("nep.cli.play")
    record, recordings = lazy_module("nep.cli.record"), lazy_module("nep.cli.recordings")
    services, top = lazy_module("nep.cli.services"), lazy_module("nep.cli.top")
    topics, watch = lazy_module("nep.cli.topics"), lazy_module("nep.cli.watch")
    web, wire = lazy_module("nep.cli.web"), lazy_module("nep.cli.wire")

_COMMANDS: Mapping[str, Callable[[], object]] = {
    "master": lambda: masters.master,
    "bridge": lambda: bridge.bridge,
    "web": lambda: web.web,
    "log": lambda: log.log,
    "top": lambda: top.top,
    "record": lambda: record.record,
    "play": lambda: play.play,
    "doctor": lambda: doctor.doctor,
    "watch": lambda: watch.watch,
    "node": lambda: nodes.app,
    "topic": lambda: topics.app,
    "service": lambda: services.app,
    "param": lambda: parameters.app,
    "blackboard": lambda: blackboard.app,
    "recording": lambda: recordings.app,
    "wire": lambda: wire.app,
}
"""In the order of the help: what carries a command out, or the group that has more of them."""


def _say_version(is_wanted: bool) -> None:
    if is_wanted:
        write(f"nep {__version__}\n")
        raise typer.Exit


class _CommandsWhenAsked(Mapping[str, Any]):
    """The commands of `nep` as click has them: one is imported and put together when it is asked for."""

    def __init__(self) -> None:
        self._built: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - typer's types are not public
        if name not in self._built:
            self._built[name] = get_group(_told(name)).commands[name]
        return self._built[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_COMMANDS)

    def __len__(self) -> int:
        return len(_COMMANDS)


class _OneAtATime(TranslatedGroup):
    """The group of all of them, which reads no more of them than a command line needs."""

    def __init__(self, **named: Any) -> None:  # noqa: ANN401 - see above
        super().__init__(**{**named, "commands": _CommandsWhenAsked()})

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401, ARG002
        """See `click.Group`."""
        return list(self.commands)


app = typer.Typer(
    name="nep",
    cls=_OneAtATime,
    help=_("See and make messages between robots, programs and people."),
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


@app.callback()
def common(
    master: Annotated[
        str | None,
        typer.Option("--master", metavar=_("ADDRESS"), help=_("Where the master is."), show_default=False),
    ] = None,
    version: Annotated[  # noqa: ARG001 - `_say_version` has done it
        bool,
        typer.Option("--version", is_eager=True, callback=_say_version, help=_("Say the version, and end.")),
    ] = False,
) -> None:
    """See and make messages between robots, programs and people."""
    if master is not None:
        os.environ[MASTER_VARIABLE] = master_address(master)  # for the command, and for what it starts


@cache
def _told(name: str) -> typer.Typer:
    """One of the commands as typer is told of it, with its docstrings translated."""
    made, found = typer.Typer(rich_markup_mode="rich", pretty_exceptions_enable=False), _COMMANDS[name]()
    if isinstance(found, typer.Typer):
        made.add_typer(found, name=name)
    elif callable(found):
        made.command(name)(found)
    for command, english in _docstrings(made):
        command.help = _(english)
        command.cls = TranslatedCommand
    return made


def docstrings() -> Iterator[tuple[CommandInfo, str]]:
    """Each command with what its docstring says, which is its help."""
    for name in _COMMANDS:
        yield from _docstrings(_told(name))


def _docstrings(group: typer.Typer) -> Iterator[tuple[CommandInfo, str]]:
    for command in group.registered_commands:
        yield command, cleandoc((command.callback and command.callback.__doc__) or "")
    for inner in group.registered_groups:
        if inner.typer_instance is not None:
            yield from _docstrings(inner.typer_instance)


def run() -> int:
    """Run the command line; its exit code. What goes wrong is one sentence on the standard error stream.

    A reader that has enough (`| head`) ends it without a word, with 1.
    """
    raised: OSError | None = None
    try:
        code = _code()
    except NepError as error:
        say_error(str(error))
        code = 1
    except OSError as error:
        if output_problem(error) is None:
            raise
        raised, code = error, 1
    problem = output_problem(raised)
    if problem:
        say_error(_("the output cannot be written: {problem}").format(problem=problem))
    return code if problem is None else code or 1


@cache
def _built() -> Callable[[list[str]], object]:
    """The commands as click runs them: each parameter is looked at once."""
    return get_command(app)


def _code() -> int:
    """The exit code that typer leaves with."""
    try:
        _built()(words_given())
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 1
    return 0
