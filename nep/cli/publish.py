"""`nep topic pub`: publish by hand."""

from __future__ import annotations

import itertools
import sys
import threading
import time
from pathlib import Path
from typing import Annotated

import orjson
import typer

from nep.cli.complete import complete_topic
from nep.cli.graphs import node_for
from nep.cli.options import MasterOption
from nep.cli.screen import say
from nep.errors import EncodeError, NepError
from nep.pubsub import Publisher

_SHOWN = 40
_TEXT_TYPES = frozenset({"string"})
_BYTE_TYPES = frozenset({"bytes", "image", "images"})


_Payload = Annotated[
    str,
    typer.Argument(
        help="What to publish: JSON, or plain text for the type string; @FILE takes it from a file, "
        "- takes each line of the standard input.",
        show_default=False,
    ),
]
_TypeOption = Annotated[
    str | None,
    typer.Option(
        "--type",
        "-t",
        metavar="TYPE",
        help="The topic's type; else the one it has, else json.",
        show_default=False,
    ),
]
_RateOption = Annotated[
    float | None,
    typer.Option(
        "--rate",
        "-r",
        metavar="HZ",
        help="Publish again and again, so often a second.",
        show_default=False,
    ),
]


def publish(
    topic: Annotated[
        str,
        typer.Argument(help="The topic to publish.", show_default=False, autocompletion=complete_topic),
    ],
    payload: _Payload,
    msg_type: _TypeOption = None,
    rate_hz: _RateOption = None,
    count: Annotated[
        int, typer.Option("--count", "-n", min=0, metavar="N", help="With --rate: end after N.")
    ] = 0,
    latched: Annotated[
        bool, typer.Option("--latched", help="Stay, and give it to whoever subscribes later.")
    ] = False,
    master: MasterOption = None,
) -> None:
    """Publish once, or with --rate again and again. Ctrl+C ends it."""
    if rate_hz is not None and not 0 < rate_hz <= 10_000:
        raise typer.BadParameter("a rate is more than 0 and at most 10000 a second", param_hint="--rate")
    with node_for("pub", master) as node:
        known = node.graph().topics.get(topic)
        kind = msg_type or (known.msg_type if known else "json")
        value = None if payload == "-" else value_of(payload, kind)
        with node.new_pub(topic, kind, latched=latched) as publisher:
            if payload == "-":
                _publish_lines(publisher, kind)
            else:
                _repeat(publisher, value, rate_hz or 1.0, count if rate_hz is not None else 1)
            say(f"published {publisher.count} on '{topic}' ({kind}) to {_people(publisher.subscribers)}")
            if latched:
                say("kept for whoever subscribes later; Ctrl+C ends it")
                _wait_for_ever()


def value_of(text: str, msg_type: str) -> object:
    """The payload that `text` stands for. Raises `NepError` with a sentence."""
    if text.startswith("@"):
        data = _read(Path(text[1:]), msg_type)
        if msg_type in _BYTE_TYPES:
            return data
        text = data.decode("utf-8", "replace")
    if msg_type in _TEXT_TYPES:
        return text
    if msg_type == "bytes":
        return text.encode()
    if msg_type in _BYTE_TYPES:
        raise EncodeError(msg_type, "str", "name a JPEG or PNG file: @picture.jpg")
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError as error:
        shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]} …"
        reason = f"put a text into quotes ('\"{text[:20]}\"'), or use --type string"
        raise NepError(f"'{shown}' is no JSON; {reason}") from error


def _read(file: Path, msg_type: str) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise EncodeError(msg_type, "file", f"'{file}' cannot be read: {error.strerror}") from error


def _publish_lines(publisher: Publisher, msg_type: str) -> None:
    """Publish each line of the standard input."""
    for line in sys.stdin:
        publisher.publish(value_of(line.rstrip("\r\n"), msg_type))


def _repeat(publisher: Publisher, value: object, rate_hz: float, count: int) -> None:
    """Publish at even distances, by the clock, so that slow publishing does not add up."""
    never = threading.Event()
    started = time.monotonic()
    for number in itertools.count(1):
        publisher.publish(value)
        if number == count:
            return
        never.wait(max(0.0, started + number / rate_hz - time.monotonic()))


def _wait_for_ever() -> None:
    never = threading.Event()
    while not never.wait(0.1):
        pass  # in slices: Windows does not interrupt a wait for Ctrl+C


def _people(subscribers: int) -> str:
    return (
        "nobody" if subscribers == 0 else "1 subscriber" if subscribers == 1 else f"{subscribers} subscribers"
    )
