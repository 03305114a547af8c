"""Image streams that decode in the thread that delivers the messages."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from app.core.messages import image_streams as images_module
from app.core.messages.image_style import PictureStyle
from app.core.messages.picture import Picture
from app.core.network.watches import Watches
from nep.messages.message import Message


@dataclass(eq=False)
class ImageStream(images_module.ImageStream):
    """Real image stream that also records the painted images."""

    painted: list[Picture] = field(default_factory=list)

    def count_painted(self) -> None:
        super().count_painted()
        if self.picture is not None:
            self.painted.append(self.picture)

    def came(self, arriving_hz: float, shown_hz: float) -> None:
        """Set the measured rates as if images had arrived and been painted at these rates (Hz) until now."""
        begin = self._images.clock() - images_module.RATE_DELAY_S - images_module.RATE_WINDOW_S
        for rate, hz in ((self.arrival_rate, arriving_hz), (self._display_rate, shown_hz)):
            for number in range(round(hz * images_module.RATE_WINDOW_S)):
                rate.add(begin + (number + 1e-3) / hz)


class Images(images_module.Images):
    """Real image streams that decode in the calling thread; ``camera`` returns the image for a topic."""

    def __init__(
        self,
        watch: Callable[[str], images_module.WatchHandle] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(watch or (lambda topic: Watches(str, str).open([topic])), clock)
        self.streams: list[ImageStream] = []
        self.camera: Callable[[str], Picture | None] = lambda _topic: None

    def stream(self, topic: str) -> ImageStream:
        stream = ImageStream(topic, self, self._watch(topic))
        self.add(stream)
        self.streams.append(stream)
        if self.camera(topic) is not None:
            stream.came(15.0, 15.0)
        self.look(topic)
        return stream

    def look(self, topic: str) -> None:
        """Deliver the current image of a topic's camera, if there is one."""
        seen = self.camera(topic)
        if seen is not None and seen.message is not None:
            self.offer([on_topic(seen.message, topic)])

    def add(self, stream: images_module.ImageStream) -> None:
        super().add(stream)
        self.decode_pending()

    def offer(self, messages: Sequence[Message], key: str = "") -> None:
        super().offer(messages, key)
        self.decode_pending()

    def set_size(self, stream: images_module.ImageStream, size: tuple[int, int] | None) -> None:
        super().set_size(stream, size)
        self.decode_pending()

    def set_style(self, stream: images_module.ImageStream, look: PictureStyle) -> None:
        super().set_style(stream, look)
        self.decode_pending()

    def _start_decoding(self) -> None:
        return None


def on_topic(message: Message, topic: str) -> Message:
    """Return a copy of a message with another topic."""
    return Message(
        topic, message.data, message.codec, message.msg_type,
        stamp_ns=message.stamp_ns, seq=message.seq, extension=message.extension,
    )  # fmt: skip
