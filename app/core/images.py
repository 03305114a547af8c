"""Picture streams: one thread decodes the newest picture of each topic that somebody looks at.

Older pictures that wait are never decoded: at overload a picture is shown late by one decoding, not by a
queue.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from nep.errors import NepError
from nep.message import Message

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

RATE_WINDOW_S = 2.0
RATE_DELAY_S = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One decoded picture.

    ``bgra`` is a contiguous uint8 array (height, width, 4), as QImage.Format_RGB32 reads it.
    """

    bgra: NDArray[np.uint8]
    width: int
    height: int
    seq: int | None
    stamp_ns: int | None
    received_s: float


class Rate:
    """Pictures a second by the time of their arrival, over two seconds; None until two were seen.

    The window ends a little before now: pictures that arrived and may still be painted are not judged yet, so
    that "shown 30 of 30/s" compares the same pictures.
    """

    def __init__(self) -> None:
        """Have seen nothing."""
        self._times: deque[float] = deque(maxlen=4096)

    def add(self, arrived_s: float) -> None:
        """A picture that arrived at this time (monotonic seconds)."""
        self._times.append(arrived_s)

    def per_second(self, now: float) -> float | None:
        """How many a second; None when fewer than two are in the window."""
        end = now - RATE_DELAY_S
        while self._times and self._times[0] <= end - RATE_WINDOW_S:
            self._times.popleft()
        counted = sum(1 for time_s in self._times if time_s <= end)
        if counted < 2:
            return None
        return counted / min(RATE_WINDOW_S, max(end - self._times[0], 1e-3))


@dataclass(eq=False)
class ImageStream:
    """The pictures of one topic, for one panel. Figures that are not known are None."""

    topic: str
    _images: Images
    _watch_closed: Callable[[], None]
    picture: Picture | None = None
    error: str | None = None
    _waiting: tuple[Message, float] | None = None
    _arriving: Rate = field(default_factory=Rate)
    _shown: Rate = field(default_factory=Rate)

    @property
    def arriving_hz(self) -> float | None:
        """Pictures a second that arrive here."""
        with self._images.lock:
            return self._arriving.per_second(self._images.clock())

    @property
    def shown_hz(self) -> float | None:
        """Pictures a second that were painted."""
        return self._shown.per_second(self._images.clock())

    @property
    def silent_s(self) -> float | None:
        """Seconds since the last picture; None before the first."""
        picture = self.picture
        return self._images.clock() - picture.received_s if picture is not None else None

    def shown(self) -> None:
        """The panel painted `picture` (said once for each)."""
        if self.picture is not None:
            self._shown.add(self.picture.received_s)

    def close(self) -> None:
        """Nobody looks any more; said twice it does nothing."""
        self._images.forget(self)
        self._watch_closed()


class Images:
    """All open streams and the thread that decodes for them."""

    def __init__(
        self, watch: Callable[[str], Callable[[], None]], clock: Callable[[], float] = time.monotonic
    ) -> None:
        """``watch(topic)`` subscribes and returns what ends it; ``clock`` gives monotonic seconds."""
        self._watch = watch
        self.clock = clock
        self.lock = threading.Lock()
        self._arrived = threading.Condition(self.lock)
        self._streams: dict[str, list[ImageStream]] = {}
        self._closing = False
        self._thread: threading.Thread | None = None

    def stream(self, topic: str) -> ImageStream:
        """Look at a topic's pictures until the stream is closed."""
        stream = ImageStream(topic, self, self._watch(topic))
        with self.lock:
            self._streams.setdefault(topic, []).append(stream)
            if self._thread is None and not self._closing:
                self._thread = threading.Thread(target=self._decode_all, name="studio-images", daemon=True)
                self._thread.start()
        return stream

    def offer(self, messages: Sequence[Message]) -> None:
        """A sink: keep the newest message of each topic that somebody looks at. Called in nep's thread."""
        if not self._streams:
            return
        with self.lock:
            now = self.clock()
            for message in messages:
                for stream in self._streams.get(message.topic, ()):
                    stream._waiting = (message, now)  # noqa: SLF001  one module, one lock
                    stream._arriving.add(now)  # noqa: SLF001
            self._arrived.notify()

    def forget(self, stream: ImageStream) -> None:
        """A stream was closed."""
        with self.lock:
            left = [other for other in self._streams.get(stream.topic, []) if other is not stream]
            if left:
                self._streams[stream.topic] = left
            else:
                self._streams.pop(stream.topic, None)

    def close(self) -> None:
        """End the thread."""
        with self.lock:
            self._closing = True
            self._arrived.notify()
        if self._thread is not None:
            self._thread.join(timeout=2)

    def _decode_all(self) -> None:
        while True:
            with self.lock:
                while not self._closing and not self._any_waiting():
                    self._arrived.wait()
                if self._closing:
                    return
                work = self._take_waiting()
            for streams, message, arrived_s in work:
                picture, error = decode(message, arrived_s)
                for stream in streams:
                    stream.error = error
                    if picture is not None:
                        stream.picture = picture

    def _any_waiting(self) -> bool:
        every = (stream for streams in self._streams.values() for stream in streams)
        return any(stream._waiting is not None for stream in every)  # noqa: SLF001

    def _take_waiting(self) -> list[tuple[list[ImageStream], Message, float]]:
        work = []
        for streams in self._streams.values():
            waiting = [stream for stream in streams if stream._waiting is not None]  # noqa: SLF001
            if not waiting:
                continue
            newest = waiting[-1]._waiting  # noqa: SLF001
            for stream in waiting:
                stream._waiting = None  # noqa: SLF001
            if newest is not None:
                work.append((waiting, *newest))
        return work


def decode(message: Message, received_s: float) -> tuple[Picture | None, str | None]:
    """A message as a picture, or the sentence that says why it is none."""
    import cv2  # noqa: PLC0415  150 MB: loaded when the first picture arrives, not at start
    import numpy as np  # noqa: PLC0415

    try:
        frame = np.asarray(message.payload)
    except NepError as error:
        return None, str(error)
    if frame.dtype != np.uint8 or frame.ndim not in {2, 3} or 0 in frame.shape:
        return None, f"'{message.topic}' does not send pictures (shape {frame.shape}, {frame.dtype})"
    codes = {1: cv2.COLOR_GRAY2BGRA, 3: cv2.COLOR_BGR2BGRA}
    channels = 1 if frame.ndim == 2 else frame.shape[2]
    if channels == 4:
        bgra = np.ascontiguousarray(frame)
    elif channels in codes:
        bgra = cv2.cvtColor(frame, codes[channels])
    else:
        return None, f"'{message.topic}' has pictures of {channels} channels; 1, 3 or 4 can be shown"
    height, width = bgra.shape[:2]
    return Picture(bgra, width, height, message.seq, message.stamp_ns, received_s), None
