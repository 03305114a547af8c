"""Relay of messages between lines.

A frame is converted at most once per format, and never sent back to the line it came from.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import zmq

from nep.i18n import _, ngettext
from nep.programs.gateway.framing import FrameError, has_replaced_nan
from nep.programs.gateway.portmap import TopicLine
from nep.programs.gateway.proxy_pair import ProxyPair
from nep.programs.gateway.requests import Role

_MAX_BATCH = 200
"""Maximum number of frames read from one line before other lines are served."""


class NativeSide(Protocol):
    """Interface of the relay to the native network. A topic uses one codec at a time."""

    def publish(self, topic: str, codec: str, data: bytes) -> None:
        """Publish data to native subscribers. The first call opens the publisher."""

    def stop_publishing(self, topic: str, codec: str) -> None:
        """Close the publisher of a topic that no original program publishes any more."""

    def subscribe(self, topic: str, codec: str) -> bool:
        """Subscribe to a topic, whose messages are passed to `Relay.deliver`.

        Returns False if the subscription failed and must be retried.
        """

    def unsubscribe(self, topic: str, codec: str) -> None:
        """Close the subscriber of a topic to which no original program subscribes any more."""


class AlertSink(Protocol):
    """Interface through which problems are reported as alerts."""

    def report(self, id: str, message: str, hint: str = "") -> None:
        """Report a problem as an alert. Repeated reports of the same problem have no effect.

        Args:
            id: Id of the alert, for `resolve`.
            message: Description of the problem.
            hint: Next step for the user, or "".
        """

    def resolve(self, id: str) -> None:
        """Remove the alert of a problem that is solved."""


Key = tuple[str, str]
"""Topic and codec. Lines with the same key receive each other's messages."""


ProgramNames = Callable[[TopicLine, Role], Sequence[str]]
"""Function that returns the names of the known programs with a role on a line."""


@dataclass
class _RejectedMessages:
    """Count of a topic's invalid messages since its last valid message."""

    reason: str
    count: int = 0
    reported_count: int = 0
    is_resolved: bool = False


class Relay:
    """Relay of messages between the open lines and the native network. Used in the gateway's thread only.

    Args:
        context: ZeroMQ context.
        native: Native network.
        alerts: Receiver of problems.
        program_names: Returns the names of the programs on a line, for alerts.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        native: NativeSide,
        alerts: AlertSink,
        program_names: ProgramNames = lambda _line, _role: (),
    ) -> None:
        self._context = context
        self._native = native
        self._alerts = alerts
        self._program_names = program_names
        self._pairs: dict[TopicLine, ProxyPair] = {}
        self._subscribed_keys: set[Key] = set()
        self._published_keys: set[Key] = set()
        self._rejected_by_topic: dict[str, _RejectedMessages] = {}

    @property
    def pairs(self) -> Iterable[ProxyPair]:
        """Sockets of all open lines."""
        return self._pairs.values()

    def pair(self, line: TopicLine) -> ProxyPair | None:
        """Return the sockets of a line, or None if the line is not open."""
        return self._pairs.get(line)

    def open(self, line: TopicLine, base: int) -> ProxyPair:
        """Open the sockets of a line and return them. Raises `zmq.ZMQError` if a port is in use.

        Args:
            line: Line to open.
            base: Base port of the line.
        """
        pair = self._pairs[line] = ProxyPair(self._context, line, base)
        return pair

    def close_line(self, line: TopicLine) -> None:
        """Close the sockets of a line, and native publishers and subscribers that are no longer needed."""
        pair = self._pairs.pop(line, None)
        if pair is not None:
            pair.close()
            self.update_endpoints((line.topic, line.codec))
            for role in tuple(pair.unsupported_versions):
                self._clear_version_alert(pair, role)

    def close(self) -> None:
        """Close all lines."""
        for line in list(self._pairs):
            self.close_line(line)

    def sockets(self) -> Iterator[tuple[zmq.Socket[bytes], ProxyPair]]:
        """Yield all sockets to be polled, each with the `ProxyPair` it belongs to."""
        for pair in self._pairs.values():
            for socket in (pair.incoming, pair.outgoing, *pair.monitors.values()):
                yield socket, pair

    def serve(self, pair: ProxyPair) -> bool:
        """Process the pending input of a pair; return True if connections or subscriptions changed."""
        has_changed = pair.read_connections()
        has_changed |= pair.read_filters()
        if has_changed:
            self.update_endpoints((pair.line.topic, pair.line.codec))
        for frame in pair.frames(_MAX_BATCH):
            self._relay_frame(pair, frame)
        return has_changed

    def set_languages(self, languages: Mapping[TopicLine, frozenset[str]]) -> None:
        """Set the programming languages of the programs on each line, some of which require escaping."""
        for line, pair in self._pairs.items():
            pair.languages = languages.get(line, frozenset())

    def deliver(self, topic: str, codec: str, data: bytes | memoryview) -> None:
        """Send a native message to all original subscribers of a topic, in the format of each.

        Args:
            topic: Name of the topic.
            codec: Native codec of the data.
            data: Encoded payload.
        """
        for pair in self._pairs_of((topic, codec)):
            pair.deliver(data)

    def tick(self) -> None:
        """Retry failed subscriptions and update alerts. Call once a second."""
        for key in {(line.topic, line.codec) for line in self._pairs}:
            self.update_endpoints(key)
        for topic, rejected in list(self._rejected_by_topic.items()):
            if rejected.count != rejected.reported_count:
                self._report_rejected(topic, rejected)
            elif rejected.is_resolved:
                del self._rejected_by_topic[topic]
                self._alerts.resolve(f"message:{topic}")

    def update_endpoints(self, key: Key) -> None:
        """Open or close the native publisher and subscriber of a key, as original programs require.

        Args:
            key: Topic and codec.
        """
        pairs = self._pairs_of(key)
        is_needed = any(pair.has_subscribers for pair in pairs)
        if is_needed and key not in self._subscribed_keys:
            if self._native.subscribe(*key):
                self._subscribed_keys.add(key)
        elif not is_needed and key in self._subscribed_keys:
            self._subscribed_keys.discard(key)
            self._native.unsubscribe(*key)
        if key in self._published_keys and not any(pair.connections["publisher"] for pair in pairs):
            self._published_keys.discard(key)
            self._native.stop_publishing(*key)
            self._alerts.resolve(f"nan:{key[0]}")
        for pair in pairs:
            self._check_versions(pair)

    def _pairs_of(self, key: Key) -> list[ProxyPair]:
        return [pair for pair in self._pairs.values() if (pair.line.topic, pair.line.codec) == key]

    def _relay_frame(self, pair: ProxyPair, frame: bytes) -> None:
        key = (pair.line.topic, pair.line.codec)
        try:
            data = pair.frame_format.decode_frame(frame)
        except FrameError as error:
            self._reject(pair, error)
            return
        if pair.line.topic in self._rejected_by_topic:
            self._rejected_by_topic[pair.line.topic].is_resolved = True
        if pair.line.codec == "json" and has_replaced_nan(frame, data):
            self._alerts.report(
                f"nan:{pair.line.topic}",
                _(
                    "“{topic}” contains NaN or infinity, which JSON doesn't support: native programs receive "
                    "null instead"
                ).format(topic=pair.line.topic),
                _("Change the publishing program to send null for missing values."),
            )
        for other in self._pairs_of(key):
            if other is pair:
                other.forward(frame, data)
            else:
                other.deliver(data)
        self._published_keys.add(key)
        self._native.publish(*key, data)

    def _reject(self, pair: ProxyPair, error: FrameError) -> None:
        if error.version is not None:
            self._report_version_alert("publisher", pair, error.version)
            return
        topic = pair.line.topic
        rejected = self._rejected_by_topic.setdefault(topic, _RejectedMessages(str(error)))
        rejected.reason, rejected.is_resolved = str(error), False
        rejected.count += 1
        if rejected.count == 1:  # further messages are reported once a second
            self._report_rejected(topic, rejected)

    def _report_rejected(self, topic: str, rejected: _RejectedMessages) -> None:
        rejected.reported_count = rejected.count
        template = ngettext("{reason}", "{reason} ({count} messages)", rejected.count)
        self._alerts.report(f"message:{topic}", template.format(reason=rejected.reason, count=rejected.count))

    def _check_versions(self, pair: ProxyPair) -> None:
        if pair.has_0546_subscriber:
            self._report_version_alert("subscriber", pair, "0.5.4.6")
        else:
            self._clear_version_alert(pair, "subscriber")
        version = pair.unsupported_versions.get("publisher")
        if version is not None and pair.connections["publisher"]:
            self._report_version_alert("publisher", pair, version)
        else:
            self._clear_version_alert(pair, "publisher")

    def _report_version_alert(self, role: Role, pair: ProxyPair, version: str) -> None:
        pair.unsupported_versions[role] = version
        names = [f"“{name}”" for name in self._program_names(pair.line, role)]
        if not names:
            template = _(
                "A program on “{topic}” uses nep {version}, which isn't compatible with any other version"
            )
        elif len(names) == 1:
            template = _(
                "{programs} on “{topic}” uses nep {version}, which isn't compatible with any other version"
            )
        else:
            template = _(
                "One of {programs} on “{topic}” uses nep {version}, which isn't compatible with any other "
                "version"
            )
        self._alerts.report(
            f"version:{pair.line.topic}:{role}",
            template.format(programs=", ".join(names), topic=pair.line.topic, version=version),
            _("Install nep 0.5.4.8 or 0.5.4.5 for that program."),
        )

    def _clear_version_alert(self, pair: ProxyPair, role: Role) -> None:
        if pair.unsupported_versions.pop(role, None) is not None:
            self._alerts.resolve(f"version:{pair.line.topic}:{role}")
