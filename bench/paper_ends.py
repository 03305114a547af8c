"""One end of a ping-pong: what `paper.py` starts twice for each of its rows, as ping and as pong.

    python bench/paper_ends.py ping|pong ROW OWN_HOST PLACE

A row is one way to carry messages. Both ends encode, send, receive and decode each message: pong sends back
what it has decoded. Where a library hands messages to callbacks, pong answers in the callback itself and ping
takes the time in it; where a program waits for them, both wait in their main threads.

They talk in lines of JSON: {"end": ...} is where the other end connects, whose own end is then read;
{"ready": true} says that messages pass; each further line read is [KIND, SIZE, COUNT] and answered by
{"taken": [seconds, ...]}. {"not run": REASON} is the last line of an end that cannot go on.
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
"""A message that has not come back after this time is lost."""
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
    """As plain programs send it: UTF-8, the json module's text, or what it is."""
    if kind == "bytes":
        return value
    return (json.dumps(value) if kind == "json" else value).encode()


def unpacked(kind: str, data: Any) -> object:  # noqa: ANN401 - bytes or what is like them
    """What `packed` made it of."""
    if kind == "bytes":
        return data
    text = bytes(data).decode() if isinstance(data, memoryview) else data.decode()
    return json.loads(text) if kind == "json" else text


class End(ABC):
    """One end; `end` tells the other where to connect."""

    end = ""

    def __init__(self, role: str, host: str, place: str) -> None:
        self.is_ping = role == "ping"
        self.there, self.back = ("ping", "pong") if self.is_ping else ("pong", "ping")
        """What this end's own messages are called, and the other's."""
        self.role, self.host, self.place = role, host, place
        self.closes = ExitStack()

    @abstractmethod
    def connect(self, other: str) -> None:
        """Returns when messages pass in both directions."""

    @abstractmethod
    def send(self, kind: str, value: object) -> None:
        """Encode and send it."""

    @abstractmethod
    def trips(self, kind: str, payloads: Sequence[object]) -> list[float]:
        """There and back with each; seconds."""

    @abstractmethod
    def echo(self, kind: str, count: int) -> None:
        """Returns when as many have been sent back."""


class Listening(End):
    """An end whose program waits for messages itself."""

    @abstractmethod
    def receive(self, kind: str) -> object:
        """The next one, decoded."""

    def trips(self, kind: str, payloads: Sequence[object]) -> list[float]:
        """There and back with each; seconds."""
        taken = []
        for value in payloads:
            started = time.perf_counter()
            self.send(kind, value)
            came = self.receive(kind)
            taken.append(time.perf_counter() - started)
            check(came, value)
        return taken

    def echo(self, kind: str, count: int) -> None:
        """Returns when as many have been sent back."""
        for _ in range(count):
            self.send(kind, self.receive(kind))


class Called(End):
    """An end whose library calls back with messages."""

    def __init__(self, role: str, host: str, place: str) -> None:
        super().__init__(role, host, place)
        self._came: queue.SimpleQueue[tuple[float, object]] = queue.SimpleQueue()
        self._echoed = threading.Semaphore(0)

    def came(self, kind: str, value: object) -> None:
        """A decoded message; called by the library."""
        if self.is_ping:
            self._came.put((time.perf_counter(), value))
        else:
            self.send(kind, value)
            self._echoed.release()

    def trips(self, kind: str, payloads: Sequence[object]) -> list[float]:
        """There and back with each; seconds."""
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
        """Returns when as many have been sent back."""
        for _ in range(count):
            if not self._echoed.acquire(timeout=WAIT_S):
                raise LostError("a message was not received")


class LostError(Exception):
    """A message did not come in time, or came as another one."""


def check(came: object, sent: object) -> None:
    """Raises `LostError` when it is not the same."""
    if came != sent:
        raise LostError("another message came back")


def wait_until(is_so: Callable[[], Any]) -> None:
    """Look again and again, until the other end must be there."""
    pause, deadline = threading.Event(), time.monotonic() + WAIT_S
    while not is_so():
        if time.monotonic() > deadline:
            raise LostError("the other end was not found")
        pause.wait(LOOK_S)


class PlainEnd(Listening):
    """pyzmq alone: a PUB (here an XPUB, which tells who has come) and a SUB for each kind."""

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
        """Returns when messages pass in both directions."""
        for kind, end in zip(KINDS, other.split(), strict=True):
            self._in[kind].connect(end)
        for each in self._out.values():
            if not each.poll(int(WAIT_S * 1000)):
                raise LostError("the other end was not found")
            each.recv()

    def send(self, kind: str, value: object) -> None:
        """Encode and send it."""
        self._out[kind].send(packed(kind, value), copy=kind != "bytes")

    def receive(self, kind: str) -> object:
        """The next one, decoded."""
        if kind == "bytes":
            return self._in[kind].recv(copy=False).buffer
        return unpacked(kind, self._in[kind].recv())


class NepEnd(Listening):
    """nep over one of its back ends; ping's process has the master, where there is one."""

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
        """Returns when messages pass in both directions."""
        self._meet(self._own if self.is_ping else other)

    def _meet(self, master: str) -> None:
        node = self.closes.enter_context(
            self._nep.node(self.role, self.transport, master=master, wait_s=WAIT_S)
        )
        self._in = {kind: node.new_sub(f"{self.back}_{kind}", each) for kind, each in TYPES.items()}
        self._out = {kind: node.new_pub(f"{self.there}_{kind}", each) for kind, each in TYPES.items()}
        wait_until(lambda: all(each.subscribers for each in self._out.values()))

    def send(self, kind: str, value: object) -> None:
        """Encode and send it."""
        self._out[kind].publish(value)

    def receive(self, kind: str) -> object:
        """The next one, decoded."""
        ok, value = self._in[kind].listen(timeout_s=WAIT_S)
        if not ok:
            raise LostError("a message was not received")
        return value


class NepNanomsgEnd(NepEnd):
    """nep over nanomsg's protocols, by pynng."""

    transport = "nanomsg"


class NepZenohEnd(NepEnd):
    """nep over zenoh; `place` is where nodes of zenoh meet."""

    def __init__(self, role: str, host: str, place: str) -> None:
        Listening.__init__(self, role, host, place)
        import nep  # noqa: PLC0415 - each row imports its own library

        self._nep = nep
        self.transport = "zenoh"

    def connect(self, other: str) -> None:  # noqa: ARG002 - both were told the place
        """Returns when messages pass in both directions."""
        self._meet(self.place)


class ZenohEnd(Called):
    """zenoh's own Python: ping listens at `place`, pong connects there."""

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
        """Returns when messages pass in both directions."""
        if not self.is_ping:
            self._begin()
        wait_until(lambda: all(each.matching_status.matching for each in self._out.values()))

    def send(self, kind: str, value: object) -> None:
        """Encode and send it."""
        self._out[kind].put(packed(kind, value))


class RospyEnd(Called):
    """rospy: std_msgs/String, and UInt8MultiArray for bytes; `place` is the ROS master."""

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
        """Returns when messages pass in both directions."""
        both = (*self._out.values(), *self._in.values())
        wait_until(lambda: all(each.get_num_connections() for each in both))

    def send(self, kind: str, value: object) -> None:
        """Encode and send it."""
        message = self._types[kind]()
        message.data = json.dumps(value) if kind == "json" else value
        self._out[kind].publish(message)


class BridgedRospyEnd(RospyEnd):
    """rospy whose other end is behind a rosbridge server; both rows may have one ROS master."""

    topics = "bridged"


class RosnodejsPeerEnd(RospyEnd):
    """rospy whose other end is a program with rosnodejs."""

    topics = "rosnodejs"


class RoslibpyEnd(Called):
    """roslibpy, connected to the rosbridge server at `place`; bytes travel as base64."""

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
        """Returns at once: ping is rospy, which sees both connections."""

    def send(self, kind: str, value: Any) -> None:  # noqa: ANN401 - one of three types
        """Encode and send it."""
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
    """Meet the other end, then make the trips that are asked for until nothing more is."""
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
    """The end of a row; 1 when it cannot be run."""
    role, row, host, place = arguments
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is for the program that started this
    own = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what a library prints must not be taken for an answer

    def answer(said: dict[str, object]) -> None:
        own.write(json.dumps(said) + "\n")

    try:
        end = ENDS[row][role == "pong"](role, host, place)
        with end.closes:
            run(end, answer)
            # A library may want to tell somebody that it goes, who is not there any more.
            threading.Timer(LEAVE_S, os._exit, [0]).start()
    except Exception as error:  # noqa: BLE001 - whatever it is, the other rows go on
        answer({"not run": str(error) or type(error).__name__})
        return 1
    return 0


if __name__ == "__main__":
    # The threads of some libraries do not end; all that has to be closed was.
    code = main(sys.argv[1:])
    sys.stderr.flush()
    os._exit(code)
