"""Pages connected to the web server, pages that left recently, and topics that pages read too slowly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nep.programs.web.context import ConnectedPage

GONE_DISPLAY_S = 10.0
SLOW_DISPLAY_S = 10.0


@dataclass(frozen=True, slots=True)
class ListedPage:
    """Web page in the list of pages.

    Attributes:
        gone_s: Seconds since the page left; None while it is connected.
    """

    page: ConnectedPage
    gone_s: float | None = None


@dataclass(frozen=True, slots=True)
class SlowTopic:
    """Topic that a page reads too slowly, so that messages are dropped.

    Attributes:
        dropped_share: Dropped messages as a share of all messages, 0 to 1.
    """

    page: ConnectedPage
    topic: str
    dropped_share: float


class PageList:
    """List of web pages, updated from snapshots of the server. Not thread-safe."""

    def __init__(self) -> None:
        self._pages: dict[int, ConnectedPage] = {}
        self._disconnect_times_s: dict[int, float] = {}
        self._dropped_counts: dict[tuple[int, str], int] = {}
        self._last_drop_times_s: dict[tuple[int, str], float] = {}
        self._now = 0.0
        self.revision = 0
        """Counter that increases when a page connects or leaves."""

    @property
    def connected(self) -> tuple[ConnectedPage, ...]:
        """Connected pages of the latest snapshot."""
        return tuple(page for id_, page in self._pages.items() if id_ not in self._disconnect_times_s)

    @property
    def listed_pages(self) -> tuple[ListedPage, ...]:
        """Pages in order of arrival, including pages that left in the last `GONE_DISPLAY_S` seconds."""
        return tuple(
            ListedPage(
                page, self._now - self._disconnect_times_s[id_] if id_ in self._disconnect_times_s else None
            )
            for id_, page in self._pages.items()
        )

    @property
    def bytes_per_s(self) -> float:
        """Total bandwidth of all connected pages in bytes per second."""
        return sum(topic.bytes_per_s for page in self.connected for topic in page.topics)

    def update(self, pages: Sequence[ConnectedPage], now: float) -> None:
        """Apply a snapshot of the connected pages at ``now`` (monotonic seconds)."""
        self._now = now
        connected_ids = {page.id for page in pages}
        if connected_ids != self._pages.keys() - self._disconnect_times_s.keys():
            self.revision += 1
        for id_ in self._pages:
            if id_ not in connected_ids:
                self._disconnect_times_s.setdefault(id_, now)
        for page in pages:
            self._pages[page.id] = page
            self._disconnect_times_s.pop(page.id, None)
        for id_, left_s in tuple(self._disconnect_times_s.items()):
            if now - left_s > GONE_DISPLAY_S:
                del self._disconnect_times_s[id_], self._pages[id_]
        self._pages = dict(sorted(self._pages.items()))
        self._record_drops(pages, now)

    def clear(self, now: float) -> None:
        """Remove all pages at ``now`` (monotonic seconds), because the server stopped."""
        self.update((), now)

    def slow_topics(self) -> Iterator[SlowTopic]:
        """Yield the topics on which messages to a connected page were dropped recently (`SLOW_DISPLAY_S`)."""
        for page in self.connected:
            for topic in page.topics:
                dropped_s = self._last_drop_times_s.get((page.id, topic.topic))
                if dropped_s is not None and self._now - dropped_s <= SLOW_DISPLAY_S:
                    yield SlowTopic(page, topic.topic, dropped_share(topic.sent_count, topic.dropped_count))

    def _record_drops(self, pages: Sequence[ConnectedPage], now: float) -> None:
        dropped_counts = {
            (page.id, topic.topic): topic.dropped_count
            for page in pages
            for topic in page.topics
            if topic.dropped_count
        }
        new_drop_times_s = {
            key: now for key, count in dropped_counts.items() if count > self._dropped_counts.get(key, 0)
        }
        self._last_drop_times_s = {
            key: dropped_s
            for key, dropped_s in (self._last_drop_times_s | new_drop_times_s).items()
            if key in dropped_counts
        }
        self._dropped_counts = dropped_counts


def dropped_share(sent_count: int, dropped_count: int) -> float:
    """Return the share of messages that were dropped, 0 to 1."""
    return dropped_count / max(1, sent_count + dropped_count)
