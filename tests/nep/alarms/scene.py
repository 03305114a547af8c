"""An alarm in a made-up network: messages, graphs and time come when a test says so."""

from __future__ import annotations

import orjson

from nep.messages.message import Message
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmRule, Alarms
from nep.programs.alarms.alarms import ActionStarter
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

MIDNIGHT_S = 1_790_000_000.0


class Scene:
    """Alarms whose clock stands still; `now` is monotonic."""

    def __init__(self, *rules: AlarmRule, carriers: dict[str, ActionStarter] | None = None) -> None:
        self.now = 100.0
        self.alarms = Alarms(
            rules, carriers=carriers, clock=lambda: self.now, clock_s=lambda: MIDNIGHT_S + self.now
        )
        self.revision = 0

    def wait(self, seconds: float) -> list[tuple[str, object]]:
        """Time goes by in tenths of a second; what happened: (kind, what was seen)."""
        events = []
        for _ in range(round(seconds * 10)):
            self.now += 0.1
            events += self.happened()
        return events

    def happened(self) -> list[tuple[str, object]]:
        """What happened since the last time."""
        return [(event.kind, event.value) for event in self.alarms.tick()]

    def send(self, topic: str, *payloads: object) -> list[tuple[str, object]]:
        """A batch of messages arrives."""
        made = [each if isinstance(each, Message) else message(topic, each) for each in payloads]
        self.alarms.evaluator.evaluate(topic, made)
        return self.happened()

    def graph(
        self,
        topics: tuple[str, ...] = (),
        nodes: tuple[str, ...] = (),
        *,
        losses: dict[str, tuple[int, int]] | None = None,
        epoch: int = 1,
    ) -> list[tuple[str, object]]:
        """The master tells a graph; ``losses`` are (lost, received) of each topic's subscriber."""
        self.revision += 1
        publisher = PublisherInfo(1, "a", (), False, 0, 0, 0, None, None, None)
        told = {}
        for name in topics:
            lost, received = (losses or {}).get(name, (0, 0))
            told[name] = TopicInfo(
                name, "json", "json", (publisher,), (SubscriberInfo(2, "b", received, lost),)
            )
        there = {
            f"id-{name}": NodeInfo(f"id-{name}", name, "here", 1, "python", "native", 0) for name in nodes
        }
        self.alarms.evaluator.update_graph(GraphView(epoch, self.revision, there, told))
        return self.happened()

    def state(self) -> str:
        """How the first alarm is."""
        return self.alarms.evaluator.state(self.alarms.rules[0]).phase


def message(topic: str, payload: object) -> Message:
    """One message; bytes are sent as they are."""
    data = payload if isinstance(payload, bytes) else orjson.dumps(payload)
    return Message(topic, data, "json", "json", seq=1, stamp_ns=1)


def rule(kind: str, name: str, *does: AlarmAction, id: str = "r", **more: object) -> AlarmRule:
    """A rule; what is not of its condition is its own."""
    own = {key: more.pop(key) for key in ("calm_s", "is_enabled", "snoozed_until_s") if key in more}
    return AlarmRule(id, AlarmCondition(kind, name, **more), does, **own)  # type: ignore[arg-type]
