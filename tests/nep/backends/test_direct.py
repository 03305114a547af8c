"""Tests of direct connections: which side binds, both generations of the original wire, the native wire."""

from __future__ import annotations

import base64
import contextlib
import threading
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
import zmq

import nep
from nep.backends.zeromq.legacy import from_frame, to_frame
from nep.errors import WireError


@pytest.fixture
def port() -> int:
    """Return a free port whose next port is free, too."""
    while True:
        with zmq.Context() as context, context.socket(zmq.REP) as one, context.socket(zmq.REP) as two:
            found = int(one.bind_to_random_port("tcp://127.0.0.1"))
            with contextlib.suppress(zmq.ZMQError):
                two.bind(f"tcp://127.0.0.1:{found + 1}")
                return found


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("n", master="127.0.0.1:1") as made:
        yield made


@pytest.mark.parametrize("wire", ["original", "native"])
@pytest.mark.parametrize("mode", ["one2many", "many2one"])
@pytest.mark.parametrize("subscriber_first", [True, False])
def test_one_sided_direct_connection_delivers_in_each_start_order_without_a_master(
    node: nep.Node,
    port: int,
    wire: str,
    mode: str,
    subscriber_first: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    conf = node.direct("127.0.0.1", str(port), mode, wire=wire)  # type: ignore[arg-type]
    if subscriber_first:
        sub = node.new_sub("t", "json", conf)
        monkeypatch.setattr("nep.backends.zeromq.transport.DIRECT_WAIT_S", 30.0)
        pub = node.new_pub("t", "json", conf)  # waits for the subscriber
    else:
        pub = node.new_pub("t", "json", conf)
        sub = node.new_sub("t", "json", conf)
        while not pub.subscribers:
            node.spin(0.01)
    pub.publish({"n": 1})
    message = sub.receive(30.0)
    assert message is not None
    assert message.payload == {"n": 1}
    assert message.seq == (None if wire == "original" else 1)
    assert sub.lost == (None if wire == "original" else 0)


@pytest.mark.parametrize(
    ("generation", "msg_type", "payload", "frame"),
    [
        ("A", "json", {"a": [1]}, b't {"a":[1]}'),
        ("B", "json", {"a": [1]}, b'{"a":[1]}'),
        ("A", "string", "hello world", b"t hello world"),
        ("B", "string", "hello world", b"hello world"),
        ("B", "dictionary", {"a": 1}, b't {"a":1}'),
        ("A", "bytes", b"raw", b"raw"),
        ("B", "msgpack", {"a": 1}, b"\x81\xa1a\x01"),
    ],
)
def test_frames_match_what_a_plain_zeromq_program_receives(
    node: nep.Node, port: int, generation: str, msg_type: str, payload: object, frame: bytes
) -> None:
    with zmq.Context() as context, context.socket(zmq.SUB) as plain:
        plain.setsockopt(zmq.LINGER, 0)
        plain.subscribe(b"")
        plain.connect(f"tcp://127.0.0.1:{port}")
        conf = node.direct(port=port, generation=generation)  # type: ignore[arg-type]
        pub = node.new_pub("t", msg_type, conf)
        while not pub.subscribers:
            node.spin(0.01)
        pub.publish(payload)
        assert plain.poll(30_000)
        assert plain.recv_multipart() == [frame]


def test_both_framings_are_received_and_other_topics_ignored(node: nep.Node, port: int) -> None:
    with zmq.Context() as context, context.socket(zmq.XPUB) as plain:
        plain.setsockopt(zmq.LINGER, 0)
        plain.bind(f"tcp://127.0.0.1:{port}")
        sub = node.new_sub("t", "json", node.direct(port=port))
        assert plain.poll(30_000)
        assert plain.recv() == b"\x01"
        for frame in (b't {"n":1}', b'{"n": 2}', b't2 {"n":3}', b"t 4"):
            plain.send(frame)
        assert [sub.listen(timeout_s=30.0)[1] for _ in range(3)] == [{"n": 1}, {"n": 2}, 4]
        assert sub.listen(timeout_s=0.05) == (False, {})
        plain.send_multipart([b"two", b"parts"])
        plain.send(b"t {broken")
        plain.send(b"t 5")
        assert sub.listen(timeout_s=30.0) == (True, 5)


def test_image_round_trips_over_the_original_wire(node: nep.Node, port: int) -> None:
    picture = np.full((24, 32, 3), 90, np.uint8)
    conf = node.direct(port=port, mode="many2one")
    with zmq.Context() as context, context.socket(zmq.PUB) as plain:
        plain.setsockopt(zmq.LINGER, 0)
        sub = node.new_sub("cam", "image", conf)
        pub = node.new_pub("cam", "image", conf)
        while not pub.subscribers:
            node.spin(0.01)
        pub.publish(picture)
        ok, got = sub.listen(timeout_s=30.0)
        assert ok
        assert np.abs(got.astype(int) - 90).max() < 3  # type: ignore[attr-defined]


def test_frames_round_trip_in_both_generations() -> None:
    file = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
    for generation in ("A", "B"):
        for msg_type, codec in [
            ("image", "image"),
            ("images", "image"),
            ("json", "json"),
            ("bytes", "bytes"),
        ]:
            data = file if codec == "image" else b'{"a":1}'
            frame = to_frame("t", generation, msg_type, codec, data)
            assert from_frame("t", msg_type, codec, frame) == data
    assert to_frame("cam", "A", "image", "image", file) == b"cam " + base64.b64encode(file)
    assert from_frame("cam", "image", "image", b"cam2 " + base64.b64encode(file)) is None
    with pytest.raises(WireError, match="isn't base64-encoded"):
        from_frame("cam", "image", "image", b"cam !!!")


def test_taken_port_raises_address_in_use_error(node: nep.Node, port: int) -> None:
    conf = node.direct(port=port)
    node.new_pub("t", "json", conf)
    with pytest.raises(nep.AddressInUseError, match=f"'127.0.0.1:{port}' is in use"):
        node.new_pub("t", "json", conf)
    with pytest.raises(nep.AddressInUseError):
        node.new_sub("t", "json", node.direct(port=port, mode="many2one"))


def test_many_to_many_connects_to_both_ports_of_a_proxy(node: nep.Node, port: int) -> None:
    with zmq.Context() as context, context.socket(zmq.XSUB) as xsub, context.socket(zmq.XPUB) as xpub:
        for each in (xsub, xpub):
            each.setsockopt(zmq.LINGER, 0)
        xsub.bind(f"tcp://127.0.0.1:{port}")
        xpub.bind(f"tcp://127.0.0.1:{port + 1}")
        conf = node.direct(port=port, mode="many2many")
        sub = node.new_sub("t", "json", conf)
        assert xpub.poll(30_000)
        xsub.send(xpub.recv())
        pub = node.new_pub("t", "json", conf)
        while not pub.subscribers:
            assert not xsub.poll(10)  # poll both sockets, as a proxy does
        pub.publish(1)
        assert xsub.poll(30_000)
        xpub.send(xsub.recv())
        assert sub.listen(timeout_s=30.0) == (True, 1)


def test_invalid_direct_connections_are_rejected() -> None:
    with nep.node("n", "memory") as node:
        with pytest.raises(nep.NepError, match="unknown mode 'one2one'; did you mean 'one2many'"):
            node.direct(mode="one2one")
        for port in ("http", 0, 65536, "-1"):
            with pytest.raises(nep.NepError, match=f"'{port}' .* 1 to 65535"):
                node.direct(port=port)
        with pytest.raises(nep.NepError, match=r"'memory' .*direct connections"):
            node.new_pub("t", "json", node.direct())


@pytest.mark.usefixtures("frequent_switching")
def test_opening_while_another_thread_closes_the_last_node_raises_closed_error() -> None:
    """The ZeroMQ context ends with the last node, but not while another thread opens a socket in it."""
    raised: list[BaseException] = []

    def subscribe(node: nep.Node, has_begun: threading.Event) -> None:
        try:
            while True:
                node.new_sub("t", "json", node.direct("127.0.0.1", 1))
                has_begun.set()
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is judged below
            raised.append(error)

    for _ in range(60):
        node, has_begun = nep.node("closing", master="127.0.0.1:1"), threading.Event()
        threads = [threading.Thread(target=subscribe, args=(node, has_begun)) for _ in range(3)]
        for thread in threads:
            thread.start()
        has_begun.wait(30.0)
        node.close()
        for thread in threads:
            thread.join(30.0)
    assert [each for each in raised if not isinstance(each, nep.ClosedError)] == []
    assert len(raised) == 180
