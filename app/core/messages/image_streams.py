"""Image streams: one thread decodes the newest image of each visible topic.

Older pending images are skipped, so that the delay under overload is one decoding at most. Images are
decoded no larger than they are displayed (`ImageStream.set_size`).
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

from app.core.messages.image_style import PLAIN, PictureStyle
from app.core.messages.picture import Picture, Size, decode, reuse_picture
from app.core.network.watches import WatchHandle
from nep.i18n import _
from nep.messages.message import Message

RATE_WINDOW_S = 2.0
RATE_DELAY_S = 0.25


class ImageRateMeter:
    """Image rate over the last two seconds, by arrival time.

    The interval ends slightly before the current time, so that images that arrived but are not painted
    yet are not counted: the rates of arriving and painted images then refer to the same images.
    """

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=4096)

    def add(self, arrived_s: float) -> None:
        """Count an image that arrived at ``arrived_s`` (monotonic seconds)."""
        self._times.append(arrived_s)

    def rate_hz(self, now: float) -> float | None:
        """Return the rate in images per second; None if fewer than two images arrived in the interval."""
        end = now - RATE_DELAY_S
        while self._times and self._times[0] <= end - RATE_WINDOW_S:
            self._times.popleft()
        count = sum(1 for time_s in self._times if time_s <= end)
        if count < 2:
            return None
        return count / min(RATE_WINDOW_S, max(end - self._times[0], 1e-3))


@dataclass(eq=False)
class ImageStream:
    """Images of one topic for one panel.

    Attributes:
        picture: Newest decoded image; None before the first image.
        error: Reason why the newest message can't be decoded, or None.
        is_frozen: True if the image is frozen; arriving images are counted but not decoded.
        is_awaiting_image: True from opening or `suspend` until the next image arrives.
    """

    topic: str
    _images: Images
    _watch: WatchHandle
    picture: Picture | None = None
    error: str | None = None
    is_frozen: bool = False
    is_awaiting_image: bool = True
    requested_size: Size | None = None
    """Requested size in screen pixels; None for full resolution.

    This and the next three attributes are used by `Images` under its lock.
    """
    style: PictureStyle = PLAIN
    """Requested display style."""
    pending: tuple[Message, float] | None = None
    """Newest message that is not decoded yet, and its arrival time (monotonic seconds)."""
    arrival_rate: ImageRateMeter = field(default_factory=ImageRateMeter)
    """Rate of arriving images."""
    _display_rate: ImageRateMeter = field(default_factory=ImageRateMeter)
    silence_start_s: float = 0.0
    """Time from which the silence of the topic is measured (monotonic seconds). Used by `Images`."""
    _is_suspended: bool = False
    is_closed: bool = False

    @property
    def is_suspended(self) -> bool:
        """True if the stream is suspended because its panel isn't visible."""
        return self._is_suspended

    @property
    def arriving_hz(self) -> float | None:
        """Number of images that arrive per second; None if unknown."""
        with self._images.lock:
            return self.arrival_rate.rate_hz(self._images.clock())

    @property
    def displayed_hz(self) -> float | None:
        """Number of images that are painted per second; None if unknown."""
        return self._display_rate.rate_hz(self._images.clock())

    @property
    def silent_s(self) -> float | None:
        """Seconds since the last image, not counting time while suspended; None before the first image."""
        picture = self.picture
        if picture is None:
            return None
        return self._images.clock() - max(picture.received_s, self.silence_start_s)

    @property
    def age_s(self) -> float | None:
        """Seconds since the current image arrived; None before the first image."""
        return self._images.clock() - self.picture.received_s if self.picture is not None else None

    @property
    def stamp_age_s(self) -> float | None:
        """Seconds since the time stamp of the current image; None if the image has no time stamp."""
        stamp_ns = self.picture.stamp_ns if self.picture is not None else None
        return None if stamp_ns is None else (self._images.now_ns() - stamp_ns) / 1e9

    def set_size(self, size: Size | None) -> None:
        """Set the displayed size in screen pixels; None for full resolution.

        If the current image was decoded at a smaller size, it is decoded again.
        """
        self._images.set_size(self, size)

    def set_style(self, style: PictureStyle) -> None:
        """Set the display style, and decode the current image again, even while it is frozen."""
        self._images.set_style(self, style)

    def set_frozen(self, is_frozen: bool) -> None:
        """Freeze the current image, or show the newest image again.

        Args:
            is_frozen: True to freeze the image.
        """
        self._images.set_frozen(self, is_frozen)

    def count_painted(self) -> None:
        """Count a painted image for `displayed_hz`. The panel calls this once for each image."""
        if self.picture is not None:
            self._display_rate.add(self.picture.received_s)

    def suspend(self) -> None:
        """Suspend the stream: no images are received or decoded until `resume`.

        The last image remains visible.
        """
        if not self._is_suspended:
            self._is_suspended = self.is_awaiting_image = True
            self._images.unregister(self)
            self._watch.suspend()

    def resume(self) -> None:
        """Resume the stream after `suspend`."""
        if self._is_suspended and not self.is_closed:
            self._is_suspended = False
            self.silence_start_s = self._images.clock()
            self._watch.resume()
            self._images.add(self)

    def close(self) -> None:
        """Close the stream. Idempotent."""
        self._is_suspended = self.is_closed = True
        self._images.unregister(self)
        self._watch.close()


class Images:
    """Open image streams, and the thread that decodes their images."""

    def __init__(
        self, watch: Callable[[str], WatchHandle], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._watch = watch
        self.clock = clock
        self.now_ns: Callable[[], int] = time.time_ns
        """Returns the current time in nanoseconds since 1970; during a replay, the time of the playhead."""
        self.lock = threading.Lock()
        self._arrived = threading.Condition(self.lock)
        self._streams: dict[str, list[ImageStream]] = {}
        self._is_closing = False
        self._reset_count = 0
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
            stream.arrival_rate = ImageRateMeter()
            self._arrived.notify()  # a frozen image may be needed at a larger size
            if self._thread is None and not self._is_closing:
                self._thread = self._start_decoding()

    def restart_silence(self) -> None:
        """Restart the measurement of silence.

        Called while a replay is paused, because no images can arrive then.
        """
        now = self.clock()
        with self.lock:
            for streams in self._streams.values():
                for stream in streams:
                    stream.silence_start_s = now

    def offer(self, messages: Sequence[Message], key: str = "") -> None:
        """Store the newest message of each visible topic for decoding. Called in nep's receiving thread.

        Args:
            messages: Received messages of one network.
            key: Key of the topic among all networks; default: the name of the topic.
        """
        if not self._streams:
            return
        with self.lock:
            now = self.clock()
            for message in messages:
                for stream in self._streams.get(key or message.topic, ()):
                    if not stream.is_frozen:
                        stream.pending = (message, now)
                    stream.arrival_rate.add(now)
            self._arrived.notify()

    def reset(self, topics: Collection[str] = ()) -> None:
        """Discard the images of all streams, except frozen images and those of the given topics.

        Called when the source seeks to another time.

        Args:
            topics: Keys of the topics whose images remain visible until their next image arrives.
        """
        with self.lock:
            self._reset_count += 1
            for topic, streams in self._streams.items():
                for stream in streams:
                    if stream.is_frozen:
                        continue
                    stream.pending = None
                    stream.arrival_rate = ImageRateMeter()
                    if topic not in topics:
                        stream.picture = stream.error = None
                        stream.is_awaiting_image = True

    def unregister(self, stream: ImageStream) -> None:
        """Unregister a closed or suspended stream."""
        with self.lock:
            if not stream.is_frozen:
                stream.pending = None
            remaining = [other for other in self._streams.get(stream.topic, []) if other is not stream]
            if remaining:
                self._streams[stream.topic] = remaining
            else:
                self._streams.pop(stream.topic, None)

    def set_size(self, stream: ImageStream, size: Size | None) -> None:
        """Set a stream's displayed size; see `ImageStream.set_size`."""
        with self.lock:
            if stream.requested_size == size:
                return
            stream.requested_size = size
            picture = stream.picture
            if (
                picture is None
                or picture.is_full_resolution
                or picture.message is None
                or stream.pending is not None
            ):
                return
            if _is_too_small(picture, size):
                stream.pending = (picture.message, picture.received_s)
                self._arrived.notify()

    def set_style(self, stream: ImageStream, style: PictureStyle) -> None:
        """Set a stream's style; see `ImageStream.set_style`."""
        with self.lock:
            if stream.style == style:
                return
            stream.style = style
            picture = stream.picture
            if picture is not None and picture.message is not None and stream.pending is None:
                stream.pending = (picture.message, picture.received_s)
                self._arrived.notify()

    def set_frozen(self, stream: ImageStream, is_frozen: bool) -> None:
        """Freeze a stream or show its newest image again; see `ImageStream.set_frozen`."""
        with self.lock:
            stream.is_frozen = is_frozen
            if is_frozen:
                stream.pending = None

    def close(self) -> None:
        """Stop the thread."""
        with self.lock:
            self._is_closing = True
            self._arrived.notify()
        if self._thread is not None:
            self._thread.join(timeout=2)

    def _start_decoding(self) -> threading.Thread | None:
        # Overridden in tests to return None: they call `decode_pending`.
        thread = threading.Thread(target=self._decode_all, name="studio-images", daemon=True)
        thread.start()
        return thread

    def _decode_all(self) -> None:
        while True:
            with self.lock:
                while not self._is_closing and not self._has_pending():
                    self._arrived.wait()
                if self._is_closing:
                    return
            self.decode_pending()

    def decode_pending(self) -> None:
        """Decode the newest pending image of each stream. Called in the decoding thread."""
        with self.lock:
            pending_work, reset_count = self._take_pending(), self._reset_count
        for streams, message, arrived_s, size, style in pending_work:
            try:
                picture, error = reuse_picture(streams[0].picture, message, arrived_s, size, style), None
                if picture is None:
                    picture, error = decode(message, arrived_s, size, style)
            except Exception as problem:  # noqa: BLE001  one message must not end the decoding thread
                picture, error = (
                    None,
                    _("An image on “{topic}” can't be shown: {problem}").format(
                        topic=message.topic, problem=problem
                    ),
                )
            with self.lock:
                for stream in streams if reset_count == self._reset_count else ():
                    _deliver(stream, message, picture, error)

    def _has_pending(self) -> bool:
        all_streams = (stream for streams in self._streams.values() for stream in streams)
        return any(stream.pending is not None for stream in all_streams)

    def _take_pending(self) -> list[tuple[list[ImageStream], Message, float, Size | None, PictureStyle]]:
        pending_work = []
        for streams in self._streams.values():
            pending_streams = [stream for stream in streams if stream.pending is not None]
            if not pending_streams:
                continue
            streams_by_image: dict[tuple[int, PictureStyle], list[ImageStream]] = {}
            for stream in pending_streams:  # a frozen stream decodes its own image again
                image_key = (id(stream.pending[0]), stream.style)  # type: ignore[index]
                streams_by_image.setdefault(image_key, []).append(stream)
            for same_image_streams in streams_by_image.values():
                message, arrived_s = same_image_streams[0].pending  # type: ignore[misc]
                pending_work.append(
                    (
                        same_image_streams,
                        message,
                        arrived_s,
                        _largest(same_image_streams),
                        same_image_streams[0].style,
                    )
                )
            for stream in pending_streams:
                stream.pending = None
        return pending_work


def _deliver(stream: ImageStream, message: Message, picture: Picture | None, error: str | None) -> None:
    previous = stream.picture
    if stream.is_suspended:
        return  # the stream isn't visible; the next image after `resume` is shown
    if stream.is_frozen and previous is not None and previous.message is not message:
        return  # decoded while the user froze the previous image
    stream.error = error
    if picture is not None:
        if picture.style != stream.style and stream.pending is None:  # changed while it was decoded
            stream.pending = (message, picture.received_s)
        stream.picture = picture
        stream.is_awaiting_image = (
            stream.is_awaiting_image and previous is not None and previous.message is message
        )


def _largest(streams: Sequence[ImageStream]) -> Size | None:
    # None means full resolution.
    requested_sizes = [stream.requested_size for stream in streams]
    sizes = [size for size in requested_sizes if size is not None]
    if len(sizes) < len(requested_sizes):
        return None
    return max(size[0] for size in sizes), max(size[1] for size in sizes)


def _is_too_small(picture: Picture, size: Size | None) -> bool:
    rows, columns = picture.bgra.shape[:2]
    return size is None or columns < size[0] or rows < size[1]
