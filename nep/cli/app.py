"""Assembly of the command `nep`: command groups, help texts and exit codes."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from inspect import cleandoc
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.main import get_command, get_group
from typer.models import CommandInfo

from nep.cli.screen import print_error_message, write
from nep.cli.typer_texts import TranslatedCommand, TranslatedGroup
from nep.errors import NepError
from nep.i18n import _
from nep.system.addresses import MASTER_VARIABLE, master_address
from nep.system.lazy_import import lazy_module
from nep.system.streams import command_line_arguments, output_problem
from nep.version import __version__

if TYPE_CHECKING:
    from nep.cli.graph import log, nodes, parameters, services, top
    from nep.cli.programs import blackboard, bridge, doctor, masters, watch, web, wire
    from nep.cli.recordings import play, record, recordings
    from nep.cli.topics import topics
else:  # a command line needs only one of them
    blackboard, bridge = lazy_module("nep.cli.programs.blackboard"), lazy_module("nep.cli.programs.bridge")
    doctor, log = lazy_module("nep.cli.programs.doctor"), lazy_module("nep.cli.graph.log")
    masters, nodes = lazy_module("nep.cli.programs.masters"), lazy_module("nep.cli.graph.nodes")
    parameters, play = lazy_module("nep.cli.graph.parameters"), lazy_module("nep.cli.recordings.play")
    record, recordings = (
        lazy_module("nep.cli.recordings.record"),
        lazy_module("nep.cli.recordings.recordings"),
    )
    services, top = lazy_module("nep.cli.graph.services"), lazy_module("nep.cli.graph.top")
    topics, watch = lazy_module("nep.cli.topics.topics"), lazy_module("nep.cli.programs.watch")
    web, wire = lazy_module("nep.cli.programs.web"), lazy_module("nep.cli.programs.wire")

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
"""Loaders of commands and command groups by name, in the order of the help text."""


def _show_version(is_requested: bool) -> None:
    if is_requested:
        write(f"nep {__version__}\n")
        raise typer.Exit


class _LazyCommands(Mapping[str, Any]):
    """Lazy mapping of command names to click commands. A command is imported and built on first access."""

    def __init__(self) -> None:
        self._commands: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:  # noqa: ANN401 - typer's types are not public
        if name not in self._commands:
            self._commands[name] = get_group(_build_command(name)).commands[name]
        return self._commands[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_COMMANDS)

    def __len__(self) -> int:
        return len(_COMMANDS)


class _LazyGroup(TranslatedGroup):
    """Root group that imports only the commands that a command line needs."""

    def __init__(self, **kwargs: Any) -> None:  # noqa: ANN401 - see above
        super().__init__(**{**kwargs, "commands": _LazyCommands()})

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ANN401, ARG002
        """Return the command names in the order of the help."""
        return list(self.commands)


app = typer.Typer(
    name="nep",
    cls=_LazyGroup,
    help=_("Publish, inspect and record messages of robots and programs."),
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


@app.callback()
def common(
    master: Annotated[
        str | None,
        typer.Option("--master", metavar=_("ADDRESS"), help=_("Master address."), show_default=False),
    ] = None,
    version: Annotated[  # noqa: ARG001 - `_show_version` has done it
        bool,
        typer.Option("--version", is_eager=True, callback=_show_version, help=_("Show version and exit.")),
    ] = False,
) -> None:
    """Publish, inspect and record messages of robots and programs."""
    if master is not None:
        os.environ[MASTER_VARIABLE] = master_address(master)  # for this command and its child processes


@cache
def _build_command(name: str) -> typer.Typer:
    group = typer.Typer(rich_markup_mode="rich", pretty_exceptions_enable=False)
    entry = _COMMANDS[name]()
    if isinstance(entry, typer.Typer):
        group.add_typer(entry, name=name)
    elif callable(entry):
        group.command(name)(entry)
    for command, english in _docstrings(group):
        command.help = _(english)
        command.cls = TranslatedCommand
    return group


def docstrings() -> Iterator[tuple[CommandInfo, str]]:
    """Yield each command with its English help text, which is the docstring of the command's function."""
    for name in _COMMANDS:
        yield from _docstrings(_build_command(name))


def _docstrings(group: typer.Typer) -> Iterator[tuple[CommandInfo, str]]:
    for command in group.registered_commands:
        yield command, cleandoc((command.callback and command.callback.__doc__) or "")
    for inner in group.registered_groups:
        if inner.typer_instance is not None:
            yield from _docstrings(inner.typer_instance)


def run() -> int:
    """Run the command line and return its exit code.

    Errors are printed to stderr as one sentence. If the reader of the output has exited (`| head`), the
    command ends silently with code 1.
    """
    output_error: OSError | None = None
    try:
        code = _run_root_command()
    except NepError as error:
        print_error_message(str(error))
        code = 1
    except OSError as error:
        if output_problem(error) is None:
            raise
        output_error, code = error, 1
    problem = output_problem(output_error)
    if problem:
        print_error_message(_("can't write the output: {problem}").format(problem=problem))
    return code if problem is None else code or 1


@cache
def _root_command() -> Callable[[list[str]], object]:
    return get_command(app)


def _run_root_command() -> int:
    try:
        _root_command()(command_line_arguments())
    except SystemExit as exit_:
        return exit_.code if isinstance(exit_.code, int) else 0 if exit_.code is None else 1
    return 0
