"""Translation of typer's own output: usage line, built-in options and usage errors.

Half of typer's messages are translated with gettext, to which `nep.i18n.set_initial_language` adds nep's
catalogue. The messages in this module are matched by their English text, so messages of later typer versions
may remain English.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from nep.cli.typer_values import skip_needless_imports
from nep.i18n import _, lazy
from nep.text import escaped

_BUILTIN_HELP_TEXTS = frozenset({
    lazy("Show this message and exit."),
    lazy("Install completion for the current shell."),
    lazy("Show completion for the current shell, to copy it or customize the installation."),
})  # fmt: skip
_USAGE_PARTS = frozenset({lazy("[OPTIONS]"), lazy("COMMAND [ARGS]...")})
_USAGE_ERRORS = (
    lazy("Missing argument {name}."),
    lazy("Missing option {name}."),
    lazy("No such option: {option} (Possible options: {options})"),
    lazy("No such option: {option}"),
    lazy("No such command {name}. Did you mean {others}?"),
    lazy("No such command {name}."),
    lazy("Option {option} requires an argument."),
    lazy("Option {option} does not take a value."),
    lazy("Got unexpected extra argument(s) ({arguments})"),
    lazy("Invalid value for {name}: {reason}"),
    lazy("Invalid value: {reason}"),
    lazy("Input should be a valid integer, unable to parse string as an integer"),
    lazy("Input should be a valid number, unable to parse string as a number"),
    lazy("Input should be greater than or equal to {limit}"),
    lazy("Input should be less than or equal to {limit}"),
)
"""Templates of usage errors; the first matching template is used."""
_UsageError: Any = typer.BadParameter.__mro__[1]
"""Base class of typer's usage errors, which has no public name."""


def translate_usage_error(english: str) -> str:
    """Translate a usage error of typer; an unknown message is returned unchanged."""
    for message, pattern in _usage_error_patterns():
        match = pattern.fullmatch(english)
        if match is not None:
            return _(message).format(
                **{name: translate_usage_error(value) for name, value in match.groupdict().items()}
            )
    return english


@cache
def _usage_error_patterns() -> Sequence[tuple[str, re.Pattern[str]]]:
    return [
        (message, re.compile(re.sub(r"\\\{(\w+)\\\}", r"(?P<\1>.+)", re.escape(message)), re.DOTALL))
        for message in _USAGE_ERRORS
    ]


@contextmanager
def _translate_usage_errors() -> Iterator[None]:
    try:
        yield
    except _UsageError as error:
        english = error.format_message()
        message = escaped(translate_usage_error(english), lines=True)  # may contain untrusted names
        if message == english:
            raise
        raise _UsageError(message, ctx=error.ctx) from error


def _prepare(parameters: Sequence[Any]) -> Sequence[Any]:
    for parameter in parameters:
        skip_needless_imports(parameter)
        if getattr(parameter, "help", None) in _BUILTIN_HELP_TEXTS:
            parameter.help = _(parameter.help)
    return parameters


def _write_usage(command: Any, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 - typer's types are not public
    pieces = [_(piece) if piece in _USAGE_PARTS else piece for piece in command.collect_usage_pieces(ctx)]
    formatter.write_usage(ctx.command_path, " ".join(pieces), prefix=_("Usage:") + " ")


def _join_paragraph_lines(text: str) -> str:
    return "\n\n".join(" ".join(paragraph.split("\n")) for paragraph in text.split("\n\n"))


class TranslatedCommand(TyperCommand):
    """Command with translated help texts."""

    def format_help(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401
        """Write the help with each paragraph joined to one line, because rich wraps the lines."""
        text = self.help
        self.help = _join_paragraph_lines(text or "")
        try:
            super().format_help(ctx, formatter)
        finally:
            self.help = text

    def get_params(self, ctx: Any) -> Any:  # noqa: ANN401
        """Return the parameters of the command; the help of built-in options is translated."""
        return _prepare(super().get_params(ctx))

    def format_usage(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401
        """Write the translated usage line."""
        _write_usage(self, ctx, formatter)


class TranslatedGroup(TyperGroup):
    """Command group with translated help texts and usage errors."""

    def get_params(self, ctx: Any) -> Any:  # noqa: ANN401
        """Return the parameters of the group; the help of built-in options is translated."""
        return _prepare(super().get_params(ctx))

    def format_usage(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401
        """Write the translated usage line."""
        _write_usage(self, ctx, formatter)

    def make_context(self, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        """Parse the command line, translating usage errors."""
        with _translate_usage_errors():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401
        """Run the command, translating usage errors."""
        with _translate_usage_errors():
            return super().invoke(ctx)
