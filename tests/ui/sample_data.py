"""Sample data for tests of panels: robot, topics, nodes and console lines of the design images."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.blocks.model.program import Problem
from app.core.messages.picture import Picture
from app.core.network import topics as topics_module
from app.core.network.nodes import GATEWAY
from app.core.robots import robot_link as link_module
from app.intents import ConnectRobot
from app.robots.description.description import topic_of
from app.robots.description.inputs import Choice, Parameter
from app.robots.description.model import Action, DataField, Event, Robot, RobotTopics, SafeStop, Sensor
from nep.messages.message import Message
from nep.programs.doctor import Finding
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, SubscriberInfo, TopicInfo


def Topic(name: str, msg_type: str = "json", codec: str = "json", **more: object) -> topics_module.Topic:
    """Return a topic with defaults: one publisher, no lost messages."""
    given: dict[str, object] = {
        "publishers": 1,
        "publisher_nodes": ("pepper_driver",),
        "lost": 0,
        "loss_ratio": 0.0,
    }
    made = topics_module.Topic(name, msg_type, codec, **(given | more))  # type: ignore[arg-type]
    if made.gone_s is not None:
        made.gone_since_s = -made.gone_s
    return made


def Invocation(
    id: str, action: str, state: str = "running", feedback: Mapping[str, object] | None = None, *,
    elapsed_s: float = 0.0, left_s: float | None = None, **more: object,
) -> link_module.Invocation:  # fmt: skip
    """Return an invocation that started ``elapsed_s`` ago and times out in ``left_s`` (None: never)."""
    more |= {"feedback": feedback or {}, "clock": lambda: elapsed_s}
    made = link_module.Invocation(id, "Pepper", action, state, **more)  # type: ignore[arg-type]
    if left_s is not None:
        made.execution_start_s, made.timeout_s = 0.0, elapsed_s + left_s
    return made


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


VALUES: Mapping[str, object] = {
    "head_touched": False, "distance": 0.82, "battery": 84, "sees_face": True, "sound": 34.0,
    "heard_word": "hello",
    "pose": {"x": 1.284, "y": -0.307, "theta": 31.5},
    "faces": {"count": 1, "name": "Aiko", "width": 320, "height": 240,
              "items": [{"name": "face", "confidence": 0.97, "box": [118, 36, 71, 77]}]},
}  # fmt: skip
"""Values of Pepper's sensors."""

PROBLEMS = (
    Problem("warning", "b8", "robot", "wave", "NAO isn't connected, so wave will be skipped.",
            "Show the robots", ConnectRobot("NAO"), icon="hand"),
    Problem("info", "b3", "control", "wait until", "wait until waits forever if no one appears.",
            "Add a time limit", "add_time_limit", icon="hourglass"),
)  # fmt: skip


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
        "“python3 server.py” (process 77) uses port 7780 but isn't a master.",
        "Close that program, or start the master on port 7781 and set NEP_MASTER=127.0.0.1:7781 for all "
        "programs.", "nep master --port 7781",
    ),
    Finding(
        "port:7000",
        "warning",
        "The AirPlay Receiver uses port 7000, which programs of nep up to 0.5.4.5, nep-js and C# connect to.",
        "Turn off AirPlay Receiver in System Settings, under General > AirDrop & Handoff.",
    ),
    Finding("versions", "info", "NEP Studio 0.1.0, Python 3.11.7, pyzmq 27.3.0, libzmq 4.3.5, Linux 6.18."),
    Finding("loopback", "ok", "Programs on this computer can reach each other (127.0.0.1)."),
    Finding("files", "ok", "Open-file limit: 20000."),
)  # fmt: skip


ROWS: tuple[tuple[str, str, str, str, float, float, float, int, float], ...] = (
    ("/robot/camera", "image", "1", "4", 30.0, 1.2e6, 0.012, 0, 0.0),
    ("/robot/depth", "image", "1", "", 60.0, 5.1e6, 0.021, 7, 0.004),
    ("/blackboard", "json", "3", "4", 10.0, 18e3, 0.064, 0, 0.0),
    ("/odom", "json", "2", "", 50.0, 11e3, 0.008, 0, 0.0),
    ("/joint_states", "json", "2", "", 50.0, 46e3, 0.009, 0, 0.0),
    ("robot_action", "json", "7", "", 0.4, 92.0, 2.1, 0, 0.0),
    ("action_state", "json", "2", "", 0.8, 180.0, 1.7, 0, 0.0),
    ("/faces", "json", "1", "", 14.9, 4.1e3, 0.041, 0, 0.0),
    ("/touch", "json", "2", "4", 2.0, 160.0, 0.4, 0, 0.0),
    ("/distance", "json", "2", "", 20.0, 1.6e3, 0.031, 0, 0.0),
    ("/speech/words", "string", "52", "", 0.2, 14.0, 6.0, 0, 0.0),
    ("/cmd_vel", "json", "2", "", 20.0, 2.0e3, 0.038, 12, 0.021),
    ("/lidar/scan", "bytes", "6", "", 0.0, 0.0, 0.0, 0, 0.0),
)
"""Topics: name, type, publisher and subscriber node ids, messages/s, bytes/s, age, lost, loss ratio."""


def graph(revision: int, at_ns: int) -> GraphView:
    """Return the graph of design image 04: revision 1 has the lidar, later ones RIZE and words.

    The ages of its topics are correct at ``at_ns``.
    """
    nodes = [
        ("1", "camera_driver", "lab-pc", 4110, "Python", "native", 0.12),
        ("2", "pepper_driver", "lab-pc", 4132, "Python", "native", 0.31),
        ("3", "blackboard", "lab-pc", 4140, "Python", "native", 0.04),
        ("4", "studio", "lab-pc", 4090, "Python", "native", 0.081),
        ("5", "old_voice", "lab-pc", 4155, "Python", "B", 0.02),
        ("6", "lidar_driver", "lab-pc", 4160, "C++", "native", 0.2)
        if revision == 1
        else ("7", "RIZE", "lab-pc", 4166, "JavaScript", "A", 1.3),
        ("8", "gateway", "lab-pc", 4170, "Python", GATEWAY, 0.01),
    ]
    gone = "/speech/words" if revision == 1 else "/lidar/scan"
    topics = {name: _topic(name, *row, at_ns=at_ns) for name, *row in ROWS if name != gone}  # type: ignore[arg-type]
    infos = {row[0]: NodeInfo(*row[:6], 1_795_164_000_000_000_000, row[6]) for row in nodes}  # type: ignore[arg-type]
    return GraphView(1, revision, infos, topics)


def _topic(
    name: str, kind: str, publishers: str, subscribers: str, rate_hz: float, bandwidth: float, age_s: float,
    lost: int, loss_ratio: float, *, at_ns: int,
) -> TopicInfo:  # fmt: skip
    stamp_ns = at_ns - round(age_s * 1e9)
    return TopicInfo(
        name, kind, kind,
        tuple(PublisherInfo(1, id, (), False, 0, 0, 0, stamp_ns, rate_hz, bandwidth) for id in publishers),
        tuple(SubscriberInfo(9, id, 0, 0) for id in subscribers),
        rate_hz, bandwidth, stamp_ns, lost, loss_ratio,
    )  # fmt: skip


def blackboard(t: float = 0.0) -> dict[str, object]:
    """Return the blackboard message of design image 04 at time ``t`` in seconds."""
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
    """Return the state of the virtual robot in design image 02, with changes."""
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
    """Return a camera image of a wall, a floor and a red ball."""
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
        Parameter("text", "text", "text", default="Nice to meet you, Aiko.", is_required=True, min_length=1,
            max_length=300),
        Parameter("volume", "volume", "integer", 0, 100, 5, "%", 60),
        Parameter("language", "language", "choice", default="en",
                  choices=_choices(("en", "English"), ("fr", "French"), ("ja", "Japanese"))),
    ], category="Speech", cancellable=True),
    _action("turn", "turn", "rotate-ccw", [
        Parameter("angle", "angle", "angle", -180, 180, 5, "°", 30, is_required=True),
        Parameter("speed", "speed", "number", 10, 90, 1, "°/s", 40, is_advanced=False),
    ], cancellable=True),
    _action("light", "light", "lightbulb", [
        Parameter("where", "where", "choice", default="eyes",
                  choices=_choices(("eyes", "Eyes"), ("shoulders", "Shoulders"), ("both", "Both"))),
        Parameter("colour", "colour", "colour", default="#3ab7ff", is_required=True),
    ], category="Face and lights"),
    _action("walk", "walk", "footprints", [
        Parameter("distance", "distance", "number", -1, 1, 0.05, "m", 0.5, is_required=True),
    ], risk="moves", cancellable=True),
    _action("emotion", "show emotion", "smile", [
        Parameter("emotion", "emotion", "choice", default="happy", choices=_choices(
            ("neutral", "neutral"), ("happy", "happy"), ("sad", "sad"), ("surprised", "surprised"),
            ("angry", "angry"))),
        Parameter("seconds", "for", "number", 0, 60, 0.5, "s", 2, is_advanced=True),
        Parameter("gestures", "gestures", "boolean", default=True),
    ], category="Face and lights"),
    _action("listen", "listen for", "ear", [
        Parameter("words", "words", "list", default=["yes", "no"]),
        Parameter("picture", "picture", "image"),
        Parameter("count", "count", "integer", default=1),
    ], category="Speech"),
    _action("stop", "stop everything", "square", [], is_synchronous=True),
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
    """Return the virtual robot's description, with one parameter of every kind."""
    touched = Event(
        "touched",
        "touched",
        "hand",
        "Sensors",
        (),
        ("place",),
        "when %robot %place is touched",
        topic_of(name, "touched"),
    )
    sensors = tuple(replace(each, topic=topic_of(name, each.name)) for each in SENSORS)
    topics = RobotTopics(
        *(topic_of(name, each) for each in ("description", "command", "answer", "state", "world"))
    )
    return Robot(
        name, "virtual-pepper", "Virtual Pepper", True, "native", ACTIONS, sensors, (touched,),
        SafeStop("stop", 1.0, 0.2, True, True, True), ("base",), topics, {"title": name},
    )  # fmt: skip
