"""`nep wire`: conformance tests for clients of the native wire."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.options import JsonOption
from nep.cli.screen import console, print_error_message, print_status, show_json, write
from nep.cli.typer_texts import TranslatedGroup
from nep.i18n import _, ngettext
from nep.system.lazy_import import lazy_module
from nep.text import escaped

if TYPE_CHECKING:
    from nep.programs import conformance
else:  # the other commands need not wait for it
    conformance = lazy_module("nep.programs.conformance")

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup, no_args_is_help=True, help=_("Test clients of the native wire, in any language.")
)
CommandArgument = Annotated[
    list[str] | None,
    typer.Argument(
        help=_("Command that starts the adapter, after '--'."), metavar=_("COMMAND"), show_default=False
    ),
]
RuleOption = Annotated[
    list[str] | None,
    typer.Option(
        "--rule", metavar=_("ID"), help=_("Check only this rule. Can be repeated."), show_default=False
    ),
]
ListOption = Annotated[bool, typer.Option("--list", help=_("List the rules and exit."))]
_STYLES = {"passed": "green", "failed": "bold red", "skipped": "dim"}
_USAGE_EXIT_CODE = 2


@app.callback()
def wire() -> None:
    """Test clients of the native wire, in any language."""


@app.command("check")
def check(
    command: CommandArgument = None,
    rule: RuleOption = None,
    list_rules: ListOption = False,
    as_json: JsonOption = False,
) -> None:
    """Check a client library against the rules of the native wire.

    COMMAND starts an adapter: a small program that reads requests from standard input and executes them with
    the client library. NEP_MASTER contains the address of the tester's master. See docs/wire-check.md.

    Exits with 0 if no rule failed, 1 if a rule failed, and 2 if the adapter can't be started.
    """
    try:
        rules = conformance.select_rules(rule or ())
    except KeyError as error:
        raise typer.BadParameter(
            _("unknown rule '{id}'; '--list' shows all rules").format(id=error.args[0]), param_hint="--rule"
        ) from error
    if list_rules:
        _show_rules(rules, as_json=as_json)
        return
    if not command:
        raise typer.BadParameter(_("specify the command of the adapter after '--'"), param_hint="COMMAND")
    outcomes = []
    try:
        for outcome in conformance.check(lambda master: conformance.AdapterProcess(command, master), rules):
            outcomes.append(outcome)
            if not as_json:
                _show_outcome(outcome)
    except conformance.AdapterError as error:
        print_error_message(str(error))
        raise typer.Exit(_USAGE_EXIT_CODE) from error
    failed = sum(each.status == "failed" for each in outcomes)
    if as_json:
        show_json([each.to_plain() for each in outcomes])
    else:
        _print_summary(outcomes, failed)
    raise typer.Exit(1 if failed else 0)


def _show_rules(rules: list[conformance.Rule], *, as_json: bool) -> None:
    if as_json:
        show_json(
            [{"id": rule.id, "requirement": _(rule.requirement), "features": rule.features} for rule in rules]
        )
        return
    width = max(len(rule.id) for rule in rules)
    for rule in rules:
        write(f"{rule.id:{width}}  {_(rule.requirement)}\n")


def _show_outcome(outcome: conformance.Outcome) -> None:
    from rich.text import Text  # noqa: PLC0415 - see `nep.cli.screen.console`

    labels = {"passed": _("passed"), "failed": _("failed"), "skipped": _("skipped")}
    out = console()
    out.print(Text.assemble((labels[outcome.status], _STYLES[outcome.status]), f"  {outcome.rule.id}"))
    if outcome.status == "failed":
        fields = outcome.to_plain()
        for line in (fields["requirement"], outcome.observation, fields["section"]):
            out.print(Text(f"    {escaped(str(line))}"))
    elif outcome.status == "skipped":
        out.print(Text(f"    {escaped(outcome.observation)}", "dim"))


def _print_summary(outcomes: list[conformance.Outcome], failed: int) -> None:
    skipped = sum(each.status == "skipped" for each in outcomes)
    passed = len(outcomes) - failed - skipped
    parts = [ngettext("{count} rule passed", "{count} rules passed", passed).format(count=passed)]
    if failed:
        parts.append(ngettext("{count} failed", "{count} failed", failed).format(count=failed))
    if skipped:
        parts.append(ngettext("{count} skipped", "{count} skipped", skipped).format(count=skipped))
    print_status(", ".join(parts))
