"""Relay between lines: a frame is converted once per format and once to native, and never sent back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import zmq

from nep.i18n import _, ngettext
from nep.programs.gateway.framing import FrameError, lost_numbers
from nep.programs.gateway.portmap import TopicLine
from nep.programs.gateway.proxy_pair import ProxyPair
from nep.programs.gateway.requests import Role

_BATCH = 200
"""Maximum number of frames read from one line in a row."""


class NativeSide(Protocol):
    """Native network as used by the relay. A topic uses one codec at a time."""

    def publish(self, topic: str, codec: str, data: bytes) -> None:
        """Publish data to native subscribers; the first call creates the publisher."""

    def stop_publishing(self, topic: str, codec: str) -> None:
        """Stop publishing: no original program publishes the topic any more."""

    def subscribe(self, topic: str, codec: str) -> bool:
        """Subscribe to a topic for `Relay.deliver`; return False if that failed and must be retried."""

    def unsubscribe(self, topic: str, codec: str) -> None:
        """Unsubscribe: no original program subscribes to the topic any more."""


class AlertSink(Protocol):
    """Receiver of current problems."""

    def tell(self, id: str, sentence: str, hint: str = "") -> None:
        """Report a problem; repeating it has no effect."""

    def resolve(self, id: str) -> None:
        """Remove a problem."""


Key = tuple[str, str]
"""Topic and codec: lines with the same key exchange messages."""


Who = Callable[[TopicLine, Role], Sequence[str]]
"""Lookup of the names of programs that publish or subscribe on a line, as far as known."""


@dataclass
class _Refused:
    """Invalid messages of a topic since the last valid one."""

    reason: str
    count: int = 0
    told: int = 0
    is_cured: bool = False


class Relay:
    """Open lines. Belongs to the gateway's thread. `who` names programs in alerts."""

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        native: NativeSide,
        alerts: AlertSink,
        who: Who = lambda _line, _role: (),
    ) -> None:
        self._context = context
        self._native = native
        self._alerts = alerts
        self._who = who
        self._pairs: dict[TopicLine, ProxyPair] = {}
        self._subscribed: set[Key] = set()
        self._publishing: set[Key] = set()
        self._refused: dict[str, _Refused] = {}

    @property
    def pairs(self) -> Iterable[ProxyPair]:
        """Open pairs."""
        return self._pairs.values()

    def pair(self, line: TopicLine) -> ProxyPair | None:
        """Return the pair of `line`, or None."""
        return self._pairs.get(line)

    def open(self, line: TopicLine, base: int) -> ProxyPair:
        """Open the sockets of `line`. Raises `zmq.ZMQError` if a port is in use."""
        pair = self._pairs[line] = ProxyPair(self._context, line, base)
        return pair

    def close_line(self, line: TopicLine) -> None:
        """Close the sockets of `line` and its native publisher and subscriber."""
        pair = self._pairs.pop(line, None)
        if pair is not None:
            pair.close()
            self.settle((line.topic, line.codec))
            for role in tuple(pair.unserved):
                self._serve_again(pair, role)

    def close(self) -> None:
        """Close all lines."""
        for line in list(self._pairs):
            self.close_line(line)

    def sockets(self) -> Iterator[tuple[zmq.Socket[bytes], ProxyPair]]:
        """Yield all sockets to poll with their pairs."""
        for pair in self._pairs.values():
            for socket in (pair.incoming, pair.outgoing, *pair.monitors.values()):
                yield socket, pair

    def serve(self, pair: ProxyPair) -> bool:
        """Process the input of a pair; return whether connections or subscriptions changed."""
        changed = pair.read_connections()
        changed |= pair.read_filters()
        if changed:
            self.settle((pair.line.topic, pair.line.codec))
        for frame in pair.frames(_BATCH):
            self._enter(pair, frame)
        return changed

    def know_languages(self, languages: Mapping[TopicLine, frozenset[str]]) -> None:
        """Set the programming languages on each line: some need shielded frames."""
        for line, pair in self._pairs.items():
            pair.languages = languages.get(line, frozenset())

    def deliver(self, topic: str, codec: str, data: bytes | memoryview) -> None:
        """Send a native message to all original subscribers, each in its format."""
        for pair in self._of((topic, codec)):
            pair.deliver(data)

    def look(self) -> None:
        """Retry failed subscriptions and update alerts. Call once a second."""
        for key in {(line.topic, line.codec) for line in self._pairs}:
            self.settle(key)
        for topic, refused in list(self._refused.items()):
            if refused.count != refused.told:
                self._tell_refused(topic, refused)
            elif refused.is_cured:
                del self._refused[topic]
                self._alerts.resolve(f"message:{topic}")

    def settle(self, key: Key) -> None:
        """Open or close native publishers and subscribers as original programs need them."""
        pairs = self._of(key)
        wanted = any(pair.wanted for pair in pairs)
        if wanted and key not in self._subscribed:
            if self._native.subscribe(*key):
                self._subscribed.add(key)
        elif not wanted and key in self._subscribed:
            self._subscribed.discard(key)
            self._native.unsubscribe(*key)
        if key in self._publishing and not any(pair.connections["publisher"] for pair in pairs):
            self._publishing.discard(key)
            self._native.stop_publishing(*key)
            self._alerts.resolve(f"nan:{key[0]}")
        for pair in pairs:
            self._judge(pair)

    def _of(self, key: Key) -> list[ProxyPair]:
        return [pair for pair in self._pairs.values() if (pair.line.topic, pair.line.codec) == key]

    def _enter(self, pair: ProxyPair, frame: bytes) -> None:
        key = (pair.line.topic, pair.line.codec)
        try:
            data = pair.shape.read(frame)
        except FrameError as error:
            self._refuse(pair, error)
            return
        if pair.line.topic in self._refused:
            self._refused[pair.line.topic].is_cured = True
        if pair.line.codec == "json" and lost_numbers(frame, data):
            self._alerts.tell(
                f"nan:{pair.line.topic}",
                _("“{topic}” has NaN or infinity; JSON has neither, and native programs get null").format(
                    topic=pair.line.topic
                ),
                _("Let the program that publishes it send null where it has no value."),
            )
        for other in self._of(key):
            if other is pair:
                other.pass_on(frame, data)
            else:
                other.deliver(data)
        self._publishing.add(key)
        self._native.publish(*key, data)

    def _refuse(self, pair: ProxyPair, error: FrameError) -> None:
        if error.version is not None:
            self._tell_version("publisher", pair, error.version)
            return
        topic = pair.line.topic
        refused = self._refused.setdefault(topic, _Refused(str(error)))
        refused.reason, refused.is_cured = str(error), False
        refused.count += 1
        if refused.count == 1:  # further ones are reported once a second
            self._tell_refused(topic, refused)

    def _tell_refused(self, topic: str, refused: _Refused) -> None:
        refused.told = refused.count
        words = ngettext("{reason}", "{reason} ({count} messages)", refused.count)
        self._alerts.tell(f"message:{topic}", words.format(reason=refused.reason, count=refused.count))

    def _judge(self, pair: ProxyPair) -> None:
        if pair.has_0546:
            self._tell_version("subscriber", pair, "0.5.4.6")
        else:
            self._serve_again(pair, "subscriber")
        version = pair.unserved.get("publisher")
        if version is not None and pair.connections["publisher"]:
            self._tell_version("publisher", pair, version)
        else:
            self._serve_again(pair, "publisher")

    def _tell_version(self, role: Role, pair: ProxyPair, version: str) -> None:
        pair.unserved[role] = version
        names = [f"“{name}”" for name in self._who(pair.line, role)]
        if not names:
            words = _("A program on “{topic}” uses nep {version}, which no other version understands")
        elif len(names) == 1:
            words = _("{programs} on “{topic}” uses nep {version}, which no other version understands")
        else:
            words = _("One of {programs} on “{topic}” uses nep {version}, which no other version understands")
        self._alerts.tell(
            f"version:{pair.line.topic}:{role}",
            words.format(programs=", ".join(names), topic=pair.line.topic, version=version),
            _("Install nep 0.5.4.8 or 0.5.4.5 for that program."),
        )

    def _serve_again(self, pair: ProxyPair, role: Role) -> None:
        if pair.unserved.pop(role, None) is not None:
            self._alerts.resolve(f"version:{pair.line.topic}:{role}")
