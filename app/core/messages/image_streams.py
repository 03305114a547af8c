"""Image streams: one thread decodes the newest image of each visible topic.

Older pending images are never decoded, so that under overload an image is late by one decoding and not by a
queue. Images are decoded no larger than they are shown (`ImageStream.want`).
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

from app.core.messages.picture import Picture, Size, decode, once_more
from app.core.messages.picture_look import PLAIN, PictureLook
from app.core.network.watches import Watching
from nep.i18n import _
from nep.messages.message import Message

RATE_WINDOW_S = 2.0
RATE_DELAY_S = 0.25


class Rate:
    """Image rate by arrival time over the last two seconds.

    The window ends slightly before the current time, so that images that arrived but are not painted yet are
    not counted: the rates of arriving and shown images then refer to the same images.
    """

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=4096)

    def add(self, arrived_s: float) -> None:
        """Count an image that arrived at ``arrived_s`` (monotonic seconds)."""
        self._times.append(arrived_s)

    def per_second(self, now: float) -> float | None:
        """Return the rate in images per second; None with fewer than two images in the window."""
        end = now - RATE_DELAY_S
        while self._times and self._times[0] <= end - RATE_WINDOW_S:
            self._times.popleft()
        counted = sum(1 for time_s in self._times if time_s <= end)
        if counted < 2:
            return None
        return counted / min(RATE_WINDOW_S, max(end - self._times[0], 1e-3))


@dataclass(eq=False)
class ImageStream:
    """Images of one topic for one panel. Unknown values are None.

    Attributes:
        held: True if the image is frozen; arriving images are counted but not decoded.
        awaits_picture: True from opening or `rest` until the next image arrives.
    """

    topic: str
    _images: Images
    _watch: Watching
    picture: Picture | None = None
    error: str | None = None
    held: bool = False
    awaits_picture: bool = True
    wish: Size | None = None
    """Requested size. This and the next three attributes are used by `Images` under its lock."""
    look: PictureLook = PLAIN
    """Requested display style."""
    waiting: tuple[Message, float] | None = None
    """Newest message that is not decoded yet, and its arrival time."""
    arriving: Rate = field(default_factory=Rate)
    """Rate of arriving images."""
    _shown: Rate = field(default_factory=Rate)
    looked_s: float = 0.0
    """Time from which the silence of the topic is measured. Used by `Images`."""
    _resting: bool = False
    closed: bool = False

    @property
    def resting(self) -> bool:
        """True if the stream is suspended because it can't be seen."""
        return self._resting

    @property
    def arriving_hz(self) -> float | None:
        """Rate of arriving images per second."""
        with self._images.lock:
            return self.arriving.per_second(self._images.clock())

    @property
    def shown_hz(self) -> float | None:
        """Rate of painted images per second."""
        return self._shown.per_second(self._images.clock())

    @property
    def silent_s(self) -> float | None:
        """Seconds without an image while the stream was not suspended; None before the first image."""
        picture = self.picture
        if picture is None:
            return None
        return self._images.clock() - max(picture.received_s, self.looked_s)

    @property
    def age_s(self) -> float | None:
        """Seconds since the current image arrived; None before the first image."""
        return self._images.clock() - self.picture.received_s if self.picture is not None else None

    @property
    def stamped_s(self) -> float | None:
        """Seconds since the image's own time stamp; None without one."""
        stamp_ns = self.picture.stamp_ns if self.picture is not None else None
        return None if stamp_ns is None else (self._images.now_ns() - stamp_ns) / 1e9

    def want(self, size: Size | None) -> None:
        """Set the displayed size in screen pixels; None for full resolution.

        The current image is decoded again if it was decoded at a smaller size.
        """
        self._images.want(self, size)

    def show_as(self, look: PictureLook) -> None:
        """Set the display style; the current image is decoded again, even while it is frozen."""
        self._images.show_as(self, look)

    def hold(self, held: bool) -> None:
        """Freeze the current image, or resume showing the newest one."""
        self._images.hold(self, held)

    def count_painted(self) -> None:
        """Count that the panel painted `picture`; call it once for each image."""
        if self.picture is not None:
            self._shown.add(self.picture.received_s)

    def suspend(self) -> None:
        """Suspend the stream: nothing is received or decoded until `wake`; the last image remains."""
        if not self._resting:
            self._resting = self.awaits_picture = True
            self._images.forget(self)
            self._watch.suspend()

    def resume(self) -> None:
        """Resume after a `rest`."""
        if self._resting and not self.closed:
            self._resting = False
            self.looked_s = self._images.clock()
            self._watch.resume()
            self._images.add(self)

    def close(self) -> None:
        """Close the stream. Idempotent."""
        self._resting = self.closed = True
        self._images.forget(self)
        self._watch.close()


class Images:
    """All open streams, and the thread that decodes their images."""

    def __init__(self, watch: Callable[[str], Watching], clock: Callable[[], float] = time.monotonic) -> None:
        self._watch = watch
        self.clock = clock
        self.now_ns: Callable[[], int] = time.time_ns
        """Returns the current time in nanoseconds since 1970; during a replay, the time of the playhead."""
        self.lock = threading.Lock()
        self._arrived = threading.Condition(self.lock)
        self._streams: dict[str, list[ImageStream]] = {}
        self._closing = False
        self._times = 0
        self._thread: threading.Thread | None = None

    def stream(self, topic: str) -> ImageStream:
        """Open a stream of a topic's images."""
        stream = ImageStream(topic, self, self._watch(topic))
        self.add(stream)
        return stream

    def add(self, stream: ImageStream) -> None:
        """Register an opened or resumed stream."""
        with self.lock:
            self._streams.setdefault(stream.topic, []).append(stream)
            stream.arriving = Rate()
            self._arrived.notify()  # a held one may be requested larger
            if self._thread is None and not self._closing:
                self._thread = self._begin_decoding()

    def stand_still(self) -> None:
        """Restart the measurement of silence, because no images can arrive (the replay is paused)."""
        now = self.clock()
        with self.lock:
            for streams in self._streams.values():
                for stream in streams:
                    stream.looked_s = now

    def offer(self, messages: Sequence[Message], key: str = "") -> None:
        """Store the newest message of each visible topic. Called in nep's thread.

        ``key`` is the key of the topic among those of all networks, if it differs from the name.
        """
        if not self._streams:
            return
        with self.lock:
            now = self.clock()
            for message in messages:
                for stream in self._streams.get(key or message.topic, ()):
                    if not stream.held:
                        stream.waiting = (message, now)
                    stream.arriving.add(now)
            self._arrived.notify()

    def rewind(self, topics: Collection[str] = ()) -> None:
        """Discard all images except those of these topics, because the source jumped to another time."""
        with self.lock:
            self._times += 1
            for topic, streams in self._streams.items():
                for stream in streams:
                    if stream.held:
                        continue
                    stream.waiting = None
                    stream.arriving = Rate()
                    if topic not in topics:
                        stream.picture = stream.error = None
                        stream.awaits_picture = True

    def forget(self, stream: ImageStream) -> None:
        """Unregister a closed or suspended stream."""
        with self.lock:
            if not stream.held:
                stream.waiting = None
            left = [other for other in self._streams.get(stream.topic, []) if other is not stream]
            if left:
                self._streams[stream.topic] = left
            else:
                self._streams.pop(stream.topic, None)

    def want(self, stream: ImageStream, size: Size | None) -> None:
        """Set a stream's displayed size; see `ImageStream.want`."""
        with self.lock:
            if stream.wish == size:
                return
            stream.wish = size
            picture = stream.picture
            if picture is None or picture.whole or picture.message is None or stream.waiting is not None:
                return
            if _is_too_small(picture, size):
                stream.waiting = (picture.message, picture.received_s)
                self._arrived.notify()

    def show_as(self, stream: ImageStream, look: PictureLook) -> None:
        """Set a stream's style; see `ImageStream.show_as`."""
        with self.lock:
            if stream.look == look:
                return
            stream.look = look
            picture = stream.picture
            if picture is not None and picture.message is not None and stream.waiting is None:
                stream.waiting = (picture.message, picture.received_s)
                self._arrived.notify()

    def hold(self, stream: ImageStream, held: bool) -> None:
        """Hold or release a stream; see `ImageStream.hold`."""
        with self.lock:
            stream.held = held
            if held:
                stream.waiting = None

    def close(self) -> None:
        """Stop the thread."""
        with self.lock:
            self._closing = True
            self._arrived.notify()
        if self._thread is not None:
            self._thread.join(timeout=2)

    def _begin_decoding(self) -> threading.Thread | None:
        # Overridden in tests to return None: they call `decode_waiting`.
        thread = threading.Thread(target=self._decode_all, name="studio-images", daemon=True)
        thread.start()
        return thread

    def _decode_all(self) -> None:
        while True:
            with self.lock:
                while not self._closing and not self._any_waiting():
                    self._arrived.wait()
                if self._closing:
                    return
            self.decode_waiting()

    def decode_waiting(self) -> None:
        """Decode the newest pending image of each stream. Called by the decoding thread."""
        with self.lock:
            work, times = self._take_waiting(), self._times
        for streams, message, arrived_s, size, look in work:
            try:
                picture, error = once_more(streams[0].picture, message, arrived_s, size, look), None
                if picture is None:
                    picture, error = decode(message, arrived_s, size, look)
            except Exception as problem:  # noqa: BLE001  one message must not end the decoding thread
                picture, error = (
                    None,
                    _("“{topic}” sends an image that can't be shown: {problem}").format(
                        topic=message.topic, problem=problem
                    ),
                )
            with self.lock:
                for stream in streams if times == self._times else ():
                    _deliver(stream, message, picture, error)

    def _any_waiting(self) -> bool:
        every = (stream for streams in self._streams.values() for stream in streams)
        return any(stream.waiting is not None for stream in every)

    def _take_waiting(self) -> list[tuple[list[ImageStream], Message, float, Size | None, PictureLook]]:
        work = []
        for streams in self._streams.values():
            waiting = [stream for stream in streams if stream.waiting is not None]
            if not waiting:
                continue
            of_message: dict[tuple[int, PictureLook], list[ImageStream]] = {}
            for stream in waiting:  # a held stream decodes its own image again
                asked = (id(stream.waiting[0]), stream.look)  # type: ignore[index]
                of_message.setdefault(asked, []).append(stream)
            for together in of_message.values():
                message, arrived_s = together[0].waiting  # type: ignore[misc]
                work.append((together, message, arrived_s, _largest(together), together[0].look))
            for stream in waiting:
                stream.waiting = None
        return work


def _deliver(stream: ImageStream, message: Message, picture: Picture | None, error: str | None) -> None:
    before = stream.picture
    if stream.resting:
        return  # the stream isn't visible; the next image after `wake` is shown
    if stream.held and before is not None and before.message is not message:
        return  # decoded while the user held the previous image
    stream.error = error
    if picture is not None:
        if picture.look != stream.look and stream.waiting is None:  # changed while it was decoded
            stream.waiting = (message, picture.received_s)
        stream.picture = picture
        stream.awaits_picture = stream.awaits_picture and before is not None and before.message is message


def _largest(streams: Sequence[ImageStream]) -> Size | None:
    # None means full resolution.
    wishes = [stream.wish for stream in streams]
    known = [wish for wish in wishes if wish is not None]
    if len(known) < len(wishes):
        return None
    return max(wish[0] for wish in known), max(wish[1] for wish in known)


def _is_too_small(picture: Picture, size: Size | None) -> bool:
    rows, columns = picture.bgra.shape[:2]
    return size is None or columns < size[0] or rows < size[1]
