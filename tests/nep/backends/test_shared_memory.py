"""Tests of large payloads between programs of one computer, in shared memory where possible."""

from __future__ import annotations

import gc
import hashlib
import itertools
import os
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zmq

import nep
from nep.backends.zeromq.publisher import NativePublisher
from nep.backends.zeromq.shared import memory as shared_memory
from nep.backends.zeromq.shared.memory import MIN_SHARED_BYTES, SharedReader, SharedWriter
from nep.masters.master import Master
from nep.protocol import wire
from tests.nep.programs import Program, eventually, running

pytest.importorskip("iceoryx2", reason="shared memory needs iceoryx2, which this computer has no package of")
LARGE = 300_000
LONG_S = 30.0
_ids = itertools.count(1 << 40)
_MEMORY = "/dev/shm"

pytestmark = [
    pytest.mark.skipif(
        shared_memory.free_bytes() < 2**29, reason="shared memory needs 512 MB of room in /dev/shm"
    ),
    pytest.mark.usefixtures("patient"),
]

LISTENER = """
    import hashlib, sys
    import nep
    node = nep.node("listener", master=sys.argv[1])
    sub = node.new_sub("frames", "bytes")
    print("listens")
    while True:
        message = sub.receive(30.0)
        if message is None or message.size_bytes == 1:
            break
        print(message.seq, hashlib.sha256(message.data).hexdigest(), isinstance(message.data.obj, bytes))
    print("lost", sub.lost, "received", sub.received)
    node.close()
"""


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("sharing", master=master.address) as made:
        yield made


def readers(publisher: nep.Publisher) -> int:
    """Return the number of subscribers that read the publisher's shared memory."""
    transport = publisher._transport
    assert isinstance(transport, NativePublisher)
    shared = transport._subscriptions.shared
    return 0 if shared is None else len(shared.readers)


def begin(publisher: nep.Publisher, *, count: int = 1, size: int = LARGE) -> int:
    """Publish until `count` subscribers use shared memory. Return the number of published messages."""
    sent = itertools.count(1)
    number = 0

    def is_shared() -> bool:
        nonlocal number
        if readers(publisher) == count:
            return True
        number = next(sent)
        publisher.publish(bytes(size))
        return False

    eventually(is_shared)
    return number


def in_memory(message: nep.Message) -> bool:
    """Return whether the payload is still in the shared memory that the publisher wrote."""
    return hasattr(message.data.obj, "held")


def test_large_payload_is_read_from_shared_memory_without_a_copy(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(begin(pub)):
        assert sub.receive(LONG_S) is not None
    data = os.urandom(LARGE)
    pub.publish(data)
    message = sub.receive(LONG_S)
    assert message is not None
    assert in_memory(message)
    assert message.data.readonly
    assert (message.payload, message.size_bytes, message.codec) == (data, LARGE, "bytes")
    assert (message.seq, message.publisher) == (pub.count, pub.id)
    assert sub.lost == 0


@pytest.mark.parametrize("size", [0, 1, MIN_SHARED_BYTES - 1, MIN_SHARED_BYTES, 2**20, 2**20 + 1, 9_000_000])
def test_every_size_arrives_complete_and_in_order(node: nep.Node, size: int) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(begin(pub)):
        sub.receive(LONG_S)
    sent = [os.urandom(size), b"small", os.urandom(size), os.urandom(MIN_SHARED_BYTES)]
    for each in sent:
        pub.publish(each)
    assert [sub.listen(timeout_s=LONG_S)[1] for _ in sent] == sent
    assert sub.lost == 0


def test_burst_of_thirty_images_arrives_completely(master: Master, node: nep.Node) -> None:
    pub = node.new_pub("frames", "bytes")
    with running(LISTENER, master.address) as listener:
        assert listener.line() == "listens"
        begun = begin(pub)
        pictures = [os.urandom(2**16) * 95 for _ in range(30)]  # 6 MB each
        for each in pictures:
            pub.publish(each)
        pub.publish(b".")
        said = [listener.line().split() for _ in range(begun + 30)]
        heard = [(int(seq), digest) for seq, digest, _copied in said[begun:]]
        assert heard == [(begun + n, hashlib.sha256(each).hexdigest()) for n, each in enumerate(pictures, 1)]
        assert listener.line() == f"lost 0 received {begun + 31}"


def test_subscriber_without_shared_memory_receives_the_payload_through_the_socket(
    master: Master, node: nep.Node
) -> None:
    sub, pub = node.new_sub("frames", "bytes"), node.new_pub("frames", "bytes")
    with running(LISTENER, master.address, NEP_SHARED_MEMORY="0") as listener:
        assert listener.line() == "listens"
        eventually(lambda: pub.subscribers == 2)
        begun = begin(pub, count=1)
        data = os.urandom(LARGE)
        pub.publish(data)
        pub.publish(b".")
        said = [listener.line().split() for _ in range(begun + 1)]
        assert said[-1] == [str(begun + 1), hashlib.sha256(data).hexdigest(), "False"]
        assert listener.line() == f"lost 0 received {begun + 2}"
    for _ in range(begun):
        sub.receive(LONG_S)
    message = sub.receive(LONG_S)
    assert message is not None
    assert in_memory(message)
    assert message.payload == data


def test_all_subscribers_receive_through_the_socket_if_one_sends_no_hello(
    master: Master, node: nep.Node
) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(begin(pub)):
        sub.receive(LONG_S)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    stranger = context.socket(zmq.SUB)
    try:
        stranger.rcvtimeo = int(LONG_S * 1000)
        stranger.subscribe(wire.topic_part("t"))
        stranger.connect(node.graph().topics["t"].publishers[0].endpoints[0])
        transport = pub._transport
        assert isinstance(transport, NativePublisher)
        eventually(lambda: bool(transport._subscriptions.legacy_filters))
        data = os.urandom(LARGE)
        pub.publish(data)
        assert stranger.recv_multipart()[2] == data
        message = sub.receive(LONG_S)
        assert message is not None
        assert not in_memory(message)
        assert message.payload == data
    finally:
        stranger.close(0)
        context.term()


def test_payloads_outlive_the_publisher_the_subscriber_and_both_nodes(master: Master) -> None:
    with nep.node("a", master=master.address) as a, nep.node("b", master=master.address) as b:
        sub, pub = b.new_sub("t", "bytes"), a.new_pub("t", "bytes")
        for _ in range(begin(pub)):
            sub.receive(LONG_S)
        pub.publish(b"\7" * LARGE)
        message = sub.receive(LONG_S)
        assert message is not None
        assert in_memory(message)
    gc.collect()
    assert message.payload == b"\7" * LARGE


def test_received_image_is_a_read_only_view_of_shared_memory(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "image"), node.new_pub("t", "image")
    frame = np.arange(720 * 1280 * 3, dtype=np.uint8).reshape(720, 1280, 3)
    count = 0
    while not readers(pub):
        pub.publish(nep.raw_image(frame))
        count += 1
        assert sub.receive(LONG_S) is not None
    pub.publish(nep.raw_image(frame))
    message = sub.receive(LONG_S)
    assert message is not None
    assert in_memory(message)
    picture: Any = message.payload
    np.testing.assert_array_equal(picture, frame)
    assert not picture.flags.writeable
    del message
    frame[:] = 0
    pub.publish(nep.raw_image(frame))
    assert int(picture[5, 5, 1]) == np.arange(720 * 1280 * 3, dtype=np.uint8).reshape(720, 1280, 3)[5, 5, 1]


def test_loan_is_published_without_a_copy(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "image"), node.new_pub("t", "image")
    assert pub.loan((480, 640, 3)).shape == (480, 640, 3)  # no shared memory yet: an ordinary array
    while not readers(pub):
        pub.publish(nep.raw_image(np.zeros((480, 640, 3), np.uint8)))
        assert sub.receive(LONG_S) is not None
    for value in range(50):  # more than the number of slots
        frame = pub.loan((480, 640, 3))
        frame[:] = value
        where = frame.ctypes.data
        pub.publish(nep.raw_image(frame))
        message = sub.receive(LONG_S)
        assert message is not None
        assert in_memory(message)
        picture: Any = message.payload
        assert (picture.shape, int(picture.min()), int(picture.max())) == ((480, 640, 3), value, value)
        assert where != picture.ctypes.data  # the same page, mapped at a different address by each end
    floats = pub.loan((200, 300), "float32")
    floats[:] = 1.5
    pub.publish(nep.raw_image(floats))
    assert float(sub.listen(timeout_s=LONG_S)[1][7, 7]) == 1.5


def test_loan_larger_than_all_previous_ones_is_published_completely(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "image"), node.new_pub("t", "image")
    while not readers(pub):
        pub.publish(nep.raw_image(np.zeros((480, 640, 3), np.uint8)))
        assert sub.receive(LONG_S) is not None
    for side in (1000, 2000, 3000):
        frame = pub.loan((side, side, 3))
        frame[:] = 7
        pub.publish(nep.raw_image(frame))
        picture: Any = sub.listen(timeout_s=LONG_S)[1]
        assert (picture.shape, int(picture.min()), int(picture.max())) == ((side, side, 3), 7, 7)
    assert sub.lost == 0


def test_unpublished_loans_are_released(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "image"), node.new_pub("t", "image")
    while not readers(pub):
        pub.publish(nep.raw_image(np.zeros((480, 640, 3), np.uint8)))
        assert sub.receive(LONG_S) is not None
    transport = pub._transport
    assert isinstance(transport, NativePublisher)
    kept = [pub.loan((480, 640, 3)) for _ in range(10)]
    assert transport.borrow_memory(480 * 640 * 3) is None  # no free slot: would be an ordinary array
    kept.clear()
    assert transport.borrow_memory(480 * 640 * 3) is not None


def test_loan_of_a_closed_publisher_stays_readable_but_cannot_be_published(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "image"), node.new_pub("t", "image")
    while not readers(pub):
        pub.publish(nep.raw_image(np.zeros((480, 640, 3), np.uint8)))
        assert sub.receive(LONG_S) is not None
    frame = pub.loan((480, 640, 3))
    frame[:] = 9
    pub.close()
    gc.collect()
    assert int(frame.sum()) == 9 * frame.size
    with pytest.raises(nep.ClosedError):
        pub.publish(nep.raw_image(frame))
    with pytest.raises(nep.ClosedError):
        pub.loan(5)


def test_segment_grows_for_larger_payloads(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for size in (LARGE, 3_000_000, 17_000_000):
        pub.publish(bytes(size))
        sub.receive(LONG_S)
        for _ in range(begin(pub, size=size)):
            sub.receive(LONG_S)
        pub.publish(b"\1" * size)
        message = sub.receive(LONG_S)
        assert message is not None
        assert in_memory(message), size
        assert message.payload == b"\1" * size
    pub.publish(bytes(70_000_000))  # above the maximum size of a slot
    message = sub.receive(LONG_S)
    assert message is not None
    assert not in_memory(message)
    assert (message.size_bytes, sub.lost) == (70_000_000, 0)


def test_reader_that_keeps_all_messages_receives_copies_and_does_not_exhaust_slots(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(begin(pub)):
        sub.receive(LONG_S)
    kept = []
    for number in range(200):
        pub.publish(bytes([number]) * LARGE)
        kept.append(sub.receive(LONG_S))
    messages = [each for each in kept if each is not None]
    assert len(messages) == 200
    assert [each.data[-1] for each in messages] == list(range(200))
    assert sum(map(in_memory, messages)) == shared_memory._MAX_HELD_SLOTS
    kept.clear()
    messages.clear()
    pub.publish(b"\5" * LARGE)
    message = sub.receive(LONG_S)
    assert message is not None
    assert in_memory(message)


def test_small_payloads_are_copied_and_hold_no_slots(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    size = shared_memory._MAX_COPIED_BYTES
    for _ in range(begin(pub, size=size)):
        sub.receive(LONG_S)
    messages = []
    for number in range(300):  # more than the number of slots
        pub.publish(bytes([number % 256]) * size)
        messages.append(sub.receive(LONG_S))
        assert readers(pub) == 1
    kept = [each for each in messages if each is not None]
    assert [each.payload[-1] for each in kept] == [number % 256 for number in range(300)]
    assert not any(map(in_memory, kept))
    pub.publish(bytes(size + 1))  # above the copy limit: allocates memory
    sub.receive(LONG_S)
    for _ in range(begin(pub, size=size + 1)):
        sub.receive(LONG_S)
    pub.publish(bytes(size + 1))
    message = sub.receive(LONG_S)
    assert message is not None
    assert in_memory(message), "larger ones stay where they are until somebody wants them"


def test_slow_reader_receives_correct_payloads_and_losses_are_counted(node: nep.Node) -> None:
    sub = node.new_sub("t", "bytes", max_messages=20)
    pub = node.new_pub("t", "bytes")
    begun = begin(pub)
    for number in range(300):
        pub.publish(bytes([number % 256]) * LARGE)
    eventually(lambda: sub.received + (sub.lost or 0) == begun + 300)
    seqs = []
    while (message := sub.receive(0.5)) is not None:
        assert message.seq is not None
        seqs.append(message.seq)
        assert message.payload == bytes([(message.seq - begun - 1) % 256]) * LARGE
    assert seqs == sorted(set(seqs))
    assert seqs[-1] == begun + 300
    assert sub.received + (sub.lost or 0) == begun + 300


def test_memory_files_of_a_killed_publisher_are_deleted_by_the_next_program() -> None:
    code = """
        import sys, time
        from nep.backends.zeromq.shared.memory import SharedWriter
        writer = SharedWriter(int(sys.argv[1]))
        assert writer.prepare(5_000_000)
        loan = writer.loan(5_000_000)
        loan.buffer[:] = bytes(5_000_000)
        writer.send(loan)
        print("sent")
        sys.stdin.readline()
    """
    with running(code, str(next(_ids))) as program:
        assert program.line() == "sent"
        made = _files(program)
        assert made
        program.kill()
    assert all(each.exists() for each in made)
    with running(code, str(next(_ids))) as another:
        assert another.line() == "sent"
        assert not any(each.exists() for each in made)
        made = _files(another)
        assert made
        another.say("end")
        another.end()
    assert not any(each.exists() for each in made)


def _files(program: Program) -> set[Path]:
    """Return nep's shared memory files that a program uses, without the global one."""
    words = Path(f"/proc/{program.process.pid}/maps").read_text().split()
    return {Path(each) for each in words if each.startswith(f"{_MEMORY}/nep_") and "global" not in each}


def test_slots_of_a_killed_reader_are_released() -> None:
    code = """
        import sys
        from nep.backends.zeromq.shared.memory import SharedReader
        reader = SharedReader(int(sys.argv[1]), 1)
        print("open")
        kept = []
        for line in sys.stdin:
            kept.append(reader._receive_next())
            print(len(kept))
    """
    writer = SharedWriter(next(_ids))
    assert writer.prepare(9_000_000)  # twenty slots of 16 MB
    with running(code, str(writer._publisher)) as program:
        assert program.line() == "open"
        count = 0
        while (loan := writer.loan(9_000_000)) is not None:
            writer.send(loan)
            count += 1
            program.say("")
            assert program.line() == str(count)
        assert count == 20
        program.kill()
    assert writer.loan(9_000_000) is None
    eventually(lambda: writer.reclaim_slots() is None and writer.loan(9_000_000) is not None)
    writer.close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
def test_exiting_forked_child_does_not_release_memory_of_its_parent(master: Master) -> None:
    code = """
        import gc, os, sys
        import nep
        node = nep.node("parent", master=sys.argv[1])
        sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
        def shares():
            shared = pub._transport._subscriptions.shared
            return shared is not None and shared.readers
        while not shares():
            pub.publish(bytes(300_000))
            sub.receive(30.0)
        pub.publish(b"kept" * 100_000)
        kept = sub.receive(30.0)
        for way in ("exit", "collect"):
            pid = os.fork()
            if pid == 0:
                del sub, pub, node, kept
                gc.collect()
                if way == "collect":
                    os._exit(0)
                sys.exit(0)
            os.waitpid(pid, 0)
        assert kept.payload == b"kept" * 100_000
        for number in range(100):
            pub.publish(bytes([number]) * 300_000)
            message = sub.receive(30.0)
            assert message.payload == bytes([number]) * 300_000
            assert hasattr(message.data.obj, "held")
        print("lost", sub.lost)
        node.close()
    """
    with running(code, master.address) as program:
        assert program.line() == "lost 0"
        assert program.end() == ("", "")


def test_missing_shared_memory_library_falls_back_to_the_socket(
    node: nep.Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shared_memory, "_MODULE_NAME", "no_such_library")
    monkeypatch.setattr(shared_memory, "_process", shared_memory._ProcessState())
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(3):
        pub.publish(b"\3" * LARGE)
        message = sub.receive(LONG_S)
        assert message is not None
        assert message.payload == b"\3" * LARGE
        assert not in_memory(message)
    assert not shared_memory.can_share()


def test_full_memory_falls_back_to_the_socket(node: nep.Node, monkeypatch: pytest.MonkeyPatch) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(begin(pub)):
        sub.receive(LONG_S)
    monkeypatch.setattr(shared_memory, "_RESERVED_BYTES", 2**62)
    monkeypatch.setattr(shared_memory, "_QUERY_INTERVAL_S", 0.0)
    pub.publish(b"\3" * LARGE)
    message = sub.receive(LONG_S)
    assert message is not None
    assert message.payload == b"\3" * LARGE
    assert not in_memory(message)
    monkeypatch.setattr(shared_memory, "_RESERVED_BYTES", 0)
    pub.publish(b"\4" * LARGE)
    message = sub.receive(LONG_S)
    assert message is not None
    assert in_memory(message)


def test_file_in_place_of_the_private_folder_raises_os_error(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    (tmp_path / "nep-shared").write_text("a file")
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(OSError, match="nep-shared"):
        shared_memory._create_private_folder()


@pytest.mark.parametrize("part", [b"", b"\0" * 7, struct.pack("<Q", 2**64 - 1), struct.pack("<Q", 1)])
def test_invalid_reference_is_rejected_and_missing_payload_is_counted_as_lost(
    node: nep.Node, part: bytes
) -> None:
    """The reference is rejected or counted as lost, and the next message is received."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    stranger = context.socket(zmq.PUB)
    try:
        port = stranger.bind_to_random_port("tcp://127.0.0.1")
        sub = node.new_sub("t", "bytes", node.direct("127.0.0.1", port, wire="native"))
        heard: list[nep.Message] = []

        def is_heard() -> bool:
            head = wire.Header(3, wire.SHARED, 1, 5, 77, len(part)).pack()
            stranger.send_multipart([wire.topic_part("t"), head, part])
            stranger.send_multipart([wire.topic_part("t"), wire.Header(3, 0, 2, 5, 78, 2).pack(), b"ok"])
            message = sub.receive(0.05)
            heard.extend([] if message is None else [message])
            return bool(heard)

        eventually(is_heard)
        assert heard[0].payload == b"ok"
        assert sub.refused if len(part) != 8 else sub.lost
    finally:
        stranger.close(0)
        context.term()


def test_truncated_reference_of_a_reading_publisher_is_rejected(node: nep.Node) -> None:
    sub, pub = node.new_sub("t", "bytes"), node.new_pub("t", "bytes")
    for _ in range(begin(pub)):
        assert sub.receive(LONG_S) is not None
    pub.publish(bytes(LARGE))
    assert sub.receive(LONG_S) is not None
    transport = pub._transport
    assert isinstance(transport, NativePublisher)
    for reference in (b"", b"1234567", b"123456789"):
        form = transport._form | wire.SHARED << 16
        header = wire.pack_header(form, len(reference), pub.count + 1, 5, pub.id)
        transport._send(wire.topic_part("t") + header + reference)
    pub.publish(b"next")
    message = sub.receive(LONG_S)
    assert message is not None
    assert message.payload == b"next"
    assert sub.refused == 3


@pytest.mark.parametrize("size", [2**63, 2**20, LARGE + 1])
def test_payload_size_beyond_its_sample_is_not_read(size: int) -> None:
    publisher = next(_ids)
    writer = SharedWriter(publisher)
    assert writer.prepare(LARGE)
    reader = SharedReader(publisher, writer.generation)
    loan = writer.loan(LARGE)
    assert loan is not None
    loan.size = size  # what the header of the sample claims
    assert writer.send(loan) == 1
    assert reader.read(1) is None
    assert writer.copy(b"x" * LARGE, LARGE) == 2
    assert bytes(reader.read(2) or b"") == b"x" * LARGE
    writer.close()


def test_opening_missing_memory_raises_lookup_error() -> None:
    with pytest.raises(LookupError):
        SharedReader(next(_ids), 1)


def test_overwritten_payloads_are_lost_and_the_next_one_is_read() -> None:
    writer = SharedWriter(next(_ids))
    assert writer.prepare(2**20)
    reader = SharedReader(writer._publisher, 1)
    numbers = []
    for value in range(4):
        loan = writer.loan(1000)
        assert loan is not None
        loan.buffer[:] = bytes([value]) * 1000
        numbers.append(writer.send(loan))
    assert numbers == [1, 2, 3, 4]
    found = reader.read(3)
    assert found is not None
    assert bytes(found) == b"\2" * 1000
    assert reader.read(1) is None
    found = reader.read(4)
    assert found is not None
    assert bytes(found) == b"\3" * 1000
    assert reader.read(5) is None
