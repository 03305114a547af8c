"""Audience: who reads at a publisher's port, from the subscriptions that come in there. No sockets."""

from __future__ import annotations

import logging

from nep.backends.native.refusals import Refusals
from nep.wire import parse_hello, topic_part

__all__ = ["Audience"]

_logger = logging.getLogger("nep")


class Audience:
    """Those who said hello to `topic`, and the filters of others. It lives under its outlet's lock."""

    def __init__(self, topic: str) -> None:
        self.seen: dict[int, int] = {}
        """Subscribers that said hello and have not gone, and how many messages there had been then."""
        self.hellos: dict[int, bytes] = {}
        """Under which first part each of them is reached alone."""
        self.apart: dict[bytes, int] = {}
        """Filters by which somebody reads who did not say that it reads messages of one part; of how many."""
        self.refusals = Refusals()
        self._name = topic
        self._topic = topic_part(topic)

    def note(self, event: bytes, count: int) -> bytes | None:
        """Somebody came or went, after `count` messages; the first part under which to greet a subscriber."""
        is_wanted, what = event[:1] == b"\1", event[1:]
        hello = parse_hello(what)
        if hello is None:
            self._note_filter(what, is_wanted=is_wanted)
            return None
        if hello.topic != self._name:
            return None  # a subscriber of whoever had this port before
        if not is_wanted:
            self.seen.pop(hello.subscriber, None)
            self.hellos.pop(hello.subscriber, None)
            return None
        if hello.one_part:  # its own filter came before
            left = self.apart.pop(self._topic, 0) - 1
            if left > 0:
                self.apart[self._topic] = left
        self.seen[hello.subscriber] = count
        self.hellos[hello.subscriber] = what
        return what

    def _note_filter(self, what: bytes, *, is_wanted: bool) -> None:
        """Each filter that comes is told, and the last of its kind that goes."""
        if what != self._topic and self.refusals.add(f"{len(what)} bytes that are no subscription of it"):
            _logger.info("'%s' was sent %s", self._name, self.refusals.told())
        if not self._topic.startswith(what):
            return
        if is_wanted:
            self.apart[what] = self.apart.get(what, 0) + 1
        else:
            self.apart.pop(what, None)
