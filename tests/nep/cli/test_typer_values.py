"""Tests that command-line values are converted as by typer, without the import of pydantic."""

from __future__ import annotations

import subprocess
import sys
from enum import Enum
from typing import Annotated

import pytest
import typer
from typer.core import TyperCommand
from typer.testing import CliRunner

from nep.cli.typer_texts import TranslatedCommand


class Order(Enum):
    """Values of an option with choices."""

    NAME = "name"
    RATE = "rate"


def converted(cls: type[TyperCommand], arguments: tuple[str, ...]) -> tuple[int, str]:
    """Return the exit code of a command with parameters of each type, and the values that it gets."""
    app = typer.Typer()

    @app.command(cls=cls)
    def command(
        names: Annotated[list[str] | None, typer.Argument()] = None,
        count: Annotated[int, typer.Option(min=0)] = 3,
        port: Annotated[int | None, typer.Option(min=1, max=9)] = None,
        every_s: Annotated[float, typer.Option(min=0.5)] = 1.0,
        timeout_s: Annotated[float | None, typer.Option()] = None,
        text: Annotated[str | None, typer.Option()] = None,
        flag: Annotated[bool, typer.Option("--flag")] = False,
        order: Annotated[Order, typer.Option()] = Order.NAME,
    ) -> None:
        typer.echo(repr((names, count, port, every_s, timeout_s, text, flag, order)))

    done = CliRunner().invoke(app, arguments)
    return done.exit_code, done.output


@pytest.mark.parametrize(
    "line",
    [
        "", "a", "a b --text c", "--text=", "--count 7", "--count 007", "--count -1", "--count 1_0",
        "--count ٣", "--count 1.0", "--count x", "--count=", "--count 99999999999999999999", "--port 9",
        "--port 10", "--every-s 2", "--every-s 0.4", "--every-s .5", "--every-s 1e3", "--timeout-s nan",
        "--timeout-s -1.25", "--timeout-s 5", "--timeout-s x", "--flag", "--order rate", "--order x",
        "--text \udc80", "é “x”",
    ],
)  # fmt: skip
def test_values_are_converted_as_by_typer(line: str) -> None:
    arguments = tuple(line.split(" ")) if line else ()
    assert converted(TranslatedCommand, arguments) == converted(TyperCommand, arguments)


def test_commands_with_ordinary_values_do_not_import_pydantic() -> None:
    code = (
        "import sys\n"
        "from nep.cli.app import run\n"
        "sys.argv = 'nep --master 127.0.0.1:1 topic echo t u -n 1 --timeout 0.1'.split()\n"
        "assert run() == 1\n"
        "sys.exit('pydantic' in sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
