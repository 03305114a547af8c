"""Direct connections: the frames of the original NEP over SP's PUB and SUB, as libnanomsg speaks them."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from nep.backends.base import PublisherSpec, SubscriberSpec
from nep.backends.connection import Direct
from nep.backends.nanomsg.library import library, listen, new_socket, queue_of
from nep.backends.nanomsg.sub_socket import QuickSub
from nep.backends.zeromq.io_thread import Rest
from nep.backends.zeromq.legacy import from_frame, to_frame
from nep.backends.zeromq.sockets import Refusals, wait_until
from nep.backends.zeromq.sub_socket import Into
from nep.backends.zeromq.subscriber import ReadOneByOne
from nep.errors import ClosedError, NepError, WireError
from nep.i18n import _
from nep.messages.codecs import codec_for
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.system.addresses import in_numbers

__all__ = ["DirectPublisher", "DirectSubSocket", "attach", "check_direct", "dial"]

_logger = logging.getLogger("nep")
_LINGER_S = 0.2
"""pynng throws away what it has queued when it is closed, and tells nobody when that is sent: it gets so long
after the last message."""
_LARGEST = 2**20
"""libnanomsg takes no larger messages unless it is told to, and says nothing."""


def check_direct(direct: Direct) -> None:
    """Raises `NepError` for what SP has no form for."""
    if direct.mode == "many2many":
        raise NepError(
            _("the back end 'nanomsg' has no direct connections of mode 'many2many'; use 'one2many'")
        )
    if direct.wire != "original":
        raise NepError(
            _(
                "direct connections of 'nanomsg' carry frames of the original NEP; leave out wire='{wire}'"
            ).format(wire=direct.wire)
        )


def attach(socket: Any, direct: Direct, *, is_publisher: bool, what: str) -> str:  # noqa: ANN401 - pynng's
    """Listen or dial as the mode says; the endpoint. Raises `AddressInUseError`, `NepError`."""
    address = f"{direct.ip}:{direct.port}"
    if is_publisher == (direct.mode == "one2many"):
        listen(socket, address, what)
        return f"tcp://{address}"
    return dial(socket, address)


def dial(socket: Any, address: str) -> str:  # noqa: ANN401 - pynng's
    """Connect to `HOST:PORT`, as soon as somebody listens there; the endpoint. Raises `NepError`."""
    try:
        address = in_numbers(address)
        socket.dial(f"tcp://{address}", block=False)
    except library().NNGException as error:
        raise NepError(
            _("'{address}' cannot be connected to; use a computer's address and a port up to 65535").format(
                address=address
            )
        ) from error
    return f"tcp://{address}"


class DirectPublisher:
    """Owns a PUB. SP does not tell who subscribes to what: everybody who is connected counts."""

    def __init__(
        self, spec: PublisherSpec, direct: Direct, on_close: Callable[[DirectPublisher, float], None]
    ) -> None:
        check_direct(direct)
        self.spec = spec
        self.count = 0
        self.missing: tuple[str, ...] = ()
        self._on_close = on_close
        self._generation = direct.generation
        self._pipes: set[int] = set()
        self._is_closed = False
        self._has_warned = False
        self._sent_at = 0.0
        self._changed = threading.Condition(threading.RLock())
        self.fd = -1
        """There is nothing to be read."""
        self._socket: Any = new_socket("Pub0", send_buffer_size=queue_of(spec.codec.name))
        self._socket.add_post_pipe_connect_cb(self._came)
        self._socket.add_post_pipe_remove_cb(self._went)
        try:
            self.endpoint = attach(
                self._socket, direct, is_publisher=True, what=f"a publisher of '{spec.topic}'"
            )
        except BaseException:
            self.release()
            raise

    @property
    def subscribers(self) -> int:
        """How many connections there are."""
        return len(self._pipes)

    @property
    def is_heard(self) -> bool:
        """Whether there are any."""
        return bool(self._pipes)

    def _came(self, pipe: Any) -> None:  # noqa: ANN401 - pynng has no types
        with self._changed:
            self._pipes.add(pipe.id)
            self._changed.notify_all()

    def _went(self, pipe: Any) -> None:  # noqa: ANN401 - pynng has no types
        with self._changed:
            self._pipes.discard(pipe.id)
            self._changed.notify_all()

    def wait_for_any(self, timeout_s: float) -> None:
        """Wait until somebody is connected."""
        with self._changed:
            wait_until(self._changed, lambda: bool(self._pipes), timeout_s)

    def report(self, problem: str) -> None:
        """There is no graph that could show it."""

    def lend(self, _size_bytes: int) -> memoryview | None:
        """See `PublisherTransport.lend`: none here."""
        return None

    def skip(self) -> None:
        """Count a message that nobody wants."""
        with self._changed:
            self.count += 1

    def send(self, encoded: Encoded) -> None:
        """Publish one frame; nobody can know if a full queue dropped it. Warns of the first large one."""
        frame = to_frame(
            self.spec.topic, self._generation, self.spec.msg_type, self.spec.codec.name, encoded.data
        )
        with self._changed:
            if self._is_closed:
                raise ClosedError(f"publisher '{self.spec.topic}'")
            self.count += 1
            warns = len(frame) > _LARGEST and not self._has_warned
            self._has_warned = self._has_warned or warns
            self._sent_at = time.monotonic()
            self._socket.send(frame, block=False)
        if warns:
            _logger.warning(
                _(
                    "a message on '{topic}' has {size} bytes; programs that use libnanomsg take no more than "
                    "{most} and say nothing, so send less at once"
                ).format(topic=self.spec.topic, size=len(frame), most=_LARGEST)
            )

    def serve(self, now: float) -> Rest:  # noqa: ARG002 - there is nothing to do
        """Nothing comes here."""
        return Rest(is_quiet=True)

    def close(self, timeout_s: float) -> None:
        """Deliver what is on its way, as far as `finish` can, and close. Once; called by its publisher."""
        self._on_close(self, timeout_s)

    def say_bye(self) -> None:
        """Nothing is published any more."""
        with self._changed:
            self._is_closed = True

    def finish(self, deadline: float) -> None:
        """Let pynng send what it has queued, for `_LINGER_S` at most; SP has no way to ask whether it has."""
        until = min(deadline, self._sent_at + _LINGER_S)
        with self._changed:
            wait_until(self._changed, lambda: not self._pipes, until - time.monotonic())

    def release(self) -> None:
        """Close the socket, without the lock: pynng waits for its threads then."""
        self.say_bye()
        self._socket.close()


class DirectSubSocket(ReadOneByOne):
    """A SUB that takes the frames of both generations. Nobody numbers them: `lost` is not known."""

    def __init__(self, spec: SubscriberSpec, direct: Direct) -> None:
        check_direct(direct)
        self.refusals = Refusals()
        self.received = 0
        self.lost: int | None = None
        self.problem = ""
        self._spec = spec
        self._codec = codec_for(spec.msg_type).name
        self._sub = QuickSub(self._codec)
        self.fd = self._sub.fd
        self._sub.socket.subscribe(b"")  # of another generation no topic stands in front
        try:
            self.endpoint = attach(
                self._sub.socket, direct, is_publisher=False, what=f"a subscriber of '{spec.topic}'"
            )
        except BaseException:
            self.close()
            raise

    @property
    def has_input(self) -> bool:
        """Whether something can be read."""
        return self._sub.has_input

    def read(self, rest: Into, *, may_wait: bool = False) -> Message | None:  # noqa: ARG002 - each comes alone
        """The next message of this topic."""
        while (frame := self._sub.recv(may_wait=may_wait)) is not None:
            try:
                data = from_frame(self._spec.topic, self._spec.msg_type, self._codec, frame)
            except WireError as error:
                self.refusals.add(error.reason)
                continue
            if data is not None:
                self.received += 1
                return Message(self._spec.topic, data, self._codec, self._spec.msg_type)
        return None

    def dropped(self, count: int) -> None:
        """Dropped here for lack of room: the only losses that can be known."""
        self.received -= count
        self.lost = (self.lost or 0) + count

    def close(self) -> None:
        """Close the socket."""
        self._sub.close()
