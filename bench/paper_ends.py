"""One end of a ping-pong, started by `paper.py` twice for each of its rows: as ping and as pong.

    python bench/paper_ends.py ping|pong ROW OWN_HOST PLACE

A row is one way to transport messages. Both ends encode, send, receive and decode each message: pong
returns what it has decoded. Where a library passes messages to callbacks, pong replies in the
callback itself and ping takes the time in it; where a program waits for messages, both wait in their
main threads.

They exchange lines of JSON. {"end": ...} is the endpoint to which the other end connects; the
endpoint of the other end is then read. {"ready": true} reports that messages arrive. Each further
line read is [KIND, SIZE, COUNT] and gets the reply {"taken": [seconds, ...]}. {"not run": REASON} is
the last line of an end that can't continue.
"""

from __future__ import annotations

import base64
import json
import os
import queue
import random
import signal
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any
from urllib.parse import urlsplit

from paper_clients import ROSNODEJS
from paper_clients import ROWS as CLIENTS

KINDS = ("string", "json", "bytes")
NUMBERS = "numbers"
TYPES = {**{kind: kind for kind in KINDS}, NUMBERS: "json"}
"""Message type of each kind of nep's own ends."""
WAIT_S = 20.0
"""Seconds after which a message that was not returned counts as lost."""
LOOK_S = 0.01
LEAVE_S = 5.0


def payload(kind: str, size: int) -> object:
    """Return a new payload of about ``size`` encoded bytes; a map with one text for `json`."""
    if kind == "bytes":
        return os.urandom(size)
    if kind == NUMBERS:
        return {"values": [round(0.5 * number, 1) for number in range(size // 8)]}
    mark = "".join(random.choices("abcdefghijklmnop", k=min(size, 16)))
    text = mark + "x" * (size - len(mark))
    return {"data": text} if kind == "json" else text


def packed(kind: str, value: Any) -> Any:  # noqa: ANN401 - bytes or what is like them
    """Encode a value as plain programs do: strings as UTF-8, `json` with the json module, bytes unchanged."""
    if kind == "bytes":
        return value
    return (json.dumps(value) if kind == "json" else value).encode()


def unpacked(kind: str, data: Any) -> object:  # noqa: ANN401 - bytes or what is like them
    """Decode the data that `packed` returned."""
    if kind == "bytes":
        return data
    text = bytes(data).decode() if isinstance(data, memoryview) else data.decode()
    return json.loads(text) if kind == "json" else text


class End(ABC):
    """One end of the ping-pong; `end` is the endpoint that the other end connects to."""

    end = ""

    def __init__(self, role: str, host: str, place: str) -> None:
        self.is_ping = role == "ping"
        self.there, self.back = ("ping", "pong") if self.is_ping else ("pong", "ping")
        """What this end's own messages are called, and the other's."""
        self.role, self.host, self.place = role, host, place
        self.closes = ExitStack()

    @abstractmethod
    def connect(self, other: str) -> None:
        """Connect to the other end; return once messages arrive in both directions."""

    @abstractmethod
    def send(self, kind: str, value: object) -> None:
        """Encode and send a value."""

    @abstractmethod
    def trips(self, kind: str, payloads: Sequence[object]) -> list[float]:
        """Send each payload to pong and back; return the seconds of each round trip."""

    @abstractmethod
    def echo(self, kind: str, count: int) -> None:
        """Return `count` messages to ping."""


class Listening(End):
    """End whose program waits for messages itself."""

    @abstractmethod
    def receive(self, kind: str) -> object:
        """Wait for the next message and return its decoded value."""

    def trips(self, kind: str, payloads: Sequence[object]) -> list[float]:
        """Send each payload to pong and back; return the seconds of each round trip."""
        taken = []
        for value in payloads:
            started = time.perf_counter()
            self.send(kind, value)
            came = self.receive(kind)
            taken.append(time.perf_counter() - started)
            check(came, value)
        return taken

    def echo(self, kind: str, count: int) -> None:
        """Return `count` messages to ping."""
        for _ in range(count):
            self.send(kind, self.receive(kind))


class Called(End):
    """End whose library passes messages to a callback."""

    def __init__(self, role: str, host: str, place: str) -> None:
        super().__init__(role, host, place)
        self._came: queue.SimpleQueue[tuple[float, object]] = queue.SimpleQueue()
        self._echoed = threading.Semaphore(0)

    def came(self, kind: str, value: object) -> None:
        """Handle a decoded message; called by the library."""
        if self.is_ping:
            self._came.put((time.perf_counter(), value))
        else:
            self.send(kind, value)
            self._echoed.release()

    def trips(self, kind: str, payloads: Sequence[object]) -> list[float]:
        """Send each payload to pong and back; return the seconds of each round trip."""
        taken = []
        for value in payloads:
            started = time.perf_counter()
            self.send(kind, value)
            try:
                ended, came = self._came.get(timeout=WAIT_S)
            except queue.Empty:
                raise LostError("a message was not returned") from None
            taken.append(ended - started)
            check(came, value)
        return taken

    def echo(self, kind: str, count: int) -> None:  # noqa: ARG002 - the callback knows it
        """Wait until the callback has returned `count` messages to ping."""
        for _ in range(count):
            if not self._echoed.acquire(timeout=WAIT_S):
                raise LostError("a message was not received")


class LostError(Exception):
    """A message did not arrive in time, or a different one arrived."""


def check(came: object, sent: object) -> None:
    """Raise `LostError` if the received value differs from the sent one."""
    if came != sent:
        raise LostError("another message came back")


def wait_until(is_so: Callable[[], Any]) -> None:
    """Poll until the other end is connected; raise `LostError` after `WAIT_S`."""
    pause, deadline = threading.Event(), time.monotonic() + WAIT_S
    while not is_so():
        if time.monotonic() > deadline:
            raise LostError("the other end was not found")
        pause.wait(LOOK_S)


class PlainEnd(Listening):
    """End with pyzmq alone: for each kind a SUB and a PUB (an XPUB, which reports subscriptions)."""

    def __init__(self, role: str, host: str, place: str) -> None:
        super().__init__(role, host, place)
        import zmq  # noqa: PLC0415 - each row imports its own library

        context = zmq.Context()
        self.closes.callback(context.destroy, 0)
        self._out = {kind: context.socket(zmq.XPUB) for kind in KINDS}
        self._in = {kind: context.socket(zmq.SUB) for kind in KINDS}
        for kind in KINDS:
            self._out[kind].bind(f"tcp://{host}:*")
            self._in[kind].setsockopt(zmq.RCVTIMEO, int(WAIT_S * 1000))
            self._in[kind].subscribe(b"")
        self.end = " ".join(each.getsockopt_string(zmq.LAST_ENDPOINT) for each in self._out.values())

    def connect(self, other: str) -> None:
        """Connect to the other end; return once messages arrive in both directions."""
        for kind, end in zip(KINDS, other.split(), strict=True):
            self._in[kind].connect(end)
        for each in self._out.values():
            if not each.poll(int(WAIT_S * 1000)):
                raise LostError("the other end was not found")
            each.recv()

    def send(self, kind: str, value: object) -> None:
        """Encode and send a value."""
        self._out[kind].send(packed(kind, value), copy=kind != "bytes")

    def receive(self, kind: str) -> object:
        """Wait for the next message and return its decoded value."""
        if kind == "bytes":
            return self._in[kind].recv(copy=False).buffer
        return unpacked(kind, self._in[kind].recv())


class NepEnd(Listening):
    """End with nep over one of its back ends; a master, if needed, runs in ping's process."""

    transport = "zeromq"

    def __init__(self, role: str, host: str, place: str) -> None:
        super().__init__(role, host, place)
        import nep  # noqa: PLC0415 - each row imports its own library

        self._nep = nep
        if self.is_ping:
            master = self.closes.enter_context(nep.Master("127.0.0.1:0", learn_s=0.0))
            if host != "127.0.0.1":
                master.listen([host])
            self._own = master.address
            self.end = f"{host}:{master.address.rpartition(':')[2]}"

    def connect(self, other: str) -> None:
        """Connect to the other end; return once messages arrive in both directions."""
        self._meet(self._own if self.is_ping else other)

    def _meet(self, master: str) -> None:
        node = self.closes.enter_context(
            self._nep.node(self.role, self.transport, master=master, wait_s=WAIT_S)
        )
        self._in = {kind: node.new_sub(f"{self.back}_{kind}", each) for kind, each in TYPES.items()}
        self._out = {kind: node.new_pub(f"{self.there}_{kind}", each) for kind, each in TYPES.items()}
        wait_until(lambda: all(each.subscribers for each in self._out.values()))

    def send(self, kind: str, value: object) -> None:
        """Encode and send a value."""
        self._out[kind].publish(value)

    def receive(self, kind: str) -> object:
        """Wait for the next message and return its decoded value."""
        ok, value = self._in[kind].listen(timeout_s=WAIT_S)
        if not ok:
            raise LostError("a message was not received")
        return value


class NepNanomsgEnd(NepEnd):
    """End with nep over the nanomsg protocols, implemented by pynng."""

    transport = "nanomsg"


class NepZenohEnd(NepEnd):
    """End with nep over zenoh; both nodes use the zenoh endpoint `place`."""

    def __init__(self, role: str, host: str, place: str) -> None:
        Listening.__init__(self, role, host, place)
        import nep  # noqa: PLC0415 - each row imports its own library

        self._nep = nep
        self.transport = "zenoh"

    def connect(self, other: str) -> None:  # noqa: ARG002 - both were told the place
        """Connect to the other end; return once messages arrive in both directions."""
        self._meet(self.place)


class ZenohEnd(Called):
    """End with zenoh's Python library: ping listens at `place`, pong connects there."""

    def __init__(self, role: str, host: str, place: str) -> None:
        super().__init__(role, host, place)
        import zenoh  # noqa: PLC0415 - each row imports its own library

        settings = zenoh.Config()
        settings.insert_json5("scouting/multicast/enabled", "false")
        settings.insert_json5("listen/endpoints", json.dumps([place] if self.is_ping else []))
        settings.insert_json5("connect/endpoints", json.dumps([] if self.is_ping else [place]))
        self._block = zenoh.CongestionControl.BLOCK
        self._settings, self._open = settings, zenoh.open
        if self.is_ping:
            self._begin()

    def _begin(self) -> None:
        session = self.closes.enter_context(self._open(self._settings))
        self._out = {
            kind: session.declare_publisher(f"{self.there}/{kind}", congestion_control=self._block)
            for kind in KINDS
        }
        self._in = [session.declare_subscriber(f"{self.back}/{kind}", self._callback(kind)) for kind in KINDS]

    def _callback(self, kind: str) -> Callable[[Any], None]:
        return lambda sample: self.came(kind, unpacked(kind, sample.payload.to_bytes()))

    def connect(self, other: str) -> None:  # noqa: ARG002 - both were told the place
        """Connect to the other end; return once messages arrive in both directions."""
        if not self.is_ping:
            self._begin()
        wait_until(lambda: all(each.matching_status.matching for each in self._out.values()))

    def send(self, kind: str, value: object) -> None:
        """Encode and send a value."""
        self._out[kind].put(packed(kind, value))


class RospyEnd(Called):
    """End with rospy: std_msgs/String, and UInt8MultiArray for bytes; `place` is the ROS master."""

    topics = "direct"

    def __init__(self, role: str, host: str, place: str) -> None:
        super().__init__(role, host, place)
        os.environ.update(ROS_MASTER_URI=place, ROS_IP=host)
        from nep.backends.ros.library import get_rospy  # noqa: PLC0415 - each row imports its own get_rospy

        rospy = get_rospy()
        from std_msgs.msg import String, UInt8MultiArray  # type: ignore[import-not-found] # noqa: PLC0415

        rospy.init_node(role, anonymous=True, disable_signals=True, disable_rosout=True)
        self.closes.callback(rospy.signal_shutdown, "done")
        self._types = {kind: UInt8MultiArray if kind == "bytes" else String for kind in KINDS}
        self._out, self._in = {}, {}
        for kind, message in self._types.items():
            self._out[kind] = rospy.Publisher(
                f"{self.topics}_{self.there}_{kind}", message, queue_size=10, tcp_nodelay=True
            )
            self._in[kind] = rospy.Subscriber(
                f"{self.topics}_{self.back}_{kind}",
                message,
                self._called,
                callback_args=kind,
                tcp_nodelay=True,
            )

    def _called(self, message: Any, kind: str) -> None:  # noqa: ANN401 - it has no types
        self.came(kind, json.loads(message.data) if kind == "json" else message.data)

    def connect(self, other: str) -> None:  # noqa: ARG002 - the ROS master knows it
        """Connect to the other end; return once messages arrive in both directions."""
        both = (*self._out.values(), *self._in.values())
        wait_until(lambda: all(each.get_num_connections() for each in both))

    def send(self, kind: str, value: object) -> None:
        """Encode and send a value."""
        message = self._types[kind]()
        message.data = json.dumps(value) if kind == "json" else value
        self._out[kind].publish(message)


class BridgedRospyEnd(RospyEnd):
    """End with rospy whose peer is behind a rosbridge server.

    The topics have names of their own, because this row and that of rospy may share a ROS master.
    """

    topics = "bridged"


class RosnodejsPeerEnd(RospyEnd):
    """End with rospy whose peer is a program with rosnodejs."""

    topics = "rosnodejs"


class RoslibpyEnd(Called):
    """End with roslibpy, connected to the rosbridge server at `place`; bytes are sent as base64."""

    def __init__(self, role: str, host: str, place: str) -> None:
        super().__init__(role, host, place)
        import roslibpy  # type: ignore[import-not-found] # noqa: PLC0415 - each row imports its own

        at = urlsplit(place)
        self._message = roslibpy.Message
        ros = roslibpy.Ros(host=at.hostname, port=at.port or 9090)
        ros.run(timeout=WAIT_S)
        self.closes.callback(ros.terminate)
        self._out, self._in = {}, {}
        for kind in KINDS:
            name = "std_msgs/UInt8MultiArray" if kind == "bytes" else "std_msgs/String"
            self._out[kind] = roslibpy.Topic(ros, f"/{BridgedRospyEnd.topics}_{self.there}_{kind}", name)
            self._out[kind].advertise()
            self._in[kind] = roslibpy.Topic(ros, f"/{BridgedRospyEnd.topics}_{self.back}_{kind}", name)
            self._in[kind].subscribe(self._callback(kind))

    def _callback(self, kind: str) -> Callable[[Any], None]:
        read: dict[str, Callable[[Any], object]] = {"json": json.loads, "bytes": base64.b64decode}
        return lambda message: self.came(kind, read.get(kind, str)(message["data"]))

    def connect(self, other: str) -> None:
        """Do nothing: ping uses rospy, which waits for both connections."""

    def send(self, kind: str, value: Any) -> None:  # noqa: ANN401 - one of three types
        """Encode and send a value."""
        data = json.dumps(value) if kind == "json" else value
        if kind == "bytes":
            layout = {"dim": [], "data_offset": 0}
            self._out[kind].publish(
                self._message({"layout": layout, "data": base64.b64encode(data).decode()})
            )
        else:
            self._out[kind].publish(self._message({"data": data}))


ENDS: dict[str, tuple[type[End], type[End]]] = {
    "plain pyzmq": (PlainEnd, PlainEnd),
    "nep": (NepEnd, NepEnd),
    "nep over nanomsg": (NepNanomsgEnd, NepNanomsgEnd),
    "nep over zenoh": (NepZenohEnd, NepZenohEnd),
    "zenoh": (ZenohEnd, ZenohEnd),
    "rospy": (RospyEnd, RospyEnd),
    "rosbridge": (BridgedRospyEnd, RoslibpyEnd),
    ROSNODEJS: (RosnodejsPeerEnd, RosnodejsPeerEnd),
    **dict.fromkeys(CLIENTS, (NepEnd, NepEnd)),
}
"""Ping and pong of each row; pong of `ROSNODEJS` and `CLIENTS` is a program in another language."""


def run(end: End, answer: Callable[[dict[str, object]], None]) -> None:
    """Connect to the other end, then make the requested trips until standard input ends."""
    answer({"end": end.end})
    end.connect(json.loads(sys.stdin.readline()))
    answer({"ready": True})
    for line in sys.stdin:
        kind, size, count = json.loads(line)
        taken: list[float] = []
        if end.is_ping:
            taken = end.trips(kind, [payload(kind, size) for _ in range(count)])
        else:
            end.echo(kind, count)
        answer({"taken": taken})


def main(arguments: Sequence[str]) -> int:
    """Run one end of a row; return 1 if it can't run."""
    role, row, host, place = arguments
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is handled by the parent process
    own = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # keeps output of libraries out of the replies

    def answer(said: dict[str, object]) -> None:
        own.write(json.dumps(said) + "\n")

    try:
        end = ENDS[row][role == "pong"](role, host, place)
        with end.closes:
            run(end, answer)
            # A library may block on exit while it notifies a peer that has already ended.
            threading.Timer(LEAVE_S, os._exit, [0]).start()
    except Exception as error:  # noqa: BLE001 - whatever it is, the other rows go on
        answer({"not run": str(error) or type(error).__name__})
        return 1
    return 0


if __name__ == "__main__":
    # Threads of some libraries never end; everything else has been closed.
    code = main(sys.argv[1:])
    sys.stderr.flush()
    os._exit(code)
