"""Looks for what a person should know: data that can't be read, robots that fell silent, names used twice."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping

from app.core.alerts import Alerts
from app.core.fleet import Fleet
from app.core.mailbox import Batch
from app.core.robot_link import RobotLink
from app.core.topics import Topics
from nep.errors import NepError
from nep.message import Message
from nep.views import GraphView

SILENT_S = 3.0
DECODED_A_TICK = 200
LARGE_BYTES = 1_000_000


class Health:
    """Puts alerts and cures them. One thread uses it (the window's)."""

    def __init__(self, topics: Topics, fleet: Fleet, alerts: Alerts, clock: Callable[[], float]) -> None:
        """Look at these; ``clock`` gives monotonic seconds."""
        self._topics, self._fleet, self._alerts, self._clock = topics, fleet, alerts, clock
        self._from_graph: set[str] = set()
        self._bad: dict[str, int] = {}

    def look(self, batches: Mapping[str, Batch]) -> None:
        """Count the messages that can't be decoded.

        Pictures and large messages are decoded by who shows them.
        """
        for topic, batch in batches.items():
            if not batch.messages or batch.messages[-1].codec not in {"json", "string", "msgpack"}:
                continue
            bad, sentence = _undecodable(batch.messages)
            last_good = not _is_bad(batch.messages[-1])
            if bad:
                # those that were dropped unread are not counted: nobody knows what they were
                self._bad[topic] = self._bad.get(topic, 0) + bad
                self._tell(topic, sentence, bad)
            if last_good and self._alerts.has(f"message:{topic}"):
                self._alerts.cure(f"message:{topic}")
                self._bad.pop(topic, None)

    def check(self, used: Container[str] = ()) -> None:
        """Once a second: which robots' pictures have stopped, and who of those in use (names) has gone."""
        for link in self._fleet.links:
            self._check_camera(link)
            if link.connected or link.name not in used:
                self._alerts.cure(f"robot:{link.name}")
                continue
            self._alerts.put(
                f"robot:{link.name}",
                "error",
                f"{link.name} does not answer.",
                "The behaviour uses it. Check that it is on and in the same Wi-Fi.",
                button="Stop",
                action="run.stop",
                count=0,
            )

    def journal(self, sentence: str | None) -> None:
        """Whether unsaved work is kept: the sentence that says why not, or None."""
        if sentence is None:
            self._alerts.cure("journal")
            return
        self._alerts.put(
            "journal",
            "error",
            "Your unsaved work is not kept.",
            f"{sentence[0].upper()}{sentence[1:]}.",
            button="Save",
            action="file.save",
            count=0,
        )

    def graph_alerts(self, view: GraphView) -> None:
        """Take over what the master noticed (a name used twice, types that differ, a port that is taken)."""
        ids = set()
        for found in view.alerts:
            ids.add(found.id)
            self._alerts.put(found.id, "warn", found.sentence, found.hint, count=0)
        for gone in self._from_graph - ids:
            self._alerts.cure(gone)
        self._from_graph = ids

    def _tell(self, topic: str, sentence: str, count: int) -> None:
        total = self._bad[topic]
        messages = "1 message" if total == 1 else f"{total} messages"
        self._alerts.put(
            f"message:{topic}",
            "warn",
            f"{topic} sends what can't be read ({messages}).",
            f"{sentence}. Look at the raw bytes in the Inspector.",
            button="Look at it",
            action=f"inspect:{topic}",
            count=count,
        )

    def _check_camera(self, link: RobotLink) -> None:
        id = f"camera:{link.name}"
        camera = next((sensor for sensor in link.robot.sensors if sensor.is_image), None)
        topic = self._topics.get(camera.topic) if camera is not None else None
        silent = (
            link.connected
            and topic is not None
            and topic.gone_since is None
            and topic.age_s is not None
            and topic.age_s > SILENT_S
        )
        if not silent or topic is None or topic.age_s is None:
            link.silent = None
            self._alerts.cure(id)
            return
        link.silent = "camera silent"
        self._alerts.put(
            id,
            "error",
            f"The camera of {link.name} has been silent for {int(topic.age_s)} s.",
            "What needs its picture waits.",
            count=0,
        )


def _undecodable(messages: list[Message]) -> tuple[int, str]:
    bad, sentence = 0, ""
    for message in messages[-DECODED_A_TICK:]:
        if message.size_bytes > LARGE_BYTES:
            continue
        try:
            _ = message.payload
        except NepError as error:
            bad, sentence = bad + 1, str(error)
    return bad, sentence


def _is_bad(message: Message) -> bool:
    if message.size_bytes > LARGE_BYTES:
        return False
    try:
        _ = message.payload
    except NepError:
        return True
    return False
