"""`nep topic echo`: print messages as they arrive."""

from __future__ import annotations

import itertools
import textwrap
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing
from datetime import datetime, timezone
from functools import partial
from typing import Annotated

import typer

from nep.cli.complete import complete_field_or_topic, complete_topic
from nep.cli.network import BackendOption, open_command_node
from nep.cli.options import JsonOption, MasterOption, TimeoutOption
from nep.cli.screen import (
    UNKNOWN,
    console,
    display_width,
    format_size,
    json_highlighter,
    print_status,
    show_json,
    write,
)
from nep.cli.topics.message_filter import MessageFilter
from nep.cli.topics.table_file import CsvMessageWriter, FieldExtractor
from nep.cli.topics.topic_patterns import TopicPatterns, is_pattern
from nep.cli.topics.topic_wait import TopicMonitor
from nep.cli.values import encode_json, escape_for_terminal, format_payload
from nep.errors import DecodeError, WaitTimeoutError
from nep.i18n import _, format_list, ngettext
from nep.messages.codecs import content_of
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.protocol.graph_view import GraphView
from nep.text import escaped, shortened

_MAX_SHOWN_BYTES = 64
_MAX_SHOWN_CHARACTERS = 2_000
_MAX_COLOURED_CHARACTERS = 100_000
"""Size in characters above which messages are not coloured; colouring takes a second per megabyte."""
_RECEIVE_SLICE_S = 0.02
"""Duration of a single wait in seconds while several topics are subscribed."""


TopicArgument = Annotated[
    str,
    typer.Argument(
        metavar=_("TOPIC"),
        help=_("Topic, or a pattern such as '/*/odom'."),
        show_default=False,
        autocompletion=complete_topic,
    ),
]
TopicsOrFieldsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar=_("TOPIC|FIELD"),
        help=_("More topics, or the fields to print, such as pose.x or joints\\[3]."),
        show_default=False,
        autocompletion=complete_field_or_topic,
    ),
]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=0, metavar="N", help=_("Exit after N messages (0: never)."))
]
CsvOption = Annotated[
    bool, typer.Option("--csv", help=_("Print the fields as comma-separated values, with their time."))
]
FilterOption = Annotated[
    str | None,
    typer.Option(
        "--filter",
        metavar=_("EXPRESSION"),
        help=_("Print only messages that match, such as 'pose.x > 1.5 and state == \"moving\"'."),
        show_default=False,
    ),
]
FullOption = Annotated[
    bool, typer.Option("--full", help=_("Print long lists and strings in full, even on a terminal."))
]


def echo(
    topic: TopicArgument,
    more: TopicsOrFieldsArgument = None,
    count: CountOption = 0,
    timeout_s: TimeoutOption = None,
    master: MasterOption = None,
    as_json: JsonOption = False,
    as_csv: CsvOption = False,
    full: FullOption = False,
    expression: FilterOption = None,
    backend: BackendOption = None,
) -> None:
    """Print messages from topics until Ctrl+C.

    A pattern also matches topics that appear later: * stands for any characters between slashes, ? for one
    character, ** for any number of parts. Put it in quotes, because the shell expands patterns, too.

    --filter compares fields with values using ==, !=, <, <=, >, >= and in; combine conditions with and, or
    and not. m is the whole message.

    Images are printed as their size, undecodable messages as bytes. A terminal shows the beginning of long
    lists and texts; files and pipes get all of them.
    """
    if as_csv and as_json:
        raise typer.BadParameter(_("--csv and --json can't be combined; choose one"))
    condition = None if expression is None else MessageFilter(expression)
    with open_command_node("echo", master, backend) as node:
        graph = node.graph()
        topics, fields = topics_and_fields(topic, more or (), graph)
        if as_csv and not fields:
            raise typer.BadParameter(
                _("specify the fields: nep topic echo {topic} pose.x pose.y --csv").format(topic=topic)
            )
        extractor = FieldExtractor(fields)
        includes_topic = len(topics) > 1 or (is_pattern(topic) and topic not in graph.topics)
        show: Callable[[Message], object] = MessagePrinter(
            extractor, includes_topic=includes_topic, in_full=full
        )
        if as_json:
            show = partial(show_record, fields=extractor)
        elif as_csv:
            show = CsvMessageWriter(extractor, includes_topic=includes_topic)
        with closing(_receive_messages(node, topics, graph, timeout_s)) as messages:
            matching = (each for each in messages if condition is None or _matches(condition, each))
            try:
                for message in itertools.islice(matching, count or None):
                    show(message)
            finally:
                extractor.report_missing()


def _receive_messages(
    node: Node, topics: Sequence[str], graph: GraphView, timeout_s: float | None
) -> Generator[Message, None, None]:
    # Yields messages as `_receive_all` does, after subscribing to topics and patterns.
    exact = [each for each in topics if each in graph.topics or not is_pattern(each)]
    patterns = TopicPatterns(node, [each for each in topics if each not in exact], exact)
    monitor = TopicMonitor(node, exact)
    monitor.update(graph)
    subscribers: list[Subscriber] = []
    with ExitStack() as stack:

        def subscribe(topics: Sequence[tuple[str, str]]) -> None:
            for name, msg_type in topics:
                subscribers.append(stack.enter_context(node.new_sub(name, msg_type)))

        subscribe([(each, monitor.msg_type(each)) for each in exact] + patterns.new_topics(graph))
        yield from _receive_all(subscribers, timeout_s, monitor, patterns, subscribe)


def topics_and_fields(topic: str, more: Sequence[str], graph: GraphView) -> tuple[list[str], list[str]]:
    """Split the words of a command line into topics and field paths.

    A word is a topic if the graph contains it, if it starts with "/", or if it is a pattern. A status
    message is printed for each topic of the graph whose name could also be a field.

    Args:
        topic: First word, which is always a topic.
        more: Further words.
        graph: Graph with the published topics.
    """
    topics, fields = [topic], []
    for argument in more:
        if argument in graph.topics or argument.startswith("/") or is_pattern(argument):
            topics.append(argument)
        else:
            fields.append(argument)
    ambiguous = [argument for argument in more if argument in graph.topics and not argument.startswith("/")]
    for argument in ambiguous:
        print_status(_("'{word}' is a topic; use .{word} for a field of that name").format(word=argument))
    return list(dict.fromkeys(topics)), fields


def _receive_all(
    subscribers: Sequence[Subscriber],
    timeout_s: float | None,
    monitor: TopicMonitor,
    patterns: TopicPatterns,
    subscribe_new: Callable[[Sequence[tuple[str, str]]], None],
) -> Iterator[Message]:
    # Reports lost messages on stderr. `subscribe_new` adds topics that match the patterns and are new. Raises
    # `WaitTimeoutError`.
    lost: dict[str, int] = {}
    last_received_at, never = time.monotonic(), threading.Event()
    while True:
        subscribe_new(patterns.poll())
        received = [message for subscriber in subscribers if (message := subscriber.receive(0.0)) is not None]
        if not received and not subscribers:
            never.wait(monitor.wait_slice_s(timeout_s))
        elif not received:
            message = subscribers[0].receive(
                _RECEIVE_SLICE_S if len(subscribers) > 1 else monitor.wait_slice_s(timeout_s)
            )
            received = [] if message is None else [message]
        now = time.monotonic()
        if received:
            last_received_at = now
            for subscriber in subscribers:
                missing = (subscriber.lost or 0) - lost.get(subscriber.topic, 0)
                if missing > 0:
                    lost[subscriber.topic] = subscriber.lost or 0
                    template = ngettext(
                        "{count} message of '{topic}' was lost",
                        "{count} messages of '{topic}' were lost",
                        missing,
                    )
                    print_status(template.format(count=missing, topic=subscriber.topic))
            yield from received
            monitor.mark_received({message.topic for message in received})
        elif timeout_s is not None and now - last_received_at >= timeout_s:
            names = format_list(
                [f"'{topic}'" for topic in (*(sub.topic for sub in subscribers), *patterns.patterns)],
                "or",
            )
            raise WaitTimeoutError(_("a message on {names}").format(names=names), timeout_s)
        else:
            monitor.poll()


def _matches(condition: MessageFilter, message: Message) -> bool:
    try:
        return condition.matches(message.payload_or_extension)
    except DecodeError:
        return False


def show_record(message: Message, fields: FieldExtractor | None = None) -> None:
    """Print a message as a line of JSON.

    An undecodable message is printed as hexadecimal digits with the error, an image as its extension.

    Args:
        message: Message to print.
        fields: Fields to print instead of the payload; undecodable messages are then skipped.
    """
    record: dict[str, object] = {
        "topic": message.topic,
        "msg_type": message.msg_type,
        "codec": message.codec,
        "stamp_ns": message.stamp_ns,
        "seq": message.seq,
        "publisher": None if message.publisher is None else str(message.publisher),
        "size_bytes": message.size_bytes,
    }
    if fields is not None and fields.names:
        values = fields.extract(message)
        if values is None:
            return
        record["fields"] = fields.as_dict(values)
    else:
        try:
            record["payload"] = message.payload_or_extension
        except DecodeError as error:
            record["error"] = str(error)
            record["bytes"] = bytes(message.data).hex()
    show_json(record)


class MessagePrinter:
    """Printer of messages for people: time, sequence number, topic and payload, coloured on a terminal."""

    def __init__(
        self, fields: FieldExtractor | None = None, *, includes_topic: bool = False, in_full: bool = False
    ) -> None:
        """Initialize the printer.

        Args:
            fields: Fields to print; None prints the whole payload.
            includes_topic: Print the topic of each message.
            in_full: Print long values in full on a terminal; files and pipes always get them in full.
        """
        self._fields = fields
        self._includes_topic = includes_topic
        self._console = console()
        self._paint = json_highlighter() if self._console.is_terminal else None
        self._prints_in_full = in_full or self._paint is None

    def __call__(self, message: Message) -> None:
        """Print one message. If fields were chosen, an undecodable message is skipped."""
        header = _format_header(message)
        if self._includes_topic:
            header += f"  {escaped(message.topic)}"
        max_width = self._console.width - display_width(header) - 2
        if self._fields is not None and self._fields.names:
            values = self._fields.extract(message)
            if values is None:
                return
            body = format_payload(self._fields.as_dict(values), in_full=self._prints_in_full)
        else:
            body = _format_body(message, max_width, in_full=self._prints_in_full)
        if self._paint is None or len(body) > _MAX_COLOURED_CHARACTERS:
            write(f"{header}  {body}\n")
        else:
            self._console.print(self._paint(header, body))


def _format_header(message: Message) -> str:
    stamp = UNKNOWN
    if message.stamp_ns is not None:
        stamp = (
            datetime.fromtimestamp(message.stamp_ns / 1e9, tz=timezone.utc)
            .astimezone()
            .strftime("%H:%M:%S.%f")[:-3]
        )
    seq = "" if message.seq is None else f"  #{message.seq}"
    return f"{stamp}{seq}"


def _format_body(message: Message, max_width: int, *, in_full: bool) -> str:
    if content_of(message.codec) == "image":
        return _image_summary(message)
    try:
        payload = message.payload
    except DecodeError as error:
        text = _("{size_bytes}, not valid {codec}: {hexadecimal} ({reason})").format(
            size_bytes=format_size(message.size_bytes),
            codec=message.codec,
            hexadecimal=_format_hexadecimal(message.data),
            reason=error.reason,
        )
        return escape_for_terminal(text)
    if isinstance(payload, str):
        return escape_for_terminal(payload if in_full else shortened(payload, _MAX_SHOWN_CHARACTERS))
    if isinstance(payload, bytes):
        return f"{format_size(len(payload))}: {_format_hexadecimal(payload)}"
    # re-encoding decoded JSON is 100 times faster than formatting each value
    is_exact = in_full and message.codec == "json" and not _has_nan(message.data)
    line = encode_json(payload).decode() if is_exact else format_payload(payload, in_full=in_full)
    if len(line) <= max_width and display_width(line) <= max_width:
        return line
    indented = (
        encode_json(payload, indent=True).decode()
        if is_exact
        else format_payload(payload, in_full=in_full, indent=True)
    )
    return "\n" + textwrap.indent(indented, "  ")


def _has_nan(data: memoryview) -> bool:
    raw = bytes(data)
    return b"NaN" in raw or b"Infinity" in raw


def _format_hexadecimal(data: bytes | memoryview) -> str:
    return bytes(data[:_MAX_SHOWN_BYTES]).hex(" ") + (" …" if len(data) > _MAX_SHOWN_BYTES else "")


def _image_summary(message: Message) -> str:
    shape, encoding_name = message.extension.get("shape"), message.extension.get("encoding", _("image"))
    encoding = escaped(shortened(str(encoding_name), 40))
    if (
        isinstance(shape, (list, tuple))
        and len(shape) >= 2
        and all(isinstance(side, int) for side in shape[:2])
    ):
        return f"{encoding} {shape[1]} x {shape[0]}, {format_size(message.size_bytes)}"
    return f"{encoding}, {format_size(message.size_bytes)}"
