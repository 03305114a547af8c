"""Tests of the C# client's own ZMTP sockets against libzmq."""

from __future__ import annotations

import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress

import pytest
import zmq

from tests.clients.mono_programs import CSHARP, HAS_MONO, WITHOUT, MonoProgram, program
from tests.nep.programs import eventually

pytestmark = pytest.mark.skipif(not HAS_MONO, reason=WITHOUT)
LONG_S = 60.0
Context = zmq.Context[zmq.Socket[bytes]]
TOPIC = b"example\0"
LAST = b"\xffhello3/0000000000000001/example"


def peer(*args: str) -> MonoProgram:
    return MonoProgram(program("ZmtpPeer.exe", CSHARP / "tests" / "peer" / "ZmtpPeer.cs"), *args)


@pytest.fixture
def context() -> Iterator[Context]:
    with zmq.Context() as made:
        made.linger = 0
        yield made


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as made:
        yield made


def started(stack: ExitStack, *args: str) -> MonoProgram:
    made = peer(*args)
    stack.callback(made.close)
    return made


def bound(context: Context, kind: int) -> tuple[zmq.Socket[bytes], str]:
    made = context.socket(kind)
    made.rcvtimeo = 60_000
    port = made.bind_to_random_port("tcp://127.0.0.1")
    return made, f"tcp://127.0.0.1:{port}"


def test_dealer_exchanges_messages_from_1_byte_to_6_megabytes(context, stack: ExitStack) -> None:
    echo, endpoint = bound(context, zmq.DEALER)
    with echo:
        started(stack, "dealer", endpoint)
        for parts in (
            [b"a"],
            [b"", b"b" * 255, b"c" * 256],
            [b"x" * 70_000, b""],
            [bytes(range(256)) * 24_000],
        ):
            echo.send_multipart(parts)
            assert echo.recv_multipart() == parts


def test_dealer_reports_a_lost_connection_and_reconnects(context, stack: ExitStack) -> None:
    first = context.socket(zmq.DEALER)
    first.heartbeat_ivl, first.heartbeat_timeout = 50, 60_000
    port = first.bind_to_random_port("tcp://127.0.0.1")
    with first:
        dealer = started(stack, "dealer", f"tcp://127.0.0.1:{port}")
        assert dealer.line() == "connected"
        first.rcvtimeo = 60_000
        for _ in range(5):
            first.send(b"ping")
            assert first.recv() == b"ping"
    assert dealer.line() == "disconnected"
    with context.socket(zmq.DEALER) as second:
        second.rcvtimeo = 60_000
        second.bind(f"tcp://127.0.0.1:{port}")
        assert dealer.line() == "connected"
        second.send(b"again")
        assert second.recv() == b"again"
    assert dealer.ask("refused") in {"refused ", "disconnected"}


def test_sub_socket_sends_sorted_filters_and_later_changes_and_receives_matching_messages(
    context, stack: ExitStack
) -> None:
    sub = started(stack, "sub")
    filters = [LAST, *(b"topic %d\0" % number for number in range(10)), TOPIC]
    for each in filters:
        sub.say(f"subscribe {each.hex()}")
    for kind in (zmq.XPUB, zmq.XPUB):
        publisher, endpoint = bound(context, kind)
        with publisher:
            sub.say(f"connect {endpoint}")
            assert [publisher.recv() for _ in filters] == [b"\1" + each for each in sorted(filters)]
            sub.say(f"subscribe {b'late'.hex()}")
            assert publisher.recv() == b"\1late"
            sub.say(f"unsubscribe {b'late'.hex()}")
            assert publisher.recv() == b"\0late"
            for parts in ([TOPIC + b"one part"], [TOPIC, b"h" * 32, b"payload"], [TOPIC, b"", b""]):
                publisher.send_multipart(parts)
                assert sub.line() == "message " + " ".join(part.hex() for part in parts)
            body = bytes(range(256)) * 24_000
            publisher.send_multipart([TOPIC, body])
            assert sub.line() == f"message {TOPIC.hex()} {len(body)}:{sum(body)}"


def test_xpub_reports_each_subscription_and_serves_every_filter(context, stack: ExitStack) -> None:
    xpub = started(stack, "xpub", "127.0.0.1")
    endpoint = f"tcp://127.0.0.1:{xpub.line().split()[1]}"
    with context.socket(zmq.SUB) as one, context.socket(zmq.SUB) as two, context.socket(zmq.SUB) as other:
        for each, wanted in ((one, TOPIC), (two, TOPIC), (other, b"else")):
            each.rcvtimeo = 60_000
            each.subscribe(wanted)
            each.connect(endpoint)
            assert xpub.line() == f"+{wanted.hex()}"
        for parts in ([TOPIC + b"x"], [TOPIC, b"", b"y" * 70_000]):
            xpub.say("send " + " ".join(part.hex() for part in parts))
            assert one.recv_multipart() == two.recv_multipart() == parts
        xpub.say(f"burst {TOPIC.hex()} 20 6000000")
        for number in range(20):
            topic, counted, body = one.recv_multipart()
            assert (topic, int.from_bytes(counted, "little"), len(body)) == (TOPIC, number, 6_000_000)
        assert xpub.line() == "sent 40"
        assert other.poll(0) == 0
        one.unsubscribe(TOPIC)
        assert xpub.line() == f"-{TOPIC.hex()}"
        xpub.say(f"send {TOPIC.hex()}")
        other.close()
        assert xpub.line() == "left"
    xpub.line()
    assert xpub.end() == 0


def test_xpub_bounds_the_queue_of_a_slow_subscriber_and_delivers_accepted_messages(
    context, stack: ExitStack
) -> None:
    xpub = started(stack, "xpub", "127.0.0.1", "queue=8000000")
    endpoint = f"tcp://127.0.0.1:{xpub.line().split()[1]}"
    with context.socket(zmq.SUB) as slow:
        slow.rcvhwm, slow.rcvtimeo = 1, 60_000
        slow.subscribe(TOPIC)
        slow.connect(endpoint)
        xpub.line()
        taken = int(xpub.ask(f"burst {TOPIC.hex()} 400 1000000").split()[1])
        assert 0 < taken < 300
        for _ in range(taken):  # accepted messages arrive, dropped ones do not
            slow.recv_multipart()
        xpub.say(f"send {TOPIC.hex()} {b'end'.hex()}")
        assert slow.recv_multipart() == [TOPIC, b"end"]


def test_burst_of_small_messages_is_received_complete_and_in_order(
    context: Context, stack: ExitStack
) -> None:
    xpub = started(stack, "xpub", "127.0.0.1")
    with context.socket(zmq.SUB) as sub:
        sub.rcvhwm, sub.rcvtimeo = 0, 60_000
        sub.subscribe(TOPIC)
        sub.connect(f"tcp://127.0.0.1:{xpub.line().split()[1]}")
        xpub.line()
        xpub.say(f"burst {TOPIC.hex()} 20000 3")
        assert [int.from_bytes(sub.recv_multipart()[1], "little") for _ in range(20_000)] == list(
            range(20_000)
        )
        assert xpub.line() == "sent 20000"


def test_ipv6_works_where_available(context, stack: ExitStack) -> None:
    if not socket.has_ipv6:
        pytest.skip("no IPv6")
    xpub = started(stack, "xpub", "::1")
    endpoint = f"tcp://[::1]:{xpub.line().split()[1]}"
    sub = started(stack, "sub")
    sub.say(f"subscribe {TOPIC.hex()}")
    sub.say(f"connect {endpoint}")
    assert xpub.line() == f"+{TOPIC.hex()}"
    xpub.say(f"send {TOPIC.hex()} 00")
    assert sub.line() == f"message {TOPIC.hex()} 00"


GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL" + bytes(16) + b"\x00" + bytes(31)
READY = b"\x04\x19\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB"


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"GET / HTTP/1.1\r\n\r\n" + bytes(60), "no-greeting"),
        (GREETING.replace(b"\x03\x00NULL", b"\x01\x00NULL"), "old-version"),
        (GREETING.replace(b"NULL", b"CURV"), "other-mechanism"),
        (GREETING + b"\x00\x01x", "bad-handshake"),
        (GREETING + READY.replace(b"SUB", b"PUB"), "other-socket-type"),
        (GREETING + READY + b"\x02" + b"\x7f" + bytes(7), "message-too-large"),
        (GREETING + READY + b"\x00" * 2 + b"\x40\x00", "bad-frame"),
        (GREETING + READY + b"\x01\x01\x01\x00\x01\x01", "too-many-parts"),
        (GREETING + READY + b"\x06" + bytes(6) + b"\xff\xff", "command-too-large"),
        (GREETING[:40], "handshake-timeout"),
    ],
)
def test_malformed_peer_is_disconnected_and_counted_with_a_reason(
    stack: ExitStack, data: bytes, code: str
) -> None:
    handshake_ms = 300 if code == "handshake-timeout" else 60_000
    xpub = started(stack, "xpub", "127.0.0.1", f"handshake_ms={handshake_ms}")
    port = int(xpub.line().split()[1])
    with socket.create_connection(("127.0.0.1", port), timeout=40.0) as stranger:
        stranger.sendall(data)
        try:
            while stranger.recv(4096):
                pass
        except ConnectionResetError:
            pass
    lines = [xpub.ask("refused")]
    while not lines[-1].startswith("refused"):
        lines.append(xpub.line())
    assert lines[-1] == f"refused {code}=1"


def test_connections_with_mutated_bytes_do_not_stop_the_xpub_socket(context, stack: ExitStack) -> None:
    xpub = started(stack, "xpub", "127.0.0.1", "handshake_ms=200")
    port = int(xpub.line().split()[1])
    chance = random.Random(27)
    good = GREETING + READY + b"\x00\x09\x01" + TOPIC + b"\x04\x07\x04PING\x00\x00"
    for _ in range(150):
        bad = bytearray(good)
        for _ in range(chance.randrange(1, 6)):
            bad[chance.randrange(len(bad))] = chance.randrange(256)
        with socket.create_connection(("127.0.0.1", port), timeout=40.0) as stranger:
            stranger.sendall(bad[: chance.randrange(1, len(bad) + 1)])
    with context.socket(zmq.SUB) as sub:
        sub.rcvtimeo = 60_000
        sub.subscribe(b"alive")
        sub.connect(f"tcp://127.0.0.1:{port}")
        while xpub.line() != f"+{b'alive'.hex()}":
            pass
        xpub.say(f"send {b'alive'.hex()}")
        assert sub.recv() == b"alive"
    xpub.say("refused")
    while not (lines := xpub.line()).startswith("refused"):
        pass
    assert "unexpected" not in lines


class ForeignServer:
    """Server that is no ZMTP peer: sends fixed bytes on each connection, then waits or closes it."""

    def __init__(self, port: int, answer: bytes, *, waits: bool) -> None:
        self._answer = answer
        self._waits = waits
        self.accepted: list[socket.socket] = []
        self._server = socket.create_server(("127.0.0.1", port))
        self.port = self._server.getsockname()[1]
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while True:
            try:
                connection = self._server.accept()[0]
            except OSError:
                return  # the server socket was shut down
            self.accepted.append(connection)
            with suppress(OSError):
                connection.sendall(self._answer)
            if not self._waits:
                connection.close()

    def close(self) -> None:
        self._server.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        for each in (*self.accepted, self._server):
            each.close()


class ForeignSocket:
    """Socket of libzmq with a type or security mechanism that the client can't connect to."""

    def __init__(self, port: int, kind: int, mechanism: str = "NULL") -> None:
        self._context: Context = zmq.Context()
        self._socket = self._context.socket(kind)
        if mechanism == "CURVE":
            self._socket.curve_server = True
            self._socket.curve_publickey, self._socket.curve_secretkey = zmq.curve_keypair()
        if mechanism == "PLAIN":
            self._socket.plain_server = True
        self._socket.bind(f"tcp://127.0.0.1:{port}")

    def close(self) -> None:
        self._context.destroy(linger=0)  # blocks until the port is free


def foreign_programs(own: str) -> Iterator[tuple[str, Callable[[int], ForeignServer | ForeignSocket]]]:
    """Yield the client's error message for each kind of foreign program, and a function that starts it."""
    kinds = {"dealer": ("PUB", "PULL", "PAIR"), "sub": ("REP", "PULL", "ROUTER")}[own]
    for kind in kinds:
        yield (
            f"it is a {kind} socket",
            lambda port, kind=kind: ForeignSocket(port, getattr(zmq, kind)),
        )
    for mechanism in ("CURVE", "PLAIN"):
        yield (
            "it closed the connection during the handshake",
            lambda port, mechanism=mechanism: ForeignSocket(port, zmq.XPUB, mechanism),
        )
    for said, answer, waits in (
        ("it closed the connection", b"", False),
        ("it closed the connection", GREETING, False),
        ("it uses the security mechanism CURVE", GREETING.replace(b"NULL\0", b"CURVE"), True),
        ("it uses an unknown security mechanism", GREETING.replace(b"NULL", b"\nABC"), True),
        ("it does not speak ZMTP", b"HTTP/1.1 400 Bad Request\r\n\r\n" + bytes(60), False),
        ("it does not speak ZMTP", b"SSH-2.0-OpenSSH\r\n", True),
        ("it sent nothing", b"", True),
        ("it sent an incomplete handshake", GREETING, True),
        ("it speaks a version of ZMTP before 3", GREETING.replace(b"\x03\x00NULL", b"\x01\x00NULL"), True),
        ("it reports an error: too?hot", GREETING + b"\x04\x0e\x05ERROR\x07too\nhot", True),
        ("it sent a malformed handshake", GREETING + b"\x00\x01x", True),
        ("it sent a malformed handshake", GREETING + READY.replace(b"\0\0\0\x03", b"\0\0\0\x09"), True),
    ):
        yield said, lambda port, answer=answer, waits=waits: ForeignServer(port, answer, waits=waits)


@pytest.mark.parametrize(("own", "real"), [("dealer", zmq.DEALER), ("sub", zmq.XPUB)])
def test_client_names_foreign_programs_and_later_connects_to_the_real_peer(
    context: Context, stack: ExitStack, own: str, real: int
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    options = ("handshake_ms=50", "reconnect_ms=10")
    endpoint = f"tcp://127.0.0.1:{port}"
    if own == "dealer":
        client = started(stack, "dealer", endpoint, *options)
    else:
        client = started(stack, "sub", *options)
        client.say(f"connect {endpoint}")
        client.say(f"subscribe {TOPIC.hex()}")
    for said, start in foreign_programs(own):
        with closing(start(port)) as foreign:
            eventually(lambda said=said: client.ask("problem").startswith(f"problem {said}"))
            if isinstance(foreign, ForeignServer):  # libzmq doesn't report accepted connections
                eventually(lambda accepted=foreign.accepted: len(accepted) > 2)
    with context.socket(real) as found:
        found.bind(endpoint)
        found.rcvtimeo = int(LONG_S * 1000)
        if own == "dealer":
            assert client.line() == "connected"
        else:
            assert found.recv() == b"\1" + TOPIC
        assert client.ask("problem") == "problem "


@pytest.mark.parametrize(
    "answer",
    [b"", GREETING + READY.replace(b"\x03SUB", b"\x03PUB")],
    ids=["at once", "after the handshake"],
)
def test_backoff_grows_while_a_program_closes_each_connection(stack: ExitStack, answer: bytes) -> None:
    foreign = ForeignServer(0, answer, waits=False)
    stack.callback(foreign.close)
    sub = started(stack, "sub")
    began = time.monotonic()
    sub.say(f"connect tcp://127.0.0.1:{foreign.port}")
    eventually(lambda: len(foreign.accepted) >= 5)
    assert time.monotonic() - began >= (0.05 + 0.1 + 0.2 + 0.4) * 7 / 8


def test_silent_peer_is_disconnected_and_responsive_peer_stays_connected(context, stack: ExitStack) -> None:
    with context.socket(zmq.DEALER) as peer, socket.create_server(("127.0.0.1", 0)) as silent:
        port = peer.bind_to_random_port("tcp://127.0.0.1")
        kept = started(stack, "dealer", f"tcp://127.0.0.1:{port}", "heartbeat_ms=400")
        left = started(stack, "dealer", f"tcp://127.0.0.1:{silent.getsockname()[1]}", "heartbeat_ms=400")
        with silent.accept()[0] as connection:
            connection.sendall(GREETING + READY.replace(b"\x19", b"\x1c").replace(b"\x03SUB", b"\x06DEALER"))
            assert [left.line(), left.line()] == ["connected", "disconnected"]
        assert kept.line() == "connected"
        assert kept.ask("refused") == "refused "  # no other event was reported in between


def test_publishers_with_mutated_bytes_do_not_stop_the_subscriber(context, stack: ExitStack) -> None:
    sub = started(stack, "sub", "handshake_ms=200")
    sub.say(f"subscribe {TOPIC.hex()}")
    chance = random.Random(27)
    ready = READY.replace(b"\x03SUB", b"\x03PUB")
    good = GREETING + ready + b"\x01\x08" + TOPIC + b"\x01\x04head\x00\x04body\x02" + bytes(7) + b"\x01x"
    with socket.create_server(("127.0.0.1", 0)) as server:
        for _ in range(60):
            sub.say(f"connect tcp://127.0.0.1:{server.getsockname()[1]}")
            bad = bytearray(good)
            for _ in range(chance.randrange(1, 6)):
                bad[chance.randrange(len(bad))] = chance.randrange(256)
            with server.accept()[0] as connection:
                connection.sendall(bad[: chance.randrange(1, len(bad) + 1)])
    publisher, endpoint = bound(context, zmq.XPUB)
    with publisher:
        sub.say(f"connect {endpoint}")
        assert publisher.recv() == b"\1" + TOPIC
        publisher.send_multipart([TOPIC, b"alive"])
        while sub.line() != f"message {TOPIC.hex()} {b'alive'.hex()}":
            pass
    sub.say("refused")
    while not (lines := sub.line()).startswith("refused"):
        pass
    assert "unexpected" not in lines
