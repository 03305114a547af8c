"""Base class of worlds, which panels read."""

from __future__ import annotations

import time
from collections.abc import Callable

from app.core.messages.image_streams import Images
from app.core.network.mailbox import Batch
from app.core.network.nodes import NodeEntry, Nodes
from app.core.network.topics import Topic, Topics, split_key
from app.core.network.watches import Watch, Watches
from app.core.networks.networks import NetworkList
from app.core.series.feed import SeriesFeed
from app.core.world.console import Console
from app.core.world.part import SessionPart
from nep.protocol.graph_view import GraphView


class World(SessionPart):
    """Source of messages with everything known about it. Not thread-safe; use it from the main thread.

    A subclass passes its messages to `add` and to ``series``, and its images to ``images``, as long as a
    topic is watched. Topics are identified by keys, see `key_of`.

    Attributes:
        is_live: True if the world is the network at this moment. Otherwise it shows other times, and manual
            messages are disabled.
        revision: Counter that increases when panels must watch their topics again.
        watches: Open watches, by topic key.
        topics: Topics of the native network.
        nodes: Nodes of the native network.
        networks: Networks in addition to the native one.
        images: Decoded images of watched topics.
        series: Numbers of plotted fields.
        console: Log of the programs.
        graph: Nodes, topics and services of the native network; None while unknown.
    """

    is_live = False
    revision = 0

    def __init__(
        self,
        *,
        topics: Topics | None = None,
        networks: NetworkList | None = None,
        images: Images | None = None,
        clock: Callable[[], float] = time.monotonic,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        # `now_ns` is the current time of the world in ns since 1970, such as that of the playhead.
        self._clock, self.now_ns = clock, now_ns
        self.watches = Watches(self._on_watched, self._on_unwatched, self.on_released)
        self.topics, self.nodes = topics if topics is not None else Topics(), Nodes()
        self.networks = networks if networks is not None else NetworkList()
        self.images = images if images is not None else Images(self.watch, clock)
        self.images.now_ns = now_ns
        self.series = SeriesFeed(self.watch, now_ns, self.set_capacity)
        self.console = Console(lambda: now_ns() / 1e9)
        self.graph: GraphView | None = None

    # -- for panels --------------------------------------------------------------------------------

    def watch(self, topic: str) -> Watch:
        """Watch a topic until the watch is closed. Its messages arrive in ``topics`` or ``networks``."""
        return self.watches.open([topic])

    def is_watched(self, topic: str) -> bool:
        """Return True if at least one watch of the topic is active."""
        return self.watches.is_watched(topic)

    def topic(self, key: str) -> Topic | None:
        """Return the topic with this key, or None."""
        return self.networks.topic(key) if split_key(key)[0] else self.topics.get(key)

    @property
    def all_topics(self) -> list[Topic]:
        """Topics of all networks."""
        return [*self.topics, *self.networks.topics]

    @property
    def all_nodes(self) -> list[NodeEntry]:
        """Nodes of all networks."""
        return [*self.nodes, *self.networks.nodes]

    def mark_seen(self, key: str) -> None:
        """Stop highlighting a topic as new."""
        name, topic = split_key(key)
        network = self.networks.get(name)
        (network.topics if network is not None else self.topics).mark_seen(topic)

    # -- for the session ---------------------------------------------------------------------------

    def request_stop(self) -> None:
        """Signal the threads to stop, without waiting for them; `close` waits."""

    @property
    def has_ended(self) -> bool:
        """True if all threads have ended after `request_stop`, so that `close` isn't necessary."""
        return True

    # -- for subclasses ----------------------------------------------------------------------------

    def add(self, topic: str, batch: Batch) -> None:
        """Add messages of a topic of the native network. They are discarded if the topic isn't watched."""
        if self.watches.is_watched(topic):
            self.topics.add(topic, batch, self._clock())
            self.topics[topic].is_watched = True

    def subscribe(self, topic: str) -> None:
        """Begin to deliver the messages of a topic. Called at its first active watch."""

    def unsubscribe(self, topic: str) -> None:
        """Stop delivering the messages of a topic. Called when its last watch is suspended or closed."""

    def on_released(self, topic: str) -> None:
        """Discard what is known only while a topic is watched. Called when its last watch is closed."""

    def set_capacity(self, topic: str, count: int | None) -> None:
        """Set how many messages of a plotted topic are kept between two ticks.

        Args:
            topic: Key of the topic.
            count: Number of messages; None for the default, after the last plot of the topic was closed.
        """

    def _on_watched(self, key: str) -> None:
        self.subscribe(key)
        topic = self.topic(key)
        if topic is not None:
            topic.is_watched = True

    def _on_unwatched(self, key: str) -> None:
        self.unsubscribe(key)
        if not split_key(key)[0]:
            self.topics.unwatch(key)
