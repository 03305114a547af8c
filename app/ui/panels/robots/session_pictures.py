"""The picture topics of the session, for forms that want a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.core.messages.image_streams import ImageStream
    from app.core.session import Session

CODEC = "image"


class SessionPictures:
    """Its topics and its streams."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._opened: list[ImageStream] = []

    @property
    def streams(self) -> Sequence[ImageStream]:
        """Those that are open now."""
        self._opened = [stream for stream in self._opened if not stream.closed]
        return self._opened

    def topics(self) -> Sequence[str]:
        """The picture topics that there are now."""
        return sorted(t.name for t in self._session.topics if t.codec == CODEC and t.gone_s is None)

    def stream(self, topic: str) -> ImageStream:
        """Look at one until it is closed."""
        made = self._session.images.stream(topic)
        self._opened = [*self.streams, made]
        return made
