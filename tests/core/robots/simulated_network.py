"""A network without sockets: robots that obey, freeze, die and come back, and strangers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, cast

from app.core.network.source import GraphSeen, Job, Sink
from app.core.robots.stop.stopper import RobotStopper
from app.core.session import Session
from app.core.storage.settings import Settings
from app.robots.identity import DESCRIPTION_TYPE
from nep.errors import NepError
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo
from tests.blocks.samples import robot

if TYPE_CHECKING:
    from nep.nodes.node import Node

Answers = Callable[[Sequence[Message]], None]


class FakeClock:
    """Stands still until a test moves it."""

    now = 1000.0

    def __call__(self) -> float:
        return self.now


@dataclass(eq=False)
class FakeRobot:
    """A real robot's program. ``is_frozen``: it hears and says nothing, and answers when it thaws."""

    network: FakeNetwork
    name: str
    node: str
    is_frozen: bool = False
    is_connected: bool = True
    heard: list[Mapping[str, object]] = field(default_factory=list)
    waiting: list[Mapping[str, object]] = field(default_factory=list)
    ends_actions: bool = False

    def hear(self, command: Mapping[str, object]) -> None:
        """A command arrives."""
        if self.is_frozen:
            self.waiting.append(command)
            return
        self.heard.append(command)
        if command.get("op") == "stop":
            self.say(command, "succeeded")
        elif command.get("op") == "invoke":
            self.say(command, "accepted")
            if self.ends_actions:
                self.say(command, "succeeded")

    def thaw(self) -> None:
        """Go on, with what came meanwhile."""
        self.is_frozen = False
        waiting, self.waiting = self.waiting, []
        for command in waiting:
            self.hear(command)

    def say(self, command: Mapping[str, object], state: str, error: str = "") -> None:
        """Answer."""
        answer = {"id": command["id"], "op": command["op"], "action": command.get("action"), "state": state}
        self.network.publish(f"/{self.name}/answer", {**answer, "error": error}, self.node)

    def stops(self) -> int:
        """How many stops it has heard."""
        return sum(command.get("op") == "stop" for command in self.heard)


class FakePublisher:
    """Studio's publisher of one topic."""

    def __init__(self, network: FakeNetwork, topic: str) -> None:
        self._network, self.topic = network, topic

    @property
    def subscribers(self) -> int:
        return sum(each.is_connected for each in self._network.hearing(self.topic))

    @property
    def missing(self) -> tuple[str, ...]:
        return tuple(each.node for each in self._network.hearing(self.topic) if not each.is_connected)

    def publish(self, payload: object) -> None:
        command = cast("Mapping[str, object]", json.loads(json.dumps(payload)))
        for each in self._network.hearing(self.topic):
            if each.is_connected:
                each.hear(command)

    def close(self) -> None:
        """Nothing is held."""


class FakeSubscriber:
    """Studio's subscriber of one topic."""

    def __init__(self, sinks: list[tuple[str, Answers]], topic: str, sink: Answers) -> None:
        self._sinks, self._own = sinks, (topic, sink)
        sinks.append(self._own)

    def close(self) -> None:
        self._sinks.remove(self._own)


class FakeNetwork:
    """The master, the wire and Studio's node: the session's source, and what gives its stopper a node."""

    id = "studio"
    address = "127.0.0.1:9"

    def __init__(self) -> None:
        self.robots: list[FakeRobot] = []
        self.unlisted: set[str] = set()  # nodes whose lease has ended
        self.strangers: list[tuple[str, str]] = []  # (node, description topic) that come before the robots
        self.sinks: list[tuple[str, Answers]] = []
        self._session_sinks: Sequence[Sink] = ()
        self._post: Callable[[object], None] = lambda _event: None
        self._watched: set[str] = set()
        self._revision = 0

    # ---- what a test lets happen

    def add(self, name: str, node: str = "", **how: bool) -> FakeRobot:
        """A robot's program comes."""
        made = FakeRobot(self, name, node or f"{name.lower()}-1", **how)
        self.robots.append(made)
        return made

    def remove(self, robot: FakeRobot) -> None:
        """A robot's program dies."""
        self.robots.remove(robot)

    def publish(self, topic: str, payload: object, node: str) -> None:
        """A message of this node goes to everybody who listens."""
        self.publish_bytes(topic, json.dumps(payload).encode(), publisher_of(node, topic))

    def publish_bytes(self, topic: str, data: bytes, publisher: int) -> None:
        """The same of bytes, under any publisher's number."""
        kind = DESCRIPTION_TYPE if topic.endswith("/description") else "json"
        message = Message(topic, data, "json", kind, publisher=publisher)
        for wanted, sink in list(self.sinks):
            if wanted == topic:
                sink([message])
        if topic in self._watched:
            for sink_of_all in self._session_sinks:
                sink_of_all(topic, [message])

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Who is there, strangers first."""
        self._revision += 1
        nodes: dict[str, NodeInfo] = {
            "studio": NodeInfo("studio", "studio", "here", None, "python", "native", 0)
        }
        publishers: dict[str, list[PublisherInfo]] = {}
        hearers: dict[str, list[SubscriberInfo]] = {}

        def lists(node: str, published: Iterable[str], heard: Iterable[str]) -> None:
            nodes[node] = NodeInfo(node, node, "here", None, "python", "native", 0)
            for topic in published:
                made = PublisherInfo(publisher_of(node, topic), node, (), False, 0, 0, 0, None, None, None)
                publishers.setdefault(topic, []).append(made)
            for topic in heard:
                hearers.setdefault(topic, []).append(
                    SubscriberInfo(publisher_of(node, topic), node, None, None)
                )

        for node, topic in self.strangers:
            lists(node, [topic], [])
        for each in self.robots:
            if each.node not in self.unlisted:
                home = f"/{each.name}"
                lists(each.node, [f"{home}/description", f"{home}/answer"], [f"{home}/command"])
        topics = {
            topic: TopicInfo(
                topic,
                _type_of(topic),
                "json",
                tuple(publishers.get(topic, ())),
                tuple(hearers.get(topic, ())),
            )
            for topic in dict.fromkeys((*publishers, *hearers))
        }
        return GraphView(1, self._revision, nodes, topics)

    def hearing(self, topic: str) -> list[FakeRobot]:
        """The programs that hear a command topic."""
        return [each for each in self.robots if topic == f"/{each.name}/command"]

    # ---- Studio's node

    def new_pub(self, topic: str, msg_type: str = "json", **_how: object) -> FakePublisher:
        return FakePublisher(self, topic)

    def new_sub(self, topic: str, msg_type: str = "json", *, sink: Answers, **_how: object) -> FakeSubscriber:
        return FakeSubscriber(self.sinks, topic, sink)

    # ---- the session's source

    def start(self) -> None:
        """Nothing runs by itself."""

    def watch(self, topic: str) -> None:
        self._watched.add(topic)

    def tell_descriptions(self) -> None:
        """What is latched comes to those who watch it."""
        for each in self.robots:
            if not each.is_frozen:
                self.publish(f"/{each.name}/description", robot(each.name).source, each.node)

    def unwatch(self, topic: str) -> None:
        self._watched.discard(topic)

    def submit(self, what: str, job: Job) -> None:
        try:
            job(cast("Node", self))
        except NepError:
            return

    def missed(self) -> Mapping[str, int]:
        return {}

    def close(self) -> None:
        """Nothing runs."""

    def source(self, address: str, sinks: Sequence[Sink], post: Callable[[object], None]) -> FakeNetwork:
        """Be the session's source of messages."""
        self.address, self._session_sinks, self._post = address, sinks, post
        return self

    def look(self) -> None:
        """The source asks the master."""
        self._post(GraphSeen(self.graph(), 0.0))


def _type_of(topic: str) -> str:
    leaf = topic.rpartition("/")[2]
    return {"description": DESCRIPTION_TYPE, "command": "robot/command", "answer": "robot/answer"}.get(
        leaf, "json"
    )


def publisher_of(node: str, topic: str) -> int:
    """The number of a node's publisher."""
    return hash((node, topic)) & 0xFFFFFFFF


class SimulatedStudio:
    """A session on a simulated network, with a clock that a test moves."""

    def __init__(self, folder: Path) -> None:
        self.network, self.clock = FakeNetwork(), FakeClock()
        self.session = Session(
            Settings(folder),
            source=self.network.source,
            journal_folder=folder,
            start_processes=False,
            clock=self.clock,
        )
        self.session.start()
        self.session.stopper = RobotStopper(self.network, longest_s=0.1)

    def tick(self, seconds: float = 0.1) -> None:
        """Time goes by, the master tells what is there, and Studio takes it over."""
        self.clock.now += seconds
        self.network.look()
        self.session.tick()
        self.network.tell_descriptions()
        self.session.tick()

    def pass_time(self, seconds: float) -> None:
        """More time goes by."""
        for _ in range(int(seconds / 0.5)):
            self.tick(0.5)

    def stop(self) -> None:
        """Press Stop and wait for its report."""
        self.session.runs.stop()
        thread = self.session.runs._stop_thread
        assert thread is not None
        thread.join(30)
        self.session.tick()

    def close(self) -> None:
        self.session.close()
