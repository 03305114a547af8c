"""Overlay topics: topics with annotations that are drawn over an image."""

from __future__ import annotations

from collections.abc import Iterable

from app.core.messages.annotations import AnnotationShape, parse_shapes
from app.core.messages.reader import LARGE_BYTES
from app.core.network.topics import Topic
from app.core.network.watches import Suspendable, Watch
from app.core.session import Session
from nep.errors import NepError
from nep.messages.codecs import content_of
from nep.messages.message import Message

ANNOTATION_TYPES = ("foxglove.ImageAnnotations", "ImageAnnotations", "image_annotations")
FACES_TOPIC_NAME = "face_positions"
MAX_OVERLAYS = 8


def may_contain_annotations(topic: Topic) -> bool:
    """Return True if the message type or the name of a topic indicates annotations for images."""
    if content_of(topic.codec) != "values":
        return False
    return (
        topic.msg_type.rpartition("/")[2] in ANNOTATION_TYPES
        or topic.name.rpartition("/")[2] == FACES_TOPIC_NAME
    )


class Overlays:
    """Overlay topics that the user selected, with a watch for each of them."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._watches: dict[str, Watch] = {}
        self._cached_annotations: dict[
            str, tuple[Message | None, tuple[int, int], tuple[AnnotationShape, ...]]
        ] = {}

    @property
    def selected_topics(self) -> tuple[str, ...]:
        """Keys of the selected topics."""
        return tuple(self._watches)

    def choices(self) -> list[str]:
        """Return the keys of the available overlay topics, and of selected ones that no longer exist."""
        all_topics = self._session.shown.all_topics
        available = [
            topic.key for topic in all_topics if topic.gone_s is None and may_contain_annotations(topic)
        ]
        return [*available, *(key for key in self._watches if key not in available)]

    def set_visible(self, topic: str, is_visible: bool) -> None:
        """Show or hide the annotations of a topic. At most `MAX_OVERLAYS` topics can be shown."""
        if is_visible and topic not in self._watches and len(self._watches) < MAX_OVERLAYS:
            self._watches[topic] = self._session.shown.watch(topic)
        elif not is_visible and topic in self._watches:
            self._watches.pop(topic).close()
            self._cached_annotations.pop(topic, None)

    def restart(self) -> None:
        """Watch the selected topics again after the session switched to another source."""
        selected_topics = self.selected_topics
        self.close()
        for topic in selected_topics:
            self.set_visible(topic, is_visible=True)

    def annotations_for(self, width: int, height: int) -> tuple[AnnotationShape, ...]:
        """Return the annotations to draw over an image. Each message is decoded only once.

        Messages that are larger than `LARGE_BYTES` or can't be decoded have no annotations.

        Args:
            width: Width of the image in px.
            height: Height of the image in px.
        """
        shapes: list[AnnotationShape] = []
        for key in self._watches:
            topic = self._session.shown.topic(key)
            message = topic.newest if topic is not None and topic.gone_s is None else None
            cached = self._cached_annotations.get(key)
            if cached is None or cached[0] is not message or cached[1] != (width, height):
                cached = self._cached_annotations[key] = (
                    message,
                    (width, height),
                    _decode_annotations(message, width, height),
                )
            shapes += cached[2]
        return tuple(shapes)

    def suspendables(self) -> Iterable[Suspendable]:
        """Return the watches to suspend while the panel is hidden."""
        return tuple(self._watches.values())

    def close(self) -> None:
        """Close all watches."""
        for watch in self._watches.values():
            watch.close()
        self._watches.clear()
        self._cached_annotations.clear()


def _decode_annotations(message: Message | None, width: int, height: int) -> tuple[AnnotationShape, ...]:
    # large messages are not decoded on the GUI thread
    if message is None or message.size_bytes > LARGE_BYTES:
        return ()
    try:
        return parse_shapes(message.payload, width, height)
    except (NepError, ValueError):
        return ()
