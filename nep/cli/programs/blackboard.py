"""`nep blackboard`: run a blackboard for other programs, and show the values of a blackboard."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nep.cli import interrupts
from nep.cli.complete import complete_topic
from nep.cli.options import JsonOption, MasterOption, check_duration
from nep.cli.screen import UNKNOWN, TextColumn, format_rounded_duration, print_status, show_json, show_table
from nep.cli.typer_texts import TranslatedGroup
from nep.cli.values import format_payload
from nep.errors import NepError, NoServerError, RequestRefusedError, ServiceError
from nep.i18n import _, lazy, ngettext
from nep.nodes.node import Node
from nep.system.lazy_import import lazy_module
from nep.text import escaped, quotable

if TYPE_CHECKING:
    from nep.programs.blackboard import board as boards
    from nep.programs.blackboard import server as servers
else:
    boards, servers = (
        lazy_module("nep.programs.blackboard.board"),
        lazy_module("nep.programs.blackboard.server"),
    )

_DEFAULT_TOPIC = "/blackboard"
"""Topic on which RIZE programs publish perceptions."""
_DEFAULT_NAME = "blackboard"
_TIMEOUT_S = 5.0
_RUN_COMMAND = "run"
_COLUMNS = (
    TextColumn(lazy("key"), style="bold", is_folded_last=True),
    TextColumn(lazy("value"), style="green"),
    TextColumn(lazy("age"), "right"),
    TextColumn(lazy("based on")),
    TextColumn(lazy("from"), style="cyan"),
    TextColumn(lazy("robot"), style="cyan"),
)


def _check_lifetime(lifetime_s: float | None) -> float | None:
    if lifetime_s is not None and not lifetime_s > 0.0:  # rejects NaN, too
        raise typer.BadParameter(
            _("{given:g} isn't a valid lifetime; use a number of seconds greater than 0").format(
                given=lifetime_s
            )
        )
    return lifetime_s


class _DefaultRunGroup(TranslatedGroup):
    """Group in which `nep blackboard TOPIC` means `nep blackboard run TOPIC`."""

    def parse_args(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - see `TranslatedGroup`
        """Insert the subcommand `run` if the first word is not a subcommand."""
        if not args or (args[0] not in self.commands and args[0] not in ctx.help_option_names):
            args = [_RUN_COMMAND, *args]
        return super().parse_args(ctx, args)


app: typer.Typer = typer.Typer(
    cls=_DefaultRunGroup,
    help=_("Run a blackboard of topics' newest values, or show its values and their ages."),
)
_NameOption = Annotated[
    str,
    typer.Option(
        "--name",
        metavar=_("NAME"),
        help=_("Name of the blackboard, prefix of its services and topic (default: blackboard)."),
        show_default=False,
    ),
]


@app.command(_RUN_COMMAND)
def run(
    topics: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[KEY=]TOPIC",
            help=_(
                "Topics or patterns to store, optionally as KEY=TOPIC, such as "
                "human=/perception/humans (default: /blackboard)."
            ),
            show_default=False,
            autocompletion=complete_topic,
        ),
    ] = None,
    name: _NameOption = _DEFAULT_NAME,
    lives_s: Annotated[
        float | None,
        typer.Option(
            "--lives",
            metavar=_("SECONDS"),
            help=_("Delete values that haven't been updated for this long (default: never)."),
            show_default=False,
            callback=_check_lifetime,
        ),
    ] = None,
    max_keys: Annotated[
        int | None,
        typer.Option("--max-keys", min=1, metavar="N", help=_("Store at most N values."), show_default=False),
    ] = None,
    master: MasterOption = None,
) -> None:
    """Run a blackboard: store the newest values of topics and serve them until Ctrl+C.

    Changes are published on /blackboard/changes. The services are blackboard/get, blackboard/set and
    blackboard/keys.
    """
    interrupts.exit_on_termination()
    with (
        Node(name.strip("/").replace("/", "-"), master=master) as node,
        boards.Blackboard(node, max_keys=boards.MAX_KEYS if max_keys is None else max_keys) as board,
        servers.BlackboardServer(node, board, name),
    ):
        for topic, key in map(_topic_and_key, topics or [_DEFAULT_TOPIC]):
            board.watch(topic, key=key, lives_s=lives_s)
        print_status(_("running blackboard '{name}'; press Ctrl+C to stop").format(name=name))
        node.spin()


@app.command("show")
def show(
    pattern: Annotated[
        str,
        typer.Argument(
            metavar=_("PATTERN"),
            help=_("Keys to show; may have wildcards, such as 'human.*.position' (default: all)."),
            show_default=False,
        ),
    ] = "**",
    name: _NameOption = _DEFAULT_NAME,
    timeout_s: Annotated[
        float,
        typer.Option(
            "--timeout",
            metavar=_("SECONDS"),
            help=_("Maximum time to wait for the blackboard's reply (default: {seconds:g}).").format(
                seconds=_TIMEOUT_S
            ),
            show_default=False,
            callback=check_duration,
        ),
    ] = _TIMEOUT_S,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the values of a blackboard with their ages, based on time stamps or on times of arrival."""
    with Node(f"nep-blackboard-show-{os.getpid()}", master=master) as node:
        client = node.new_client(servers.service_name(name, "get"), timeout_s=timeout_s)
        try:
            reply = client.call({"pattern": pattern})
        except NoServerError as error:
            raise _no_blackboard_error(name) from error
        except ServiceError as error:
            raise RequestRefusedError(error.reason) from error
    entries = _entries(reply)
    if as_json:
        show_json(entries)
        return
    if entries:
        show_table(_COLUMNS, [_row(each) for each in entries])
    else:
        print_status(_("no matching values"))
    hidden_count = reply.get("more") if isinstance(reply, Mapping) else 0
    if isinstance(hidden_count, int) and hidden_count:
        template = ngettext("and {count} more value", "and {count} more values", hidden_count)
        print_status(template.format(count=hidden_count))


def _topic_and_key(argument: str) -> tuple[str, str | None]:
    key, equals, topic = argument.partition("=")
    return (topic, key) if equals and "/" not in key else (argument, None)


def _no_blackboard_error(name: str) -> NepError:
    return NepError(
        _("no blackboard '{name}' is running; start one with 'nep blackboard'").format(name=escaped(name))
    )


def _entries(reply: object) -> Sequence[Mapping[str, object]]:
    entries = reply.get("entries") if isinstance(reply, Mapping) else None
    if not isinstance(entries, list) or not all(isinstance(each, Mapping) for each in entries):
        raise NepError(_("the service that replied isn't a blackboard; use another --name"))
    return entries


def _row(entry: Mapping[str, object]) -> tuple[str, ...]:
    age_s = entry.get("age_s")
    return (
        quotable(entry.get("key")),
        format_payload(entry.get("value"), in_full=False),
        _format_age(age_s) if isinstance(age_s, int | float) else UNKNOWN,
        {"stamp": _("stamp"), "arrival": _("arrival")}.get(quotable(entry.get("age_by")), UNKNOWN),
        quotable(entry.get("source") or UNKNOWN),
        quotable(entry.get("robot") or UNKNOWN),
    )


def _format_age(age_s: float) -> str:
    return f"{age_s:.1f} s" if age_s < 10 else format_rounded_duration(age_s)
