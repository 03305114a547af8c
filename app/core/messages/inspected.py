"""Message that the Inspector shows, the view that fits it, and the value to compare it with."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Final, Literal

from app.core.messages.pace import UpdateLimiter
from app.core.messages.reader import LARGE_BYTES, MessageReader, ReadResult, read
from nep.messages.codecs import content_of

if TYPE_CHECKING:
    from app.core.network.topics import Topic
    from nep.messages.message import Message

Mode = Literal["tree", "table", "raw"]


class Sentinel:
    """Type of values that are distinct from every decoded value, null included."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


NO_BASE: Final = Sentinel("nothing to compare with")


class View(Enum):
    """View of the Inspector.

    Attributes:
        EMPTY: No topic is selected.
        WAITING: The topic has no message yet.
        UNREADABLE: No message of the topic can be received, for example because its type is unknown.
        LARGE: The message is so large that it is decoded only on request.
        READING: A large message is being decoded in the background.
        TREE: Values of the message as a tree.
        TABLE: List of objects in the message as a table.
        RAW: Bytes of the message, as selected by the user.
        UNDECODABLE: Bytes of a message that can't be decoded.
    """

    EMPTY = "empty"
    WAITING = "waiting"
    UNREADABLE = "unreadable"
    LARGE = "large"
    READING = "reading"
    TREE = "tree"
    TABLE = "table"
    RAW = "raw"
    UNDECODABLE = "undecodable"


class InspectedMessage:
    """State of an Inspector: which message of which topic it shows, in which view and why.

    `update` follows the newest message of the topic. It decodes small messages at once, at most ten per
    second, and large ones in a background thread. Not thread-safe.

    Attributes:
        key: Key of the topic; "" if no topic is selected.
        mode: View of decoded messages that the user selected.
        message: Message that is shown or offered for decoding; None before the first one.
        reading: Last message that was decoded. It may be older than `message`, which is not decoded in the
            views `LARGE`, `READING`, `RAW` and `UNDECODABLE`.
        pending: Large message that is being decoded, or None.
        problem: Reason why no message of the topic can be received, or "".
        has_publisher: True if the topic had a publisher at the last `update`.
        is_recorded: True if the message is from a recording.
        is_pinned: True if messages are compared with a pinned message instead of the previous one.
        pinned_stamp_ns: Time stamp of a pinned earlier message; None for other messages.
        reader: Background thread that decodes large messages.
    """

    def __init__(
        self, summarize_image: Callable[[Message], object], reader: MessageReader | None = None
    ) -> None:
        # `summarize_image` returns the value that is shown for an image, whose pixels aren't decoded.
        self._summarize_image = summarize_image
        self.reader = MessageReader() if reader is None else reader
        self._limiter = UpdateLimiter()
        self.mode: Mode = "tree"
        self.is_recorded = False
        self._last_state: tuple[object, ...] = ()  # at the last update
        self.open("")

    # -- topic ---------------------------------------------------------------------------------------

    def open(self, key: str) -> None:
        """Switch to another topic. A pinned message and the mode "raw" don't outlast the switch.

        Args:
            key: Key of the topic; "" for none.
        """
        self.key, self.problem, self.has_publisher = key, "", True
        if self.mode == "raw":
            self.mode = "tree"
        self._limiter.reset()
        self._clear()
        self.pin(is_pinned=False)

    def close(self) -> None:
        """Stop the background thread."""
        self.reader.close()

    def _clear(self) -> None:
        self.reader.clear()
        self.message: Message | None = None
        self.pending: Message | None = None
        self.reading: ReadResult | None = None
        self._result: ReadResult | None = None  # of `message`; None if it isn't decoded
        self._request: tuple[Message, Message | None] | None = None  # message to show, and the one before it
        self._preceding: Message | None = None  # message before `message` on the same topic
        self._last_value: object = NO_BASE  # value that was decoded before `reading`

    # -- messages ------------------------------------------------------------------------------------

    def update(
        self,
        topic: Topic | None,
        now_s: float,
        *,
        is_paused: bool = False,
        is_recorded: bool = False,
        problem: str = "",
    ) -> bool:
        """Take the newest message of the topic, or the one that the user requested.

        Call it on every refresh, and after `select`, `set_mode` and `decode_large`.

        Args:
            topic: Topic with the key `key`; None if it doesn't exist.
            now_s: Monotonic time in s.
            is_paused: True to keep the message, although there may be newer ones.
            is_recorded: True if the messages are from a recording. The message is then removed if the topic
                has none, because the playhead is before its first one.
            problem: Reason why no message of the topic can be received, or "".

        Returns:
            True if the display must be updated: something has changed since the last call.
        """
        self.is_recorded, self.problem = is_recorded, problem
        self.has_publisher = topic is not None and topic.publishers > 0
        newest = topic.newest if topic is not None and topic.gone_s is None else None
        if is_recorded and newest is None and not is_paused:
            self._clear()
        message, preceding = self._request or (None, None)
        is_requested, self._request = message is not None, None
        is_new = newest is not None and newest is not self.message and newest is not self.pending
        can_take = is_new and not is_paused and not is_requested
        if topic is not None and can_take and self._limiter.try_acquire(now_s):
            message, preceding = newest, topic.previous
        result = self.reader.pop_result()
        if result is not None and result.message is not self.pending:
            result = None  # another message was taken meanwhile
        if message is not None and self.mode != "raw" and not _is_large(message):
            result = read(message, self._summarize_image)
        elif message is not None and self._defer(message, preceding, now_s, is_requested=is_requested):
            result = None
        if result is not None:
            self.message, self._result = result.message, result
            self._preceding = preceding if result.message is message and _is_small(preceding) else None
            self.pending = self.pending if self.pending is message else None
            if result.error is None and (self.reading is None or self.reading.message is not result.message):
                self._last_value = NO_BASE if self.reading is None else self.reading.value
                self.reading = result
        last_state, self._last_state = self._last_state, self._state()
        return self._last_state != last_state

    def _defer(
        self, message: Message, preceding: Message | None, now_s: float, *, is_requested: bool
    ) -> bool:
        # True if the message is shown, or offered, without being decoded.
        if self.mode == "raw" or message.codec != "json":
            self.message, self._preceding, self._result, self.pending = message, preceding, None, None
            return True
        if is_requested:  # the user waits for exactly this message
            self.reader.submit(message)
            self.pending = message
        elif self.reader.submit_throttled(message, now_s):
            self.pending = message
        return False

    def allow_update(self) -> None:
        """Let the next `update` take the newest message regardless of the update rate."""
        self._limiter.reset()

    def select(self, message: Message | None, preceding: Message | None) -> None:
        """Request an earlier message. Pause the updates to keep it.

        Args:
            message: Earlier message; None to return to the newest one.
            preceding: Message before it on the same topic; None if unknown.
        """
        self.reader.clear()
        self.pending = None
        if message is not None:
            self._request = message, preceding
        elif self._result is None:
            self.message = None  # its decoding may have been discarded: take it again

    def set_mode(self, mode: Mode) -> None:
        """Show this message and later ones as a tree, as a table, or as bytes."""
        self.mode = mode
        self._last_state = ()  # the display must be updated even if the view stays
        if mode == "raw" and self.pending is not None:
            self._request = self.pending, None
        elif mode != "raw" and self.message is not None and self._result is None and self.pending is None:
            self._request = self.message, self._preceding

    def decode_large(self) -> None:
        """Decode the offered message in the background. Pause the updates to keep it."""
        if self.message is not None:
            self.pending = self.message
            self.reader.submit(self.message)

    # -- view ----------------------------------------------------------------------------------------

    @property
    def view(self) -> View:
        """View to show."""
        if self.message is None and self.pending is None:
            return View.EMPTY if not self.key else View.UNREADABLE if self.problem else View.WAITING
        if self.message is not None and self.mode == "raw":
            return View.RAW
        if self._result is None:
            return View.LARGE if self.pending is None else View.READING
        if self._result.error is not None:
            return View.UNDECODABLE
        return View.TABLE if self.mode == "table" else View.TREE

    @property
    def reason(self) -> str:
        """Reason for the views `UNREADABLE` and `UNDECODABLE`, else ""."""
        if self.view is View.UNDECODABLE and self._result is not None:
            return self._result.error or ""
        return self.problem if self.view is View.UNREADABLE else ""

    @property
    def large_bytes(self) -> int:
        """Size of the message in the views `LARGE` and `READING`."""
        message = self.message if self.pending is None else self.pending
        return message.size_bytes if message is not None else 0

    def _state(self) -> tuple[object, ...]:
        has_publisher = self.message is None and self.has_publisher
        return self.view, self.message, self._result, self.reason, has_publisher

    # -- comparison ----------------------------------------------------------------------------------

    def pin(self, *, is_pinned: bool, is_earlier: bool = False) -> None:
        """Compare messages with the message shown from now on, or with their previous message again.

        Args:
            is_pinned: True to pin the message shown.
            is_earlier: True if the user selected an earlier message.
        """
        self.is_pinned = is_pinned
        self._pinned_value = self.reading.value if is_pinned and self.reading is not None else NO_BASE
        stamp_ns = self.message.stamp_ns if self.message is not None else None
        self.pinned_stamp_ns = stamp_ns if is_pinned and is_earlier else None

    @property
    def value(self) -> object:
        """Last decoded value; None before the first one."""
        return self.reading.value if self.reading is not None else None

    @property
    def base(self) -> object:
        """Value to compare `value` with, or `NO_BASE`: the pinned one, else that of the previous message.

        If the previous message is large or can't be decoded, it is the value that was decoded before.
        """
        if self.is_pinned:
            return self._pinned_value
        is_small = self.reading is not None and self.reading.message.size_bytes <= LARGE_BYTES
        if self._preceding is not None and is_small:
            decoded = read(self._preceding)
            return self._last_value if decoded.error is not None else decoded.value
        return self._last_value


def _is_large(message: Message) -> bool:
    return message.size_bytes > LARGE_BYTES and content_of(message.codec) != "image"


def _is_small(message: Message | None) -> bool:
    # True if the message is quickly decoded.
    return message is not None and message.size_bytes <= LARGE_BYTES and content_of(message.codec) != "image"
