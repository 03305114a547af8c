"""`nep log`: print log records of nodes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from datetime import datetime, timezone
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.complete import complete_node
from nep.cli.network import open_command_node
from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import console, print_status, show_json, write
from nep.cli.values import escape_for_terminal
from nep.errors import DecodeError, did_you_mean
from nep.i18n import _
from nep.messages.message import Message
from nep.nodes.log_handler import (
    LAST_ERRORS_TOPIC,
    LAST_ERRORS_TYPE,
    LEVELS,
    LOG_TOPIC,
    LOG_TYPE,
    MAX_TEXT_LENGTH,
    LogRecord,
    NewErrorFilter,
    parse_level,
)
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.text import escaped, shortened

if TYPE_CHECKING:
    from rich.text import Text

_STYLES = {"debug": "dim", "warning": "yellow", "error": "red", "critical": "bold red"}


def _complete_level(incomplete: str) -> list[str]:
    return [level for level in LEVELS if level.startswith(incomplete)]


def log(
    level: Annotated[
        str,
        typer.Option(
            "--level",
            "-l",
            metavar=_("LEVEL"),
            help=_("Lowest level to print."),
            autocompletion=_complete_level,
        ),
    ] = "info",
    node: Annotated[
        str | None,
        typer.Option(
            "--node",
            metavar=_("NAME"),
            help=_("Only records of this node."),
            show_default=False,
            autocompletion=complete_node,
        ),
    ] = None,
    count: Annotated[
        int, typer.Option("--count", "-n", min=0, metavar="N", help=_("Exit after N records (0: never)."))
    ] = 0,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print log records: the last errors of running nodes, then new records until Ctrl+C.

    Robot drivers, behaviours and the master write log records; your own program can use node.log.
    """
    if level.lower() not in {*LEVELS, "warn"}:
        raise typer.BadParameter(
            _("unknown level '{level}'; {did_you_mean}").format(
                level=level, did_you_mean=did_you_mean(level, LEVELS)
            ),
            param_hint="--level",
        )
    min_level = LEVELS.index(parse_level(level))
    with open_command_node("log", master) as own_node, own_node.new_sub(LOG_TOPIC, LOG_TYPE) as subscriber:
        if not as_json:
            print_status(_("waiting for log records; press Ctrl+C to stop"))
        matching = (
            record
            for record in _receive_records(own_node, subscriber)
            if LEVELS.index(record.level) >= min_level and node in {None, record.node}
        )
        for record in itertools.islice(matching, count or None):
            show_json(record.to_plain()) if as_json else _show_record(record)


def _receive_records(own_node: Node, subscriber: Subscriber) -> Iterator[LogRecord]:
    error_filter = NewErrorFilter()
    with own_node.new_sub(LAST_ERRORS_TOPIC, LAST_ERRORS_TYPE) as last_errors_subscriber:
        # latched messages arrived while connecting
        lists = iter(partial(last_errors_subscriber.receive, 0.0), None)
        last_errors = [record for each in lists for record in _new_errors(each, error_filter)]
    yield from sorted(last_errors, key=lambda record: record.stamp_ns)
    while True:
        message = subscriber.receive()
        if message is None:
            continue
        try:
            record = LogRecord.from_plain(message.payload, message.stamp_ns)
        except DecodeError as error:
            record = LogRecord("warning", str(error), "nep", LOG_TOPIC, message.stamp_ns or 0)
        if error_filter.is_new(record):
            yield record


def _new_errors(message: Message, error_filter: NewErrorFilter) -> list[LogRecord]:
    try:
        return error_filter.new_records(message.payload)
    except DecodeError:
        return []


def _show_record(record: LogRecord) -> None:
    out = console()
    moment = datetime.fromtimestamp(record.stamp_ns / 1e9, tz=timezone.utc).astimezone()
    stamp = moment.strftime("%H:%M:%S.%f")[:-3]
    logger = f" [{escaped(record.name)}]" if record.name and record.name != record.node else ""
    if not out.is_terminal:
        write(
            f"{stamp}  {record.level:<8}  {escaped(record.node)}{logger}  "
            f"{escape_for_terminal(record.text)}\n"
        )
        return
    out.print(_coloured_line(stamp, record, logger))


def _coloured_line(stamp: str, record: LogRecord, logger: str) -> Text:
    from rich.text import Text  # noqa: PLC0415 - see `nep.cli.screen.console`

    style, text = _STYLES.get(record.level, ""), escape_for_terminal(shortened(record.text, MAX_TEXT_LENGTH))
    return Text.assemble(
        (stamp, "dim"), "  ", (f"{record.level:<8}", style), "  ", (escaped(record.node), "bold"),
        (logger, "dim"), "  ", (text, style),
    )  # fmt: skip
