"""Real session over a fake network.

`Session.full()` has a master, thirteen topics, the virtual Pepper and a behaviour;
`Session()` is empty. `tick()` updates the values.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from app.core import session as session_module
from app.core.network import doctor as doctor_module
from app.core.network.master import MasterState
from app.core.network.topics import Topic
from app.core.projects.open_projects import OpenProjects
from app.core.projects.project_files import ProjectFiles
from app.core.projects.saved_tabs import SavedTabs
from app.core.robots.robot_link import RobotLink, topics_of
from app.core.run.control import Runs
from app.core.run.runner import RunnerEvent
from app.intents import Inspect
from app.robots.client.stop_report import StopReport
from app.robots.description.model import Robot
from nep.messages.message import Message
from nep.nodes.subscriber import Subscriber
from nep.programs.doctor import Finding, ProgressCallback
from nep.programs.robots.moving import COMMAND_TYPE
from tests.ui import sample_data
from tests.ui.fakes.images import Images
from tests.ui.fakes.network import Network
from tests.ui.fakes.processes import Launcher, Runner
from tests.ui.fakes.storage import OpenProject, Settings

ADDRESS = "127.0.0.1:7780"
TICK_S = 1 / 30


class Clock:
    """Fake clock that a test advances; it starts at the current time, which some panels compare with."""

    def __init__(self, behind_s: float = 0.0) -> None:
        self.now = time.monotonic() - behind_s
        self._epoch_ns = time.time_ns() - round(time.monotonic() * 1e9)

    def __call__(self) -> float:
        """Return the monotonic time in seconds."""
        return self.now

    def ns(self) -> int:
        """Return the time in nanoseconds since 1970."""
        return self._epoch_ns + round(self.now * 1e9)

    def epoch_s(self) -> float:
        """Return the time in seconds since 1970."""
        return self.ns() / 1e9


class Doctor(doctor_module.Doctor):
    """Real doctor that finds what a test defines, immediately and in the calling thread."""

    is_running = False  # type: ignore[assignment]  # what a test says instead of a thread

    def __init__(self) -> None:
        super().__init__(self._find_at_once, lambda: 1_795_164_093.0)
        self.looked = 0
        self.found: tuple[Finding, ...] = ()

    def start(self) -> None:
        self.looked += 1
        self._run_checks()

    def _find_at_once(self, _topic: str, tell: ProgressCallback) -> tuple[Finding, ...]:
        if self.found is not None:  # otherwise the check is cancelled
            tell(self.found, len(self.found), len(self.found))
        return self.found


_open: list[Session] = []


class Session(session_module.Session):
    """Session without master, topics and robots, with an empty behaviour. `close_sessions` closes it."""

    documents: OpenProjects
    launcher: Launcher
    doctor: Doctor

    def __init__(self, clock: Clock | None = None) -> None:
        self.clock = clock if clock is not None else Clock()
        super().__init__(
            Settings(),
            address=ADDRESS,
            source=Network,
            clock=self.clock,
            clock_ns=self.clock.ns,
            start_processes=False,
        )
        post = self._mailbox.post_event
        self.documents = OpenProjects(OpenProject)
        self.document.key = "behaviour-1"
        warn = partial(self.console.add, "warn", "studio")
        self.tabs = SavedTabs(self.settings, self.documents, warn)
        self.files = ProjectFiles(self.documents, self.tabs, self.settings, warn)
        self.runs = Runs(
            self.documents, self.fleet, self,
            alerts=self.alerts, console=self.console, post_event=post, clock=self.clock,
            create_runner=self._make_runner,  # type: ignore[arg-type]
        )  # fmt: skip
        self.runs.starting_robots = lambda: self.starting_robots
        self.runs.before_stop = self.acting.disarm
        self.doctor = Doctor()
        self.launcher = Launcher(ADDRESS, post, self.fleet.is_present, self.clock)
        self.live.images = Images(self.live.watch, self.clock)
        self.live.master = MasterState("none", ADDRESS)
        self.alarms.path = self.acting.path = None  # stored in memory only
        self.ticks = 0
        self.runner: Runner | None = None
        """The program that runs, or ran last."""
        self._ears: dict[str, list[Subscriber]] = {}
        _open.append(self)

    @property
    def document(self) -> OpenProject:
        """Behaviour of the current tab."""
        current = self.documents.current
        assert isinstance(current, OpenProject)
        return current

    @property
    def watched(self) -> list[str]:
        """Topics watched by panels, in the order of their first watch."""
        answers = {link.robot.topics.reply for link in self.fleet.links}
        watched = self.live.source.wanted - answers
        return [topic for topic in dict.fromkeys(self.live.source.asked) if topic in watched]

    @property
    def looked_at(self) -> list[str]:
        """Names of the robots whose sensors are watched."""
        return [
            link.name for link in self.fleet.links if set(topics_of(link.robot)) <= self.live.source.wanted
        ]

    def _make_runner(self, on_event: Callable[[RunnerEvent], object]) -> Runner:
        self.runner = Runner(on_event)
        return self.runner

    def update_parts(self) -> None:
        """Include the parts that a test has replaced in ticks and checks."""
        del self._parts

    # -- events that a test triggers

    def take_over(self) -> None:
        """Process the posted events without advancing the clock."""
        super().tick()

    def tick(self) -> None:
        """Advance the clock by a thirtieth of a second and update values, images and events."""
        self.ticks += 1
        self.clock.now += TICK_S
        now_ns = self.clock.ns()
        for topic in self.live.topics.existing_topics():
            if topic.rate_hz:
                topic.last_stamp_ns = now_ns - round(self.ticks * 0.033 % (1 / topic.rate_hz) * 1e9)
        if self.ticks % 3 == 0:
            self.live.source.send(self._message("/blackboard", sample_data.blackboard(self.ticks / 30)))
        pictures: Images = self.live.images  # also while a recording is open
        for stream in pictures.streams:
            if not stream.is_suspended:
                pictures.look(stream.topic)
        super().tick()

    def put(self, topic: Topic) -> Topic:
        """Add or replace a topic with all its properties."""
        if topic.age_s is not None:
            topic.last_stamp_ns = self.clock.ns() - round(topic.age_s * 1e9)
        if topic.gone_s is not None:
            topic.gone_since_s = self.clock() - topic.gone_s
        self.live.topics._topics[topic.name] = topic
        self.live.topics.revision += 1
        self.live.topics.values_revision += 1
        return topic

    def remove(self, name: str) -> None:
        """Remove a topic."""
        del self.live.topics._topics[name]
        self.live.topics.revision += 1

    def send(self, topic: str, payload: object) -> Message:
        """Deliver a message on a topic, if it is watched, and return the message."""
        message = self._message(topic, payload)
        self.live.source.send(message)
        self.take_over()
        return message

    def _message(self, topic: str, payload: object) -> Message:
        known = self.live.topics.get(topic) or Topic(topic, "json", "json")
        data = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        seq = (known.newest.seq or 0) + 1 if known.newest is not None else 18204
        return Message(
            topic, data, known.codec, known.msg_type, stamp_ns=time.time_ns() - 600_000, seq=seq, publisher=1
        )

    def join(self, robot: Robot, *, virtual: bool = True) -> RobotLink:
        """Connect a robot whose last stop was confirmed; `asked` and `changes` return its commands."""
        topics = robot.topics
        self._ears[robot.name] = [
            self.live.source.listen(topics.command, COMMAND_TYPE),
            *([self.live.source.listen(topics.world, "json")] if topics.world is not None else []),
        ]
        self.fleet.connect(replace(robot, virtual=virtual), topics.description)
        self.fleet.apply_stop({robot.name: ("confirmed in 41 ms, at 8:40", "ok")}, StopReport((), 0.0))
        self.take_over()
        link = self.fleet.link(robot.name)
        assert link is not None
        return link

    def asked(self, name: str) -> list[tuple[object, object, object]]:
        """Return the commands to a robot since the last call as (op, action, input), without heartbeats."""
        told = _heard(self._ears[name][0])
        return [(one["op"], one["action"], one.get("input")) for one in told if one["op"] != "alive"]

    def changes(self, name: str) -> list[Mapping[str, object]]:
        """Return the changes to a robot's world since the last call."""
        return _heard(self._ears[name][1])

    @classmethod
    def full(cls) -> Session:
        """Return a session with the content of the design drawings."""
        session = cls(Clock(behind_s=sample_data.LOG[0][0]))
        clock, end = session.clock, session.clock.now + sample_data.LOG[0][0]
        at_ns = clock.ns() + sample_data.LOG[0][0] * 1_000_000_000
        session.live.source.find_master()
        for revision, ago in ((1, 5.2), (2, 4.2)):
            clock.now = end - ago
            session.live.source.tell(sample_data.graph(revision, at_ns))
            session.take_over()
        for place, topic in enumerate(session.live.topics):
            wave = 0.02 if place % 3 == 0 else 0.5
            usual = topic.rate_hz or 1.0
            topic.rates.clear()
            topic.rates.extend(usual * (1 + wave * math.sin(k * 0.7 + place)) for k in range(40))
        clock.now = end
        link = session.join(sample_data.pepper())
        link.values.update(sample_data.VALUES)
        link.drawing = sample_data.drawing()
        session.doctor.found = sample_data.FOUND
        session.live.images.camera = lambda _topic: sample_data.picture()
        session.document.name = "Greeting"
        session.document.source = sample_data.PROGRAM
        session.document.set_blocks(sample_data.WORKSPACE)
        session.document.found = sample_data.PROBLEMS
        session.document.absent_blocks = ("b8", "b9")
        session.console.clear()
        for ago, level, origin, text in sample_data.LOG:
            clock.now = end - ago
            session.console.add(level, origin, text)
        session.alerts.raise_alert(
            "message:/faces", "error", "/faces sends text that is not JSON since 8:41.",
            "1 204 messages can't be decoded.", button="Show the bytes", intent=Inspect("/faces"),
        )  # fmt: skip
        return session


def _heard(ear: Subscriber) -> list[Mapping[str, object]]:
    heard = []
    while (message := ear.receive(0.0)) is not None:
        heard.append(message.payload)
    return heard


def close_sessions() -> None:
    """Close all sessions that a test created, with their threads."""
    while _open:
        _open.pop().close()
