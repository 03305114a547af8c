"""Activity: nodes without traffic for a minute, and call rates of services."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping

from app.core.graph.node_graph import INTERNAL_PREFIX, GraphInput
from app.core.network.topics import key_of
from app.core.networks.kinds import find_kind

QUIET_TIMEOUT_S = 60.0
CALL_WINDOW_S = 60.0
MAX_SAMPLES = 61
"""Number of stored samples of the call counts, taken once a second."""


class QuietNodes:
    """Detection of nodes without traffic, by their message counters.

    Nodes without counters are never quiet: nodes of a network without statistics, and original programs
    that only subscribe. Not thread-safe; use it from the main thread.
    """

    def __init__(self) -> None:
        self._totals_by_node: dict[str, tuple[int, float]] = {}

    def update(self, graph_input: GraphInput, now: float) -> None:
        """Apply new statistics; ``now`` is in monotonic seconds. New nodes count as active."""
        sums = {entry.key: 0 for entry in graph_input.nodes if entry.gone_s is None}
        uncounted_keys = {
            entry.key
            for entry in graph_input.nodes
            if (kind := find_kind(entry.network)) is not None and not kind.reports_stats
        }
        original_keys = {entry.key for entry in graph_input.nodes if entry.is_original}
        for entry, count in _counts(graph_input):
            if count is None and entry in original_keys:
                uncounted_keys.add(entry)
            elif entry in sums:
                sums[entry] += count or 0
        previous_totals = self._totals_by_node
        self._totals_by_node = {}
        for entry, total in sums.items():
            if entry not in uncounted_keys:
                previous = previous_totals.get(entry)
                has_changed = previous is None or previous[0] != total
                self._totals_by_node[entry] = total, now if has_changed or previous is None else previous[1]

    def quiet_keys(self, now: float) -> frozenset[str]:
        """Return the keys of the nodes without a message or call in the last `QUIET_TIMEOUT_S` seconds."""
        return frozenset(
            key for key, (_total, since_s) in self._totals_by_node.items() if now - since_s >= QUIET_TIMEOUT_S
        )


class CallRates:
    """Call rates of services, averaged over a minute. Not thread-safe; use it from the main thread."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, Mapping[str, int]]] = deque(maxlen=MAX_SAMPLES)

    def update(self, graph_input: GraphInput, now: float) -> None:
        """Apply the call counts at ``now`` (monotonic seconds); at most one sample per second is stored."""
        if not self._samples or now - self._samples[-1][0] >= 1.0:
            self._samples.append((now, {name: info.calls for name, info in graph_input.services.items()}))

    def rates_hz(self) -> dict[str, float]:
        """Return calls per second by service; services with fewer than two samples are omitted."""
        if len(self._samples) < 2:
            return {}
        last_s, last_counts = self._samples[-1]
        first_samples: dict[str, tuple[float, int]] = {}
        for time_s, counts in self._samples:
            if last_s - time_s <= CALL_WINDOW_S:
                for name in counts.keys() - first_samples.keys():
                    first_samples[name] = time_s, counts[name]
        return {
            name: (calls - first_samples[name][1]) / (last_s - first_samples[name][0])
            for name, calls in last_counts.items()
            if name in first_samples and first_samples[name][0] < last_s and calls >= first_samples[name][1]
        }


def _counts(graph_input: GraphInput) -> Iterator[tuple[str, int | None]]:
    # (key of a node, number of messages or calls); None if not counted. Internal topics are skipped.
    for topic in graph_input.topics:
        if topic.info is None or topic.name.startswith(INTERNAL_PREFIX):
            continue
        for publisher in topic.info.publishers:
            yield key_of(topic.network, publisher.node_id), publisher.count
        for subscriber in topic.info.subscribers:
            yield key_of(topic.network, subscriber.node_id), subscriber.received
    for name, service in graph_input.services.items():
        if name.startswith(INTERNAL_PREFIX):
            continue
        for server in service.servers:
            yield server.node_id, server.calls
        for client in service.clients:
            count = None if client.answered is None else client.answered + (client.failed or 0)
            yield client.node_id, count
