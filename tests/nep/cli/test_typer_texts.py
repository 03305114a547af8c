"""Tests of the translation of typer's own texts: its help and its command-line errors."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from nep.cli.app import app
from nep.cli.typer_texts import translate_usage_error
from tests.pseudo import untranslated

OURS = ("nep", "topic", "echo", "pub", "hz", "list", "root", "payload", "count", "json", "timeout", "mastr")


@pytest.mark.parametrize(
    "line",
    [
        "topic ecko", "topic xyz", "topic hz", "topic echo x --count abc", "topic echo x --count -3",
        "topic echo x --timeout", "topic echo x --timeout abc", "topic echo x --timeout=-1",
        "topic list extra", "topic echo x --json=3", "topic --mastr", "--mastr x",
    ],
)  # fmt: skip
@pytest.mark.usefixtures("pseudo")
def test_command_line_errors_are_translated(line: str) -> None:
    done = CliRunner().invoke(app, line.split(), env={"COLUMNS": "400"})
    assert done.exit_code == 2
    (said,) = [row for row in done.output.splitlines() if row.startswith("│")]
    assert untranslated(said, *OURS, "ecko", "xyz", "abc", "extra", "x", "n", "master", "TOPIC") == []


def test_unknown_typer_text_stays_in_english() -> None:
    assert translate_usage_error("Something else entirely.") == "Something else entirely."
    assert translate_usage_error("Missing argument '{x}'.") == "Missing argument '{x}'."


@pytest.mark.parametrize("line", ["--help", "topic --help", "topic echo --help"])
def test_typer_texts_in_the_help_are_translated_to_spanish(line: str) -> None:
    """Runs as a process because typer creates some of its texts when it is imported."""
    environ = {**os.environ, "NEP_LANG": "es", "COLUMNS": "200", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, "-m", "nep", *line.split()],
        env=environ, capture_output=True, encoding="utf-8", check=True,
    )  # fmt: skip
    assert "Uso: " in done.stdout
    assert "Muestra este mensaje y termina." in done.stdout
    for english in ("Usage", "OPTIONS", "COMMAND", "Options", "Commands", "Arguments", "Show this", "env var",
                    "Install", "completion for", "default:", "required"):  # fmt: skip
        assert english not in done.stdout


def test_english_help_matches_typer() -> None:
    done = CliRunner().invoke(app, ["topic", "--help"])
    assert "Usage: nep topic [OPTIONS] COMMAND [ARGS]..." in done.output
    assert "Show this message and exit." in done.output
