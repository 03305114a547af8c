"""The command `nep` put together: its groups, its help, and how it ends."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import cache
from inspect import cleandoc
from typing import Annotated

import typer
from typer.main import get_command
from typer.models import CommandInfo

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
)
from nep.cli.screen import say_error, write
from nep.cli.typer_words import TranslatedCommand, TranslatedGroup
from nep.errors import NepError
from nep.i18n import _
from nep.system.addresses import MASTER_VARIABLE, master_address
from nep.system.streams import output_problem, words_given
from nep.version import __version__


def _say_version(is_wanted: bool) -> None:
    if is_wanted:
        write(f"nep {__version__}\n")
        raise typer.Exit


app = typer.Typer(
    name="nep",
    cls=TranslatedGroup,
    help=_("See and make messages between robots, programs and people."),
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.command("master")(masters.master)
app.command("bridge")(bridge.bridge)
app.command("log")(log.log)
app.command("top")(top.top)
app.command("record")(record.record)
app.command("play")(play.play)
app.command("doctor")(doctor.doctor)
app.command("watch")(watch.watch)
app.add_typer(nodes.app, name="node")
app.add_typer(topics.app, name="topic")
app.add_typer(services.app, name="service")
app.add_typer(parameters.app, name="param")
app.add_typer(blackboard.app, name="blackboard")
app.add_typer(recordings.app, name="recording")


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


def docstrings(group: typer.Typer) -> Iterator[tuple[CommandInfo, str]]:
    """Each command with what its docstring says, which is its help."""
    for command in group.registered_commands:
        yield command, cleandoc((command.callback and command.callback.__doc__) or "")
    for inner in group.registered_groups:
        if inner.typer_instance is not None:
            yield from docstrings(inner.typer_instance)


for _command, _english in docstrings(app):
    _command.help = _(_english)
    _command.cls = TranslatedCommand


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
