"""A session in memory, for tests and for looking at panels alone, with the interface of the real one.

`Session.full()` has a master, thirteen topics, the virtual Pepper and a behaviour; `Session()` has nothing.
`tick()` makes the figures move; what panels ask for is written down in `calls`.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from app.blocks import Problem, Program, compile_behaviour, editor_definitions
from app.core.alerts import Alerts
from app.core.console import Console
from app.core.documents import document as document_module
from app.core.documents.workspace_json import WorkspaceJson
from app.core.messages.picture import Picture
from app.core.network import doctor as doctor_module
from app.core.network import topics as topics_module
from app.core.network.mailbox import Batch
from app.core.network.master import MasterState
from app.core.network.nodes import Nodes
from app.core.network.traffic import Traffic
from app.core.network.watches import Watch, Watches
from app.core.robots import fleet as fleet_module
from app.core.robots import robot_link as link_module
from app.robots.description.inputs import Choice, Parameter
from app.robots.description.model import Action, DataField, Event, Robot, RobotTopics, SafeStop, Sensor
from app.robots.heartbeat import Heartbeat
from nep.doctor import Finding
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo


def Topic(name: str, msg_type: str = "json", codec: str = "json", **more: object) -> topics_module.Topic:
    """A topic of the real kind as most tests want it: one node publishes it, and nothing is lost."""
    given: dict[str, object] = {
        "publishers": 1,
        "publisher_nodes": ("pepper_driver",),
        "lost": 0,
        "loss_ratio": 0.0,
    }
    made = topics_module.Topic(name, msg_type, codec, **(given | more))  # type: ignore[arg-type]
    if made.gone_s is not None:
        made.gone_since = -made.gone_s
    return made


class Topics(topics_module.Topics):
    """The real topics; tests put some there and take them away."""

    def put(self, topic: topics_module.Topic) -> topics_module.Topic:
        self._topics[topic.name] = topic
        self.revision += 1
        self.values_revision += 1
        return topic

    def remove(self, name: str) -> None:
        del self._topics[name]
        self.revision += 1


class ImageStream:
    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.picture: Picture | None = None
        self.arriving_hz: float | None = None
        self.shown_hz: float | None = None
        self.silent_s: float | None = None
        self.error: str | None = None
        self.painted: list[Picture] = []
        self.closed = False
        self.held = self.resting = False
        self.awaits_picture = True
        self.wishes: list[tuple[int, int] | None] = []

    @property
    def age_s(self) -> float | None:
        return self.silent_s

    def rest(self) -> None:
        if not self.resting:
            self.resting = self.awaits_picture = True

    def wake(self) -> None:
        if not self.closed:
            self.resting = False

    def want(self, size: tuple[int, int] | None) -> None:
        if not self.wishes or self.wishes[-1] != size:
            self.wishes.append(size)

    def hold(self, held: bool) -> None:
        self.held = held

    def shown(self) -> None:
        if self.picture is not None:
            self.painted.append(self.picture)

    def close(self) -> None:
        self.resting = self.closed = True


class Images:
    def __init__(self) -> None:
        self.streams: list[ImageStream] = []
        self.source: Callable[[str], Picture | None] = lambda _topic: None

    def stream(self, topic: str) -> ImageStream:
        stream = ImageStream(topic)
        stream.picture = self.source(topic)
        if stream.picture is not None:
            stream.arriving_hz, stream.shown_hz, stream.silent_s = 15.0, 15.0, 0.02
            stream.awaits_picture = False
        self.streams.append(stream)
        return stream


def Invocation(
    id: str, action: str, state: str = "running", feedback: Mapping[str, object] | None = None, *,
    elapsed_s: float = 0.0, left_s: float | None = None, **more: object,
) -> link_module.Invocation:  # fmt: skip
    """A try of the real kind, at whose clock so much time has passed."""
    made = link_module.Invocation(id, action, state, feedback or {}, clock=lambda: elapsed_s, **more)  # type: ignore[arg-type]
    if left_s is not None:
        made.begun_s, made.timeout_s = 0.0, elapsed_s + left_s
    return made


class Line:
    """Stands for a publisher to a robot that hears everything."""

    def __init__(self) -> None:
        self.published: list[object] = []

    def publish(self, payload: object) -> None:
        self.published.append(payload)

    def close(self) -> None:
        """Nothing is to be closed."""


def RobotLink(name: str, robot: Robot, *, virtual: bool = True, **more: object) -> link_module.RobotLink:
    """A robot of the real kind that is reached, and has answered a stop."""
    described = robot if robot.virtual == virtual else replace(robot, virtual=virtual)
    given: dict[str, object] = {
        "last_stop": "answered in 41 ms, at 8:40",
        "last_stop_status": "ok",
        "publisher": Line(),
        "world": Line(),
    }
    return link_module.RobotLink(name, described, **(given | more))  # type: ignore[arg-type]


class Kept(dict[str, object]):
    """Settings of which nothing is written to a disk."""

    def set(self, key: str, value: object) -> None:
        self[key] = value


class NoHeartbeat(Heartbeat):
    """Nothing has to be kept going: no thread."""

    def beat(self, name: str, publisher: object) -> None:
        """It goes on by itself."""


class Fleet(fleet_module.Fleet):
    """The real fleet; tests let robots join and leave, and read in ``calls`` what panels asked of it."""

    def __init__(self, calls: list[tuple[object, ...]], watches: Watches) -> None:
        super().__init__(watches, lambda _what, _job: None, settings=Kept())  # type: ignore[arg-type]
        self._alive = NoHeartbeat(link_module.SENDER, "none")
        self.calls = calls
        self._looked_at: list[tuple[str, Watch]] = []

    @property
    def looked_at(self) -> list[str]:
        """The robots whose sensors somebody sees."""
        return [name for name, watch in self._looked_at if not watch.resting]

    def join(self, link: link_module.RobotLink) -> link_module.RobotLink:  # type: ignore[override]
        """One comes, with everything that it is."""
        self._links[link.name] = link
        self.revision += 1
        return link

    def leave(self, name: str) -> link_module.RobotLink:
        """As if it had never been there."""
        self.revision += 1
        return self._links.pop(name)

    def look_at(self, name: str) -> Watch:
        watch = super().look_at(name)
        self._looked_at.append((name, watch))
        return watch

    def invoke(self, name: str, action: str, input: Mapping[str, object]) -> link_module.Invocation:
        self.calls.append(("invoke", name, action, dict(input)))
        return super().invoke(name, action, input)

    def cancel(self, name: str, action: str) -> None:
        self.calls.append(("cancel", name, action))
        super().cancel(name, action)

    def world(self, name: str, change: Mapping[str, object]) -> None:
        self.calls.append(("world", name, dict(change)))
        super().world(name, change)


PROGRAM = """import studio

robots = studio.robots("Pepper")


@studio.when_started
def when_started():
    # Say hello, then wait for somebody.
    robots.Pepper.light(where="eyes", colour="#33b8ff")
    robots.Pepper.say("Hello! I am Pepper.")
    studio.wait_until(lambda: robots.Pepper.sees_face)
    for _ in range(3):
        robots.Pepper.turn(direction="left", angle=30)
        robots.Pepper.say("Touch my head.")
        studio.wait(2)
    robots.Pepper.emotion("happy", seconds=4)
"""


WORKSPACE = {
    "blocks": {
        "languageVersion": 0,
        "blocks": [
            {"type": "events_started", "id": "b1", "x": 30, "y": 40, "next": {"block": {
                "type": "control_wait", "id": "b2", "inputs": {
                    "SECONDS": {"shadow": {"type": "values_number", "fields": {"NUMBER": 2}}}}}}},
        ],
    }
}  # fmt: skip


class NoJournal:
    """Keeps nothing."""

    name = "unkept"

    def write(self, *_what: object) -> None:
        """Nothing is written."""

    def discard(self) -> None:
        """Nothing was written."""


EMPTY = compile_behaviour({}, [])


class Document(document_module.Document):
    """The real document without a journal; its program is what a test tells."""

    def __init__(self, calls: list[tuple[object, ...]]) -> None:
        super().__init__(NoJournal)  # type: ignore[arg-type]
        self.calls = calls
        self.key = "behaviour-1"
        self.found: tuple[Problem, ...] = ()
        self.sensors: tuple[tuple[str, str], ...] = ()
        self.known: Callable[[], list[Robot]] = list
        self.source = ""
        self.compiled = 0
        self.told: tuple[object, Program] | None = None
        self.absent_blocks: tuple[str, ...] = ("b8", "b9")

    def edited(self, workspace: Mapping[str, object] | WorkspaceJson) -> None:
        workspace = workspace.blocks if isinstance(workspace, WorkspaceJson) else workspace
        self.calls.append(("edited", workspace))
        super().edited(workspace)

    def program(self) -> Program:
        self.compiled += 1
        return replace(
            EMPTY, source=self.source, problems=self.found, sensors=self.sensors, absent=self.absent_blocks
        )

    def newest(self) -> Program:
        key = self._key()
        if self.told is None or self.told[0] != key:
            self.told = (key, self.program())
        return self.told[1]

    def definitions(self) -> Mapping[str, object]:
        return editor_definitions(self.known())


class Documents:
    """The open behaviours; tests put more into ``them``."""

    def __init__(self, first: Document) -> None:
        self.them = [first]
        self.current = first

    def __iter__(self) -> Iterator[Document]:
        return iter(self.them)

    def with_key(self, key: str) -> Document | None:
        return next((each for each in self.them if each.key == key), None)

    @property
    def definitions_revision(self) -> object:
        return tuple(each.definitions_revision for each in self.them)

    def definitions(self) -> Mapping[str, object]:
        return self.current.definitions()


class Doctor(doctor_module.Doctor):
    """The real one; finds what the test says, at once and in the thread that asks."""

    looking = False  # type: ignore[assignment]  # what a test says instead of a thread

    def __init__(self, calls: list[tuple[object, ...]]) -> None:
        super().__init__(lambda: self.found, lambda: 1_795_164_093.0)
        self.calls = calls
        self.found: tuple[Finding, ...] = ()

    def look(self) -> None:
        self.calls.append(("look",))
        self._run()


class Session:
    """Has nothing: no master, no topic, no robot, an empty behaviour."""

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.settings = SimpleNamespace(get=lambda _key, default: default, set=lambda _key, _value: None)
        self.topics = Topics()
        self.nodes = Nodes()
        self.alerts = Alerts()
        self.doctor = Doctor(self.calls)
        self.console = Console()
        self.watches = Watches(self._begin_watch, self._end_watch)
        self._looks: list[Watch] = []
        self.fleet = Fleet(self.calls, self.watches)
        self.images = Images()
        self.documents = Documents(Document(self.calls))
        self.document.known = lambda: [link.robot for link in self.fleet.connected]
        self.runs = SimpleNamespace(
            running_blocks=(), stopped_blocks=(), block_errors={}, blocks_revision=0, active=False,
            document=self.document,
            stop_robot=lambda name: self.calls.append(("stop_robot", name)),
        )  # fmt: skip
        self.launcher = SimpleNamespace(
            ensure_master=lambda: self.calls.append(("ensure_master",)),
            start_virtual_robot=lambda name="Pepper", model="pepper": self.calls.append(
                ("start_virtual_robot", name)
            ),
            virtual_robots=(),
        )
        self.graph: SimpleNamespace | None = None
        self.master = MasterState("none", "127.0.0.1:7780")
        self.traffic = Traffic(self.topics)
        self.tick_ms = 0.0
        self.ticks = 0

    @property
    def document(self) -> Document:
        return self.documents.current

    @property
    def watched(self) -> list[str]:
        """The topics that panels look at, in the order in which they began."""
        return [each.topics[0] for each in self._looks if not each.resting]

    def watch(self, topic: str) -> Watch:
        self._looks.append(self.watches.open([topic]))
        return self._looks[-1]

    def _begin_watch(self, topic: str) -> None:
        if topic in self.topics:
            self.topics[topic].watched = True

    def _end_watch(self, topic: str) -> None:
        self.topics.unwatch(topic)
        self.fleet.unwatched(topic)

    def send(self, topic: str, payload: object) -> Message:
        """A message arrives on a topic, as it would for a watched one."""
        known = self.topics[topic]
        data = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        seq = (known.newest.seq or 0) + 1 if known.newest is not None else 18204
        message = Message(
            topic, data, known.codec, known.msg_type, stamp_ns=time.time_ns() - 600_000, seq=seq, publisher=1
        )
        self.topics.add(topic, Batch([message]), 0.0)
        return message

    @classmethod
    def full(cls) -> Session:
        """A session as in the design's pictures."""
        session = cls()
        session.master = MasterState("connected", "127.0.0.1:7780")
        nodes = {str(number): None for number in range(7)}
        session.graph = SimpleNamespace(nodes=nodes, topics={})
        for topic in topics():
            session.topics.put(topic)
        session.nodes.update(nodes_seen(1), 0.0)
        session.nodes.update(nodes_seen(2), 1.0)
        session.nodes.age(5.2)
        session.doctor.found = FOUND
        link = session.fleet.join(RobotLink("Pepper", pepper()))
        link.values.update(
            head_touched=False, distance=0.82, battery=84, sees_face=True, sound=34.0, heard_word="hello",
            pose={"x": 1.284, "y": -0.307, "theta": 31.5},
            faces={"count": 1, "name": "Aiko", "width": 320, "height": 240,
                   "items": [{"name": "face", "confidence": 0.97, "box": [118, 36, 71, 77]}]},
        )  # fmt: skip
        link.drawing = drawing()
        session.images.source = lambda _topic: picture()
        session.document.name = "Greeting"
        session.document.source = PROGRAM
        session.document.workspace = WORKSPACE
        session.document.found = (
            Problem("warning", "b8", "robot", "wave", "NAO is not connected, so wave will be skipped.",
                    "Connect NAO", "connect:NAO", icon="hand"),
            Problem("info", "b3", "control", "wait until", "wait until may wait for ever if nobody comes.",
                    "Add a time limit", "add_time_limit", icon="hourglass"),
        )  # fmt: skip
        now = time.time()
        stamps = iter([now - ago for ago, _, _, _ in LOG])
        session.console = Console(lambda: next(stamps, now))
        for _, level, origin, text in LOG:
            session.console.add(level, origin, text)
        session.alerts.put(
            "message:/faces", "error", "/faces sends text that is not JSON since 8:41.",
            "1 204 messages could not be read.", button="Look at the raw bytes", action="inspect:/faces",
        )  # fmt: skip
        return session

    def tick(self) -> None:
        """A thirtieth of a second goes by."""
        self.ticks += 1
        for topic in self.topics:
            if topic.rate_hz is not None:
                topic.age_s = (self.ticks * 0.033) % (1 / topic.rate_hz)
        if "/blackboard" in self.watched and self.ticks % 3 == 0:
            self.send("/blackboard", blackboard(self.ticks / 30))


LOG = (
    (40, "info", "gateway", "RIZE joined (original NEP, port 50000)"),
    (12, "info", "master", "/speech/words is new, 2 publishers"),
    (8, "error", "lidar_driver", "left without saying goodbye"),
    (5, "warn", "/cmd_vel", "lost 12 of 571 messages in 30 s"),
    (1, "info", "greeting", "turn left by 30° succeeded (1.84 s)"),
    (0, "info", "greeting", "say “Touch my head.” started"),
)


FOUND = (
    Finding(
        "master:foreign",
        "error",
        "Port 7780 is held by “python3 server.py” (process 77), which is no master.",
        "End that program, or start the master on port 7781 and tell it to all programs"
        " (NEP_MASTER=127.0.0.1:7781).", "nep master --port 7781",
    ),
    Finding(
        "port:7000", "warning", "The AirPlay Receiver holds port 7000, where programs of nep up to 0.5.4.5,"
        " nep-js and C# ask.", "Switch it off in the system settings, under General, AirDrop & Handoff.",
    ),
    Finding("versions", "info", "NEP Studio 0.1.0, Python 3.11.7, pyzmq 27.3.0, libzmq 4.3.5, Linux 6.18."),
    Finding("loopback", "ok", "Programs of this computer can reach each other (127.0.0.1)."),
    Finding("files", "ok", "A program may open 20000 files."),
)  # fmt: skip


def topics() -> list[topics_module.Topic]:
    """The thirteen of picture 04."""
    image, string, raw = ("image", "image"), ("string", "string"), ("bytes", "bytes")
    rows: list[tuple[str, tuple[str, str], int, float, float, float]] = [
        ("/robot/camera", image, 1, 30.0, 1.2e6, 0.012),
        ("/robot/depth", image, 1, 60.0, 5.1e6, 0.021),
        ("/blackboard", ("json", "json"), 1, 10.0, 18e3, 0.064),
        ("/odom", ("json", "json"), 1, 50.0, 11e3, 0.008),
        ("/joint_states", ("json", "json"), 1, 50.0, 46e3, 0.009),
        ("robot_action", ("json", "json"), 1, 0.4, 92.0, 2.1),
        ("action_state", ("json", "json"), 1, 0.8, 180.0, 1.7),
        ("/faces", ("json", "json"), 1, 14.9, 4.1e3, 0.041),
        ("/touch", ("json", "json"), 1, 2.0, 160.0, 0.4),
        ("/distance", ("json", "json"), 1, 20.0, 1.6e3, 0.031),
        ("/speech/words", string, 2, 0.2, 14.0, 6.0),
        ("/cmd_vel", ("json", "json"), 1, 20.0, 2.0e3, 0.038),
        ("/lidar/scan", raw, 0, 0.0, 0.0, 0.0),
    ]
    made = [
        Topic(name, kind[0], kind[1], publishers=publishers, rate_hz=rate, bandwidth_Bps=bandwidth, age_s=age)
        for name, kind, publishers, rate, bandwidth, age in rows
    ]
    made[1].lost, made[1].loss_ratio = 7, 0.004
    made[11].lost, made[11].loss_ratio = 12, 0.021
    made[10].new = True
    for place, topic in enumerate(made):
        wave = 0.02 if place % 3 == 0 else 0.5
        topic.rates.extend((topic.rate_hz or 1.0) * (1 + wave * math.sin(k * 0.7 + place)) for k in range(40))
    gone = made[12]
    gone.gone_s, gone.rate_hz, gone.bandwidth_Bps, gone.age_s, gone.lost, gone.loss_ratio = 4.2, *[None] * 5
    return made


def nodes_seen(revision: int) -> GraphView:
    """The nodes of picture 04: at first with the lidar, then without it and with RIZE."""
    rows = [
        ("1", "camera_driver", "lab-pc", 4110, "Python", "native", 0.12),
        ("2", "pepper_driver", "lab-pc", 4132, "Python", "native", 0.31),
        ("3", "blackboard", "lab-pc", 4140, "Python", "native", 0.04),
        ("4", "studio", "lab-pc", 4090, "Python", "native", 0.081),
        ("5", "old_voice", "lab-pc", 4155, "Python", "B", 0.02),
        ("6", "lidar_driver", "lab-pc", 4160, "C++", "native", 0.2)
        if revision == 1
        else ("7", "RIZE", "lab-pc", 4166, "JavaScript", "A", 1.3),
    ]
    nodes = {row[0]: NodeInfo(*row[:6], 1_795_164_000_000_000_000, row[6]) for row in rows}  # type: ignore[arg-type]
    ends = {
        "/robot/camera": "14", "/robot/depth": "1", "/odom": "2", "/touch": "24", "/distance": "2",
        "/joint_states": "2", "/blackboard": "34", "robot_action": "7", "/speech/words": "5",
        "/lidar/scan": "6",
    }  # fmt: skip
    topics = {
        name: TopicInfo(
            name, "json", "json",
            (PublisherInfo(1, ids[0], (), False, 0, 0, 0, None, None, None),),
            tuple(SubscriberInfo(2, id, 0, 0) for id in ids[1:]),
        )
        for name, ids in ends.items()
    }  # fmt: skip
    return GraphView(1, revision, nodes, topics)


def blackboard(t: float = 0.0) -> dict[str, object]:
    """The message of picture 04, moving with ``t`` seconds."""
    return {
        "stamp": round(1795164093.412 + t, 3),
        "robots": {
            "Pepper": {
                "battery": 84,
                "emotion": "happy" if int(t) % 2 == 0 else "surprised",
                "pose": {
                    "x": round(1.284 + 0.01 * math.sin(t), 3),
                    "y": round(-0.307 + 0.01 * math.cos(t), 3),
                    "theta": round(31.5 + t, 1),
                },
                "touched": False,
                "speaking": int(t * 2) % 2 == 0,
                "joints": [0.0] * 20,
                "language": "en",
            }
        },
        "people": [
            {"name": "Aiko", "distance": round(0.82 + 0.01 * math.sin(2 * t), 3),
             "face": {"x": 1, "y": 2, "width": 70, "height": 77}, "age_s": round(t % 0.1, 3), "looking": True}
        ],
        "objects": [{"kind": "ball"}, {"kind": "marker"}],
        "words": [],
        "note": None,
    }  # fmt: skip


def drawing(**changes: object) -> dict[str, object]:
    """The virtual robot's state of picture 02."""
    state: dict[str, object] = {
        "x": 0.05, "y": 0.0, "theta_deg": 0.0, "head_yaw_deg": 0.0, "head_pitch_deg": 0.0,
        "speech": "Touch my head.", "eyes": "#35b0fa", "shoulders": "#3ab5ff", "emotion": "neutral",
        "arm_left_deg": 124.0, "arm_right_deg": 0.0, "moving": False, "touched": [],
        "objects": [
            {"kind": "ball", "name": "ball", "x": 0.1, "y": -1.65, "z": 0.11, "radius": 0.11,
                "colour": "#d8403f"},
            {"kind": "table", "x": -0.85, "y": 1.95, "width": 1.0, "depth": 0.6, "height": 0.7,
                "theta_deg": 0},
        ],
        "room": {"width": 6.0, "depth": 5.0, "height": 2.6, "openings": []},
    }  # fmt: skip
    return {**state, **changes}


def picture(width: int = 320, height: int = 240) -> Picture:
    """A camera picture: a wall, a floor, a red ball."""
    bgra = np.empty((height, width, 4), np.uint8)
    bgra[:] = (190, 198, 196, 255)
    bgra[height // 2 :] = (96, 128, 152, 255)
    rows, columns = np.ogrid[:height, :width]
    bgra[(rows - 150) ** 2 + (columns - 250) ** 2 < 22**2] = (58, 62, 210, 255)
    extension = {"shape": [height, width, 3], "encoding": "bgr8"}
    data = np.ascontiguousarray(bgra[:, :, :3]).tobytes()
    message = Message("/robot/camera", data, "image", "image", stamp_ns=time.time_ns(), extension=extension)
    return Picture(bgra, width, height, 7, message.stamp_ns, time.monotonic(), message)


def _action(name: str, title: str, icon: str, parameters: Sequence[Parameter], **more: object) -> Action:
    return Action(
        name, title, icon, str(more.pop("category", "Movement")), tuple(parameters), f"%robot {title}", None,
        "/Pepper/command", "/Pepper/answer", **more,  # type: ignore[arg-type]
    )  # fmt: skip


def _choices(*pairs: tuple[str, str]) -> tuple[Choice, ...]:
    return tuple(Choice(value, title) for value, title in pairs)


ACTIONS = (
    _action("say", "say", "message-circle", [
        Parameter("text", "text", "text", default="Nice to meet you, Aiko.", required=True, min_length=1,
            max_length=300),
        Parameter("volume", "volume", "integer", 0, 100, 5, "%", 60),
        Parameter("language", "language", "choice", default="en",
                  choices=_choices(("en", "English"), ("fr", "French"), ("ja", "Japanese"))),
    ], category="Speech", cancellable=True),
    _action("turn", "turn", "rotate-ccw", [
        Parameter("angle", "angle", "angle", -180, 180, 5, "°", 30, required=True),
        Parameter("speed", "speed", "number", 10, 90, 1, "°/s", 40, advanced=False),
    ], cancellable=True),
    _action("light", "light", "lightbulb", [
        Parameter("where", "where", "choice", default="eyes",
                  choices=_choices(("eyes", "Eyes"), ("shoulders", "Shoulders"), ("both", "Both"))),
        Parameter("colour", "colour", "colour", default="#3ab7ff", required=True),
    ], category="Face and lights"),
    _action("walk", "walk", "footprints", [
        Parameter("distance", "distance", "number", -1, 1, 0.05, "m", 0.5, required=True),
    ], risk="moves", cancellable=True),
    _action("emotion", "show emotion", "smile", [
        Parameter("emotion", "emotion", "choice", default="happy", choices=_choices(
            ("neutral", "neutral"), ("happy", "happy"), ("sad", "sad"), ("surprised", "surprised"),
            ("angry", "angry"))),
        Parameter("seconds", "for", "number", 0, 60, 0.5, "s", 2, advanced=True),
        Parameter("gestures", "gestures", "boolean", default=True),
    ], category="Face and lights"),
    _action("listen", "listen for", "ear", [
        Parameter("words", "words", "list", default=["yes", "no"]),
        Parameter("picture", "picture", "image"),
        Parameter("count", "count", "integer", default=1),
    ], category="Speech"),
    _action("stop", "stop everything", "square", [], synchronous=True),
)  # fmt: skip

SENSORS = (
    Sensor("head_touched", "head touch", "boolean", "/Pepper/head_touched", icon="hand"),
    Sensor("distance", "distance", "number", "/Pepper/distance", "m", 0, 2, icon="ruler"),
    Sensor("battery", "battery", "integer", "/Pepper/battery", "%", 0, 100, icon="battery-medium"),
    Sensor("sees_face", "sees a face", "boolean", "/Pepper/sees_face", icon="scan-face"),
    Sensor("faces", "faces", "detections", "/Pepper/faces", icon="scan-face", camera="camera"),
    Sensor("sound", "sound", "number", "/Pepper/sound", "dB", 0, 150, icon="volume-2"),
    Sensor("heard_word", "heard word", "text", "/Pepper/heard_word", icon="ear"),
    Sensor("pose", "position", "object", "/Pepper/pose", icon="navigation", fields=(
        DataField("x", "x", "number", "m"), DataField("y", "y", "number", "m"),
            DataField("theta", "facing", "number", "°"))),
    Sensor("camera", "camera", "image", "/Pepper/camera", rate_hz=15, icon="camera"),
)  # fmt: skip


def pepper(name: str = "Pepper") -> Robot:
    """The virtual robot's description, with one parameter of every kind."""
    touched = Event(
        "touched",
        "touched",
        "hand",
        "Sensors",
        (),
        ("place",),
        "when %robot %place is touched",
        "/Pepper/touched",
    )
    return Robot(
        name, "virtual-pepper", "Virtual Pepper", True, "native", ACTIONS, SENSORS, (touched,),
        SafeStop("stop", 1.0, 0.2, True, True, True), ("base",),
        RobotTopics("/Pepper/description", "/Pepper/command", "/Pepper/answer", "/Pepper/state",
            "/Pepper/world"),
        {"title": name},
    )  # fmt: skip
