"""Subscriber over zenoh: queues received messages for a reader."""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any, NamedTuple

from nep.backends.base import SubscriberSpec
from nep.backends.bases.inbox import Inboxes
from nep.backends.bases.message_parser import MessageParser
from nep.backends.bases.parsing_subscriber import ParsingSubscriber
from nep.backends.zenoh.early_messages import EarlyMessages
from nep.backends.zenoh.keys import topic_of
from nep.errors import WireError
from nep.i18n import _
from nep.protocol.requests import RemotePublisher
from nep.protocol.topic_pattern import matches
from nep.protocol.wire import HEADER_BYTES, hello_part, read_header, topic_part

_logger = logging.getLogger("nep")
_MAX_TOPIC_PARSERS = 10_000


class _TopicParser(NamedTuple):
    # Parser for one topic. `topic` and `subscriber_part` are the first parts of messages to all, and to
    # this subscriber alone.
    topic: bytes
    subscriber_part: bytes
    parser: MessageParser


class ZenohSubscriber(ParsingSubscriber):
    """Subscriber with an inbox or a sink.

    Args:
        spec: Settings of the subscriber.
        inboxes: Shared state of the node's inboxes.
        on_close: Unregisters the subscriber. Called once, without a lock.
    """

    def __init__(
        self, spec: SubscriberSpec, inboxes: Inboxes, on_close: Callable[[ZenohSubscriber], None]
    ) -> None:
        super().__init__(spec, inboxes)
        self._on_close = on_close
        self._early_messages = EarlyMessages[tuple[_TopicParser, list[bytes]]](
            self._sources, spec.max_messages
        )
        self._own_parser = self._new_topic_parser(spec.topic)
        self._topic_parsers: OrderedDict[str, _TopicParser] = OrderedDict()
        """Parsers of recently received topics of a pattern, the most recent last."""

    def _new_topic_parser(self, topic: str) -> _TopicParser:
        spec = self.spec if topic == self.spec.topic else replace(self.spec, topic=topic)
        subscriber_part = hello_part(spec.id, topic)
        parser = MessageParser(
            spec, subscriber_part, self._sources, self._remove_publisher, lambda _publisher, _seq: None
        )
        return _TopicParser(topic_part(topic), subscriber_part, parser)

    def matches_topic(self, topic: str) -> bool:
        """Return True if the subscriber receives messages of this topic."""
        return topic == self.spec.topic or (self.spec.is_pattern and matches(self.spec.topic, topic))

    def _topic_parser_for(self, sample: Any) -> _TopicParser | None:  # noqa: ANN401 - zenoh is not typed
        # Returns None if the topic doesn't match: zenoh's key expression is wider than the pattern.
        if not self.spec.is_pattern:
            return self._own_parser
        topic = topic_of(str(sample.key_expr))
        with self._changed:
            topic_parser = self._topic_parsers.pop(topic, None)
            if topic_parser is None and not self.matches_topic(topic):
                return None
            topic_parser = self._topic_parsers[topic] = topic_parser or self._new_topic_parser(topic)
            if len(self._topic_parsers) > _MAX_TOPIC_PARSERS:
                self._topic_parsers.popitem(last=False)
            return topic_parser

    # ---- callbacks in zenoh's threads

    def receive_message(self, sample: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        """Parse and queue a message of the topic. Called in a zenoh thread."""
        topic_parser = self._topic_parser_for(sample)
        if topic_parser is not None:
            self._process(sample, topic_parser, topic_parser.topic)

    def receive_reply(self, sample: Any) -> None:  # noqa: ANN401 - zenoh is not typed
        """Handle a publisher's reply to a hello: a message of its history, or its last sequence number."""
        topic_parser = self._topic_parser_for(sample)
        if topic_parser is not None:
            self._process(sample, topic_parser, topic_parser.subscriber_part)

    def _process(self, sample: Any, topic_parser: _TopicParser, first_part: bytes) -> None:  # noqa: ANN401 - zenoh is not typed
        payload: bytes = sample.payload.to_bytes()
        attachment: bytes = b"" if sample.attachment is None else sample.attachment.to_bytes()
        tail = [attachment[:HEADER_BYTES]]
        if (
            payload
            or first_part == topic_parser.topic
            or len(attachment) > HEADER_BYTES
            or _is_latched(attachment)
        ):
            tail.append(payload)
        if len(attachment) > HEADER_BYTES:
            tail.append(attachment[HEADER_BYTES:])
        with self._changed:
            if not self.is_closed:
                self._process_parts_locked(topic_parser, first_part, tail)

    def _process_parts_locked(self, topic_parser: _TopicParser, first_part: bytes, tail: list[bytes]) -> None:
        # Call with the lock of the inboxes held.
        try:
            if not tail[0]:
                raise WireError(
                    _("the message has no header; its publisher isn't a nep program"), len(tail[-1])
                )
            if (
                first_part == topic_parser.topic
                and _is_latched(tail[0])
                and self._queue_if_early(topic_parser, tail)
            ):
                return
            self._enqueue_locked(topic_parser.parser.parse(first_part, tail))
            if first_part == topic_parser.subscriber_part and len(tail) == 1:  # end of the reply to a hello
                self._deliver_early_messages(read_header(tail[0]).publisher)
        except WireError as error:
            self._count_malformed(error)

    def _queue_if_early(self, topic_parser: _TopicParser, tail: list[bytes]) -> bool:
        header = read_header(tail[0])
        is_early = self._early_messages.queue_if_early(header, (topic_parser, tail), sum(map(len, tail)))
        if not is_early:  # messages queued before this one need not wait any longer, either
            self._deliver_early_messages(header.publisher)
        return is_early

    def _deliver_early_messages(self, publisher: int) -> None:
        for topic_parser, tail in self._early_messages.pop(publisher):
            self._enqueue_locked(topic_parser.parser.parse(topic_parser.topic, tail))

    def end_handshake(self, publishers: Iterable[int]) -> None:
        """Stop waiting for the replies of these publishers to a hello, and deliver their queued messages."""
        with self._changed:
            for publisher in publishers:
                self._deliver_early_messages(publisher)

    def add_publisher(self, remote: RemotePublisher) -> None:
        """Add a publisher or update its record; silent publishers that it replaces are removed."""
        with self._changed:
            for replaced in self._sources.replaced_publishers(remote):
                self._sources.pop(replaced)
            self._sources.add_listed(remote).is_silent = False

    def mark_silent(self, publisher: int) -> None:
        """Mark a publisher as not responding. It isn't removed, because it may only be unreachable.

        The oldest silent publishers beyond `MAX_UNLISTED_PUBLISHERS` are removed.
        """
        with self._changed:
            source = self._sources.find(publisher)
            if source is not None:
                source.is_silent = True
            for expired_id in self._sources.expired_publishers(0.0):
                self._sources.pop(expired_id)

    def handle_bye(self, publisher: int, last_seq: int) -> None:
        """Remove a publisher that has closed, and count its missing messages up to `last_seq` as lost."""
        with self._changed:
            source = self._sources.find(publisher)
            if source is not None:
                if source.last is not None:
                    self._sources.advance_to(publisher, last_seq)
                self._sources.pop(publisher)

    def _remove_publisher(self, publisher: int) -> None:
        self._sources.pop(publisher)

    # ---- closing

    def close(self) -> None:
        """Unregister the subscriber and discard its unread messages."""
        if self._close_inbox():
            self._on_close(self)


def _is_latched(attachment: bytes) -> bool:
    return len(attachment) >= HEADER_BYTES and bool(attachment[2] & 1)
