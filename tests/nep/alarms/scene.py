"""Simulated network for tests of alarms, with messages, graphs and a clock that the test controls."""

from __future__ import annotations

import orjson

from nep.messages.message import Message
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmRule, Alarms
from nep.programs.alarms.alarms import ActionStarter
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo

MIDNIGHT_S = 1_790_000_000.0


class Scene:
    """Alarms with a fake clock; `now` is in monotonic seconds."""

    def __init__(self, *rules: AlarmRule, action_starters: dict[str, ActionStarter] | None = None) -> None:
        self.now = 100.0
        self.alarms = Alarms(
            rules,
            action_starters=action_starters,
            clock=lambda: self.now,
            clock_s=lambda: MIDNIGHT_S + self.now,
        )
        self.revision = 0

    def wait(self, seconds: float) -> list[tuple[str, object]]:
        """Advance the clock in steps of 0.1 s. Return the events as (kind, value)."""
        events = []
        for _ in range(round(seconds * 10)):
            self.now += 0.1
            events += self.happened()
        return events

    def happened(self) -> list[tuple[str, object]]:
        """Return the events since the last call as (kind, value)."""
        return [(event.kind, event.value) for event in self.alarms.tick()]

    def send(self, topic: str, *payloads: object) -> list[tuple[str, object]]:
        """Deliver a batch of messages. Return the events."""
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
        """Deliver a graph. ``losses`` has (lost, received) of each topic's subscriber. Return the events."""
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
        """Return the phase of the first alarm."""
        return self.alarms.evaluator.state(self.alarms.rules[0]).phase


def message(topic: str, payload: object) -> Message:
    """Return a message with the payload as JSON; bytes are used unchanged."""
    data = payload if isinstance(payload, bytes) else orjson.dumps(payload)
    return Message(topic, data, "json", "json", seq=1, stamp_ns=1)


def rule(kind: str, name: str, *does: AlarmAction, id: str = "r", **more: object) -> AlarmRule:
    """Return a rule. Keyword arguments that belong to the rule go to it, all others to its condition."""
    own = {key: more.pop(key) for key in ("calm_s", "is_enabled", "snoozed_until_s") if key in more}
    return AlarmRule(id, AlarmCondition(kind, name, **more), does, **own)  # type: ignore[arg-type]
