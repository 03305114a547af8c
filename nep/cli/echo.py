"""`nep topic echo`: the messages of a topic as they come."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Callable
from datetime import datetime, timezone
from functools import partial
from typing import Annotated

import orjson
import typer

from nep.cli.complete import complete_field, complete_topic
from nep.cli.graphs import node_for
from nep.cli.options import JsonOption, MasterOption
from nep.cli.screen import UNKNOWN, console, json_painter, say, show_json, size
from nep.cli.table_file import Fields, Table
from nep.errors import DecodeError, WaitTimeoutError, did_you_mean
from nep.message import Message
from nep.nodes import Node
from nep.pubsub import Subscriber

_SHOWN_BYTES = 64


_FieldsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="FIELD",
        help="Show these fields only, such as pose.x or joints\\[3].",
        show_default=False,
        autocompletion=complete_field,
    ),
]


def echo(
    topic: Annotated[
        str,
        typer.Argument(help="The topic to look into.", show_default=False, autocompletion=complete_topic),
    ],
    fields: _FieldsArgument = None,
    count: Annotated[
        int, typer.Option("--count", "-n", min=0, metavar="N", help="End after N messages; 0 goes on.")
    ] = 0,
    timeout_s: Annotated[
        float | None,
        typer.Option(
            "--timeout", metavar="SECONDS", help="End when no message came for so long.", show_default=False
        ),
    ] = None,
    master: MasterOption = None,
    as_json: JsonOption = False,
    as_csv: Annotated[
        bool, typer.Option("--csv", help="Write the fields as comma-separated values, with their time.")
    ] = False,
) -> None:
    """Show the messages of a topic as they come. Ctrl+C ends it.

    Pictures are shown by their size, and what cannot be read as its bytes.
    """
    if as_csv and not fields:
        raise typer.BadParameter(f"name the fields: nep topic echo {topic} pose.x pose.y --csv")
    if as_csv and as_json:
        raise typer.BadParameter("--csv and --json are two ways to write; choose one")
    picked = Fields(fields or ())
    with node_for("echo", master) as node:
        known = node.graph().topics.get(topic)
        if known is None or not known.publishers:
            say(f"nobody publishes '{topic}' yet; {_near(node, topic)}waiting, Ctrl+C ends it")
        show = Table(picked) if as_csv else partial(show_record, fields=picked) if as_json else Lines(picked)
        with node.new_sub(topic, known.msg_type if known else "json") as subscriber:
            try:
                _follow(subscriber, show, count, timeout_s)
            finally:
                picked.say_missing()


def _follow(
    subscriber: Subscriber, show: Callable[[Message], object], count: int, timeout_s: float | None
) -> None:
    """Show message after message, until ``count`` when that is not 0. Raises `WaitTimeoutError`."""
    for number in itertools.count(1):
        show(_next(subscriber, timeout_s))
        if number == count:
            return


def _near(node: Node, topic: str) -> str:
    """Whether another topic was meant."""
    near = did_you_mean(topic, [name for name in node.graph().topics if name != topic])
    return f"{near} " if near.startswith("did") else ""


def _next(subscriber: Subscriber, timeout_s: float | None) -> Message:
    """The next message. Raises `WaitTimeoutError` after `timeout_s`; waits for ever when that is None."""
    message = subscriber.receive(timeout_s)
    if message is None:
        raise WaitTimeoutError(f"a message on '{subscriber.topic}'", timeout_s or 0.0)
    return message


def show_record(message: Message, fields: Fields | None = None) -> None:
    """One message as one line of JSON; with `fields` these in the place of the payload."""
    record: dict[str, object] = {
        "topic": message.topic,
        "msg_type": message.msg_type,
        "codec": message.codec,
        "stamp_ns": message.stamp_ns,
        "seq": message.seq,
        "publisher": message.publisher,
        "size_bytes": message.size_bytes,
    }
    if fields is not None and fields.names:
        values = fields.of(message)
        if values is None:
            return
        record["fields"] = fields.plain(values)
    elif message.codec == "image":
        record["payload"] = dict(message.extension)
    else:
        try:
            record["payload"] = message.payload
        except DecodeError as error:
            record["error"] = str(error)
            record["bytes"] = bytes(message.data).hex()
    show_json(record)


class Lines:
    """Messages for people: when, which, how big, and what, coloured on a terminal."""

    def __init__(self, fields: Fields | None = None) -> None:
        self._fields = fields
        self._console = console()
        self._paint = json_painter() if self._console.is_terminal else None

    def __call__(self, message: Message) -> None:
        """Show one message."""
        head = _head(message)
        if self._fields is not None and self._fields.names:
            values = self._fields.of(message)
            if values is None:
                return
            body = _dump(self._fields.plain(values))
        else:
            body = _body(message, self._console.width - len(head) - 2)
        if self._paint is None:
            print(f"{head}  {body}", flush=True)
        else:
            self._console.print(self._paint(head, body))


def _head(message: Message) -> str:
    stamp = UNKNOWN
    if message.stamp_ns is not None:
        stamp = (
            datetime.fromtimestamp(message.stamp_ns / 1e9, tz=timezone.utc)
            .astimezone()
            .strftime("%H:%M:%S.%f")[:-3]
        )
    seq = "" if message.seq is None else f"  #{message.seq}"
    return f"{stamp}{seq}"


def _body(message: Message, room: int) -> str:
    """What a message says: on one line if `room` letters are enough or nothing can be laid out."""
    if message.codec == "image":
        return _picture(message)
    try:
        payload = message.payload
    except DecodeError as error:
        return (
            f"{size(message.size_bytes)}, no {message.codec}: {_hexadecimal(message.data)} ({error.reason})"
        )
    if isinstance(payload, str):
        return payload
    if isinstance(payload, bytes):
        return f"{size(len(payload))}: {_hexadecimal(payload)}"
    line = _dump(payload)
    return line if len(line) <= room else "\n" + textwrap.indent(_dump(payload, indent=True), "  ")


def _hexadecimal(data: bytes | memoryview) -> str:
    return bytes(data[:_SHOWN_BYTES]).hex(" ") + (" …" if len(data) > _SHOWN_BYTES else "")


def _picture(message: Message) -> str:
    shape, encoding = message.extension.get("shape"), message.extension.get("encoding", "picture")
    if isinstance(shape, (list, tuple)) and len(shape) >= 2:
        return f"{encoding} {shape[1]} x {shape[0]}, {size(message.size_bytes)}"
    return f"{encoding}, {size(message.size_bytes)}"


def _dump(payload: object, *, indent: bool = False) -> str:
    option = orjson.OPT_NON_STR_KEYS | (orjson.OPT_INDENT_2 if indent else 0)
    return orjson.dumps(payload, default=str, option=option).decode()
