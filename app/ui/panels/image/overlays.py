"""Which topics draw on a picture, and what they draw now."""

from __future__ import annotations

from collections.abc import Iterable

from app.core.messages.annotations import Drawn, drawn_by
from app.core.messages.reader import LARGE_BYTES
from app.core.network.topics import Topic
from app.core.network.watches import Suspendable, Watch
from app.core.session import Session
from nep.errors import NepError
from nep.messages.message import Message

TYPES = ("foxglove.ImageAnnotations", "ImageAnnotations", "image_annotations")
NAME = "face_positions"
MOST_OVERLAYS = 8


def may_draw(topic: Topic) -> bool:
    """Whether a topic's type or name says that its messages draw on pictures."""
    if topic.codec not in {"json", "msgpack"}:
        return False
    return topic.msg_type.rpartition("/")[2] in TYPES or topic.name.rpartition("/")[2] == NAME


class Overlays:
    """The topics that a person chose to see on a picture; each is watched while the panel can be seen."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._watches: dict[str, Watch] = {}
        self._drawn: dict[str, tuple[Message | None, tuple[int, int], tuple[Drawn, ...]]] = {}

    @property
    def chosen(self) -> tuple[str, ...]:
        """The topics, by their names among those of all networks."""
        return tuple(self._watches)

    def choices(self) -> list[str]:
        """Those that may be chosen now, and those that are, also where they are gone."""
        every = (*self._session.topics, *self._session.networks.topics)
        there = [topic.key for topic in every if topic.gone_s is None and may_draw(topic)]
        return [*there, *(key for key in self._watches if key not in there)]

    def choose(self, topic: str, shown: bool) -> None:
        """Show what a topic draws, or not; `MOST_OVERLAYS` at most."""
        if shown and topic not in self._watches and len(self._watches) < MOST_OVERLAYS:
            self._watches[topic] = self._session.watch_shown(topic)
        elif not shown and topic in self._watches:
            self._watches.pop(topic).close()
            self._drawn.pop(topic, None)

    def begin_anew(self) -> None:
        """Another source is shown: watch the same topics there."""
        chosen = self.chosen
        self.close()
        for topic in chosen:
            self.choose(topic, shown=True)

    def on(self, width: int, height: int) -> tuple[Drawn, ...]:
        """What they draw on a picture of so many pixels now; nothing is decoded twice."""
        found: list[Drawn] = []
        for key in self._watches:
            topic = self._session.topic(key)
            message = topic.newest if topic is not None and topic.gone_s is None else None
            before = self._drawn.get(key)
            if before is None or before[0] is not message or before[1] != (width, height):
                before = self._drawn[key] = message, (width, height), _drawn(message, width, height)
            found += before[2]
        return tuple(found)

    def looks(self) -> Iterable[Suspendable]:
        """What only costs while the panel can be seen."""
        return tuple(self._watches.values())

    def close(self) -> None:
        """Watch nothing more."""
        for watch in self._watches.values():
            watch.close()
        self._watches.clear()
        self._drawn.clear()


def _drawn(message: Message | None, width: int, height: int) -> tuple[Drawn, ...]:
    if message is None or message.size_bytes > LARGE_BYTES:  # which is read in no window's thread
        return ()
    try:
        return drawn_by(message.payload, width, height)
    except (NepError, ValueError):
        return ()
