"""NativeInlet: a subscriber on the native wire: connects to publishers as they come."""

from __future__ import annotations

import time
from collections.abc import Iterable

from nep.backends.zeromq.sub_socket import SubSocket
from nep.backends.zeromq.subscriber import SocketInlet
from nep.protocol.records import RemotePublisher
from nep.system.wakeup import Waker

__all__ = ["NativeInlet"]


class NativeInlet(SocketInlet[SubSocket]):
    """See `SocketInlet`. The methods for publishers are called by the link to the master."""

    def wait_for(self, publishers: Iterable[int], timeout_s: float, waker: Waker) -> bool:
        """Wait until these publishers have echoed.

        Who says bye meanwhile, or cannot be connected to, is not waited for.
        """
        wanted = frozenset(publishers)
        sources = self._readable.sources
        return self.read_until(
            lambda: all(
                source.has_echoed or source.problem for each, source in sources.items() if each in wanted
            ),
            timeout_s,
            waker,
        )

    def wait_for_any(self, timeout_s: float, waker: Waker) -> bool:
        """Wait until some publisher has echoed."""
        sources = self._readable.sources
        return self.read_until(
            lambda: any(source.has_echoed for _each, source in sources.items()), timeout_s, waker
        )

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Where it is connected."""
        return tuple(source.endpoint for _each, source in self._readable.sources.items() if source.endpoint)

    def connect(self, remotes: Iterable[RemotePublisher]) -> None:
        """Connect to these publishers; twice is once."""
        with self._turn():
            if not self.is_closed:
                for remote in remotes:
                    self._readable.connect(remote)
                self._after_use()

    def reconcile(self, remotes: Iterable[RemotePublisher]) -> None:
        """These are all publishers of the topic: connect to new ones; others are silent."""
        known = tuple(remotes)
        self.connect(known)
        listed = {remote.publisher.id for remote in known}
        with self._turn():
            for each, source in self._readable.sources.items():
                if each not in listed and source.remote is not None:
                    source.is_lapsed = True

    def gone(self, publisher: int, final: int, *, is_closed: bool) -> None:
        """A publisher is unlisted. Its connection stays until its bye comes, or it is replaced."""
        with self._turn():
            source = self._readable.sources.find(publisher)
            if source is not None and is_closed:
                self._readable.sources.closing(publisher, final, time.monotonic())
            elif source is not None:
                source.is_lapsed = True

    def tick(self, now: float, last_seqs: Iterable[tuple[int, int]]) -> None:
        """Once a second: leave publishers that have closed without a bye; reconcile losses.

        `last_seqs` is the master's word on what publishers have sent.
        """
        with self._turn():
            if self.is_closed:
                return
            sources = self._readable.sources
            for publisher in sources.ended(now):
                source = sources.get(publisher)
                if source.last is not None:
                    sources.reached(publisher, source.final)
                self._readable.leave(publisher)
            if not self._readable.has_input:
                for publisher, seq in last_seqs:
                    sources.promised(publisher, seq)
            self._after_use()
