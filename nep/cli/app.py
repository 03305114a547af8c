"""The command `nep` put together: its groups, its help, and how it ends."""

from __future__ import annotations

import os
import sys

import typer

from nep.cli import doctor, log, masters, nodes, topics
from nep.cli.screen import say_error
from nep.errors import NepError

app = typer.Typer(
    name="nep",
    help="See and make messages between robots, programs and people.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.command("master")(masters.master)
app.command("log")(log.log)
app.command("doctor")(doctor.doctor)
app.add_typer(nodes.app, name="node")
app.add_typer(topics.app, name="topic")


def run() -> int:
    """Run the command line; its exit code. What goes wrong is one sentence on the standard error stream."""
    try:
        app()
    except NepError as error:
        say_error(str(error))
        return 1
    except BrokenPipeError:
        # Whoever read us (`nep topic echo x | head`) has enough; Python must not flush into it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0
