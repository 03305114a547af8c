"""`nep topic pub`: publish messages from the command line."""

from __future__ import annotations

import errno
import itertools
import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from nep.cli.complete import complete_topic
from nep.cli.json_input import decode_text, parse_json
from nep.cli.network import BackendOption, open_command_node
from nep.cli.options import MasterOption
from nep.cli.screen import format_size, print_status
from nep.errors import EncodeError, NepError
from nep.i18n import _, ngettext
from nep.messages.codecs import CODECS, JSON, codec_for
from nep.messages.encoded import Encoded
from nep.nodes.arguments import check_type_name
from nep.nodes.publisher import Publisher
from nep.protocol.graph_view import TopicInfo
from nep.text import escaped

_MAX_FILE_BYTES = 10**9
"""Size limit of input files, far above any message; reading a device such as /dev/zero would never end."""
_MAX_CATCH_UP_S = 0.01
_WAIT_SLICE_S = 0.02


_PayloadArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("MESSAGE"),
        help=_(
            "Message as JSON, or as plain text for the type string. @FILE reads it from a file, - "
            "publishes each line of standard input."
        ),
        show_default=False,
    ),
]


def _check_type(value: str | None) -> str | None:
    try:
        return check_type_name("it", value) if value else None
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error


_TypeOption = Annotated[
    str | None,
    typer.Option(
        "--type",
        "-t",
        metavar=_("TYPE"),
        help=_("Message type (default: the topic's, or json)."),
        show_default=False,
        callback=_check_type,
    ),
]
_RateOption = Annotated[
    float | None,
    typer.Option(
        "--rate",
        "-r",
        metavar="HZ",
        help=_("Publish repeatedly, HZ times a second."),
        show_default=False,
    ),
]


_TopicArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("TOPIC"),
        help=_("Topic to publish on."),
        show_default=False,
        autocompletion=complete_topic,
    ),
]
_CountOption = Annotated[
    int,
    typer.Option(
        "--count", "-n", min=0, metavar="N", help=_("With --rate: exit after N messages (0: never).")
    ),
]
_LatchedOption = Annotated[
    bool, typer.Option("--latched", help=_("Keep running, and send the last message to new subscribers."))
]
_WaitOption = Annotated[
    int,
    typer.Option(
        "--wait",
        "-w",
        min=0,
        metavar="N",
        help=_("Wait for N subscribers before the first message."),
        show_default=False,
    ),
]


def publish(
    topic: _TopicArgument,
    payload: _PayloadArgument,
    msg_type: _TypeOption = None,
    rate_hz: _RateOption = None,
    count: _CountOption = 0,
    latched: _LatchedOption = False,
    master: MasterOption = None,
    wait: _WaitOption = 0,
    backend: BackendOption = None,
) -> None:
    """Publish a message once, or with --rate repeatedly until Ctrl+C.

    There is no confirmation, even if the topic moves a robot.
    """
    if rate_hz is not None and not 0 < rate_hz <= 10_000:
        raise typer.BadParameter(
            _("the rate must be greater than 0 and at most 10000 Hz"), param_hint="--rate"
        )
    with open_command_node("pub", master, backend) as node:
        topic_info = node.graph().topics.get(topic)
        kind = msg_type or (topic_info.msg_type if topic_info else "json")
        _warn_about_type(topic, kind, topic_info)
        value = None if payload == "-" else encode_payload(payload, kind)
        with node.new_pub(topic, kind, latched=latched) as publisher:
            wait_for_subscribers(publisher, wait)
            if payload == "-":
                _publish_lines(publisher, kind)
            else:
                repeat(partial(publisher.publish, value), rate_hz or 1.0, count if rate_hz is not None else 1)
            template = ngettext(
                "published {count} message on '{topic}' ({kind}) to {subscribers}",
                "published {count} messages on '{topic}' ({kind}) to {subscribers}",
                publisher.count,
            )
            subscribers = _subscriber_text(publisher.subscribers)
            print_status(
                template.format(count=publisher.count, topic=topic, kind=kind, subscribers=subscribers)
            )
            if latched:
                print_status(_("keeping the message for later subscribers; press Ctrl+C to stop"))
                _wait_forever()


def _warn_about_type(topic: str, kind: str, topic_info: TopicInfo | None) -> None:
    if topic_info is not None and topic_info.publishers and topic_info.msg_type != kind:
        print_status(
            _("'{topic}' is published with the type '{msg_type}', not '{kind}'").format(
                topic=topic, msg_type=topic_info.msg_type, kind=kind
            )
        )
    elif codec_for(kind) is JSON and (matches := get_close_matches(kind, CODECS, n=1)) and matches[0] != kind:
        print_status(
            _("the type '{kind}' is sent as JSON; did you mean '{near}'?").format(kind=kind, near=matches[0])
        )


def encode_payload(text: str, msg_type: str, first_line: int = 1) -> Encoded:
    """Parse and encode the payload in `text`, so that an invalid value fails before publishing.

    Args:
        text: JSON, text, or @FILE.
        msg_type: Message type of the topic.
        first_line: Line number of `text` in standard input, for error messages.

    Raises:
        NepError: The text can't be parsed or encoded.
    """
    return codec_for(msg_type).encode(parse_payload(text, msg_type, first_line))


def parse_payload(text: str, msg_type: str, first_line: int = 1) -> object:
    """Parse a payload from the command line, from standard input, or from a file.

    Args:
        text: JSON, text, or @FILE.
        msg_type: Message type of the topic.
        first_line: Line number of `text` in standard input, for error messages.

    Raises:
        NepError: The text can't be parsed, or the file can't be read.
    """
    file: str | None = None
    codec = codec_for(msg_type)
    content = codec.content
    if text.startswith("@"):
        data = read_file(Path(text[1:]), msg_type)
        if content in {"bytes", "image"}:
            return data
        file, text = text[1:], decode_text(data, text[1:])
    if content == "text":
        return text
    if content == "bytes":
        return _encode_argument(text)
    if content == "image":
        raise EncodeError(msg_type, "str", _("specify a JPEG or PNG file, such as @image.jpg"))
    return parse_json(text, file=file, first_line=first_line, allow_nan=codec is not JSON, suggest_types=True)


def _encode_argument(text: str) -> bytes:
    # surrogateescape restores typed bytes that are not UTF-8.
    try:
        return text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError as error:
        raise EncodeError("bytes", "str", _("the text contains an unpaired surrogate")) from error


def read_file(file: Path, msg_type: str) -> bytes:
    """Read a file of at most `_MAX_FILE_BYTES`.

    Args:
        file: Path of the file.
        msg_type: Message type, for error messages.

    Raises:
        EncodeError: The file is larger, or can't be read.
    """
    shown_path = escaped(str(file))
    try:
        with file.open("rb") as stream:  # bounded: it may be a pipe or an endless device
            data = stream.read(_MAX_FILE_BYTES + 1)
    except OSError as error:
        raise EncodeError(
            msg_type,
            "file",
            _("can't read '{file}': {reason}").format(file=shown_path, reason=error.strerror),
        ) from error
    except ValueError as error:  # characters that this system doesn't allow in file names
        raise EncodeError(
            msg_type, "file", _("'{file}' isn't a valid file name").format(file=shown_path)
        ) from error
    if len(data) > _MAX_FILE_BYTES:
        raise EncodeError(
            msg_type,
            "file",
            _("'{file}' is larger than {most}, the maximum message size").format(
                file=shown_path, most=format_size(_MAX_FILE_BYTES)
            ),
        )
    return data


def _publish_lines(publisher: Publisher, msg_type: str) -> None:
    for number, line in enumerate(_stdin_lines(), 1):
        data = line.rstrip(b"\r\n")
        if codec_for(msg_type).content == "bytes":
            publisher.publish(data)
            continue
        try:
            text = data.decode()
        except UnicodeDecodeError as error:
            template = _(
                "byte {byte} of line {line} isn't valid UTF-8; convert the text to UTF-8, or use --type bytes"
            )
            raise NepError(template.format(byte=error.start + 1, line=number)) from error
        publisher.publish(encode_payload(text, msg_type, number))


def _stdin_lines() -> Iterator[bytes]:
    try:
        if sys.stdin.isatty():  # the Windows console gives text, not bytes
            yield from (line.encode("utf-8", "surrogateescape") for line in sys.stdin)
        else:
            yield from sys.stdin.buffer
    except OSError as error:
        reason = _("it is closed") if error.errno == errno.EBADF else (error.strerror or str(error)).lower()
        raise NepError(_("can't read standard input: {why}").format(why=reason)) from error


def repeat(
    send: Callable[[], object],
    rate_hz: float,
    count: int,
    *,
    clock: Callable[[], float] = time.monotonic,
    wait: Callable[[float], object] | None = None,
) -> None:
    """Call `send` repeatedly at a fixed rate.

    After a delay of more than `_MAX_CATCH_UP_S` (suspended computer or process), missed calls are skipped
    instead of being made up in a burst.

    Args:
        send: Function to call.
        rate_hz: Calls per second.
        count: Number of calls; 0 for no limit.
        clock: Monotonic clock in seconds.
        wait: Waits for a number of seconds.
    """
    wait_s, period_s = wait or threading.Event().wait, 1 / rate_hz
    due = clock()
    for number in itertools.count(1):
        send()
        if number == count:
            return
        due += period_s
        late_s = clock() - due
        if late_s > _MAX_CATCH_UP_S:
            due += math.ceil(late_s / period_s) * period_s
        wait_s(max(0.0, due - clock()))


def wait_for_subscribers(publisher: Publisher, count: int) -> None:
    """Block until `count` subscribers are connected; print a status message first if any are missing."""
    if publisher.subscribers >= count:
        return
    template = ngettext(
        "waiting for {count} subscriber; press Ctrl+C to stop",
        "waiting for {count} subscribers; press Ctrl+C to stop",
        count,
    )
    print_status(template.format(count=count))
    never = threading.Event()
    while publisher.subscribers < count:
        never.wait(_WAIT_SLICE_S)


def _wait_forever() -> None:
    never = threading.Event()
    while not never.wait(0.1):
        pass  # in slices: Ctrl+C does not interrupt a wait on Windows


def _subscriber_text(subscribers: int) -> str:
    if subscribers == 0:
        return _("no subscribers")
    return ngettext("{count} subscriber", "{count} subscribers", subscribers).format(count=subscribers)
