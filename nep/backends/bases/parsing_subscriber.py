"""Base class of subscribers to messages of the native wire whose library delivers them by callback."""

from __future__ import annotations

import logging

from nep.backends.base import SubscriberSpec
from nep.backends.bases.inbox import Inboxes, InboxSubscriber
from nep.backends.bases.loss import PublisherTracker
from nep.backends.bases.rejections import RejectionCounter
from nep.errors import WireError
from nep.messages.message import Message
from nep.protocol.requests import SubscriberCount, clamp_count

_logger = logging.getLogger("nep")


class ParsingSubscriber(InboxSubscriber):
    """Subscriber that counts received, lost and malformed messages.

    Subclasses parse messages with a `nep.backends.bases.message_parser.MessageParser`, which gets `_sources`.

    Args:
        spec: Settings of the subscriber.
        inboxes: Shared state of the node's inboxes.
    """

    def __init__(self, spec: SubscriberSpec, inboxes: Inboxes) -> None:
        super().__init__(spec, inboxes)
        self._sources = PublisherTracker()
        self._rejections = RejectionCounter()

    @property
    def received(self) -> int:
        """Number of messages received."""
        return self._sources.received

    @property
    def lost(self) -> int:
        """Number of messages lost in transit or dropped from the full inbox."""
        return self._sources.lost

    @property
    def refused(self) -> int:
        """Number of received frames that were rejected because they are not valid messages."""
        return self._rejections.count

    def counts(self) -> SubscriberCount:
        """Return the statistics that the graph shows."""
        problem = self.problem or self._rejections.recent_message()
        return SubscriberCount(self.spec.id, clamp_count(self.received), clamp_count(self.lost), problem)

    def _enqueue_locked(self, message: Message | None) -> None:
        # None, as a parser returns it for notices and duplicates, is ignored.
        if message is not None:
            self._sources.count_dropped(self._put_locked(message))

    def _count_malformed(self, error: WireError) -> None:
        if self._rejections.add(error.reason):
            _logger.warning("malformed message on '%s': %s", self.spec.topic, error)
