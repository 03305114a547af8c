"""Contract tests of back ends: several nodes, also of different back ends, that are spun together."""

from __future__ import annotations

import asyncio
import errno
import functools
import selectors
import sys
import threading
from collections.abc import Iterator

import pytest

import nep
from nep.masters.master import Master
from nep.nodes import shared_wait
from tests.nep.meeting import BACKENDS, place_for
from tests.nep.programs import eventually, running


class Nodes:
    """Factory of nodes of any back end on one network; they are closed at the end."""

    def __init__(self, master: Master) -> None:
        self._places = {each: place_for(each, master.address) for each in BACKENDS}
        self.made: list[nep.Node] = []

    def __call__(self, name: str, backend: str) -> nep.Node:
        node = nep.node(name, backend, master=self._places[backend])
        self.made.append(node)
        return node


@pytest.fixture
def make(master: Master, patient: None) -> Iterator[Nodes]:
    nodes = Nodes(master)
    yield nodes
    for node in nodes.made:
        node.close()


@pytest.mark.parametrize("backend", BACKENDS)
def test_nodes_of_one_back_end_spin_in_one_thread(make: Nodes, backend: str) -> None:
    nodes = [make(f"n{n}", backend) for n in range(3)]
    out = make("out", backend)
    got: list[tuple[int, object]] = []
    threads: set[int] = set()

    def callback(n: int, payload: object) -> None:
        threads.add(threading.get_ident())
        got.append((n, payload))
        if len(got) == 300:
            for each in nodes:
                each.stop_spin()

    for n, node in enumerate(nodes):
        node.new_callback(f"t{n}", "json", lambda payload, n=n: callback(n, payload))  # type: ignore[misc]
    pubs = [out.new_pub(f"t{n}") for n in range(3)]
    for number in range(100):
        for pub in pubs:
            pub.publish(number)
    nep.spin(*nodes)
    assert threads == {threading.get_ident()}
    for n in range(3):
        assert [payload for each, payload in got if each == n] == list(range(100))


def test_nodes_of_all_back_ends_exchange_messages_in_one_thread(make: Nodes) -> None:
    """A message passes through all back ends a hundred times; every hop must wake the waiting thread."""
    nodes = [make(f"n{n}", backend) for n, backend in enumerate(BACKENDS)]
    subs = []
    hops: list[int] = []
    pubs = [node.new_pub("in") for node in nodes]

    def callback(n: int, payload: int) -> None:
        hops.append(n)
        if payload == 400:
            for node in nodes:
                node.stop_spin()
        else:
            pubs[(n + 1) % len(pubs)].publish(payload + 1)

    for n, node in enumerate(nodes):
        subs.append(node.new_callback("in", "json", lambda payload, n=n: callback(n, payload)))  # type: ignore[misc]
    pubs[0].publish(0)
    nep.spin(*nodes, timeout_s=60.0)
    assert hops == [n % 4 for n in range(401)]


def test_spin_blocks_without_busy_waiting(make: Nodes, monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []
    real = shared_wait.SharedWait.wait

    def wait(self: shared_wait.SharedWait, timeout_s: float) -> list[object]:
        waits.append(timeout_s)
        return real(self, timeout_s)  # type: ignore[return-value]

    monkeypatch.setattr(shared_wait.SharedWait, "wait", wait)
    nodes = [make(f"n{n}", backend) for n, backend in enumerate(BACKENDS)]
    got: list[object] = []
    for node in nodes:
        node.new_callback("t", "json", got.append)
    nep.spin(*nodes, timeout_s=0.5)
    assert 1 <= len(waits) <= 20, "a slice is a tenth of a second, a publisher or two may have come"
    assert got == []


@pytest.mark.parametrize("backend", BACKENDS)
def test_stopped_node_leaves_the_spin_and_the_others_continue(make: Nodes, backend: str) -> None:
    first, second = make("first", backend), make("second", "memory" if backend != "memory" else "zeromq")
    ran: list[str] = []

    def tick() -> None:
        ran.append("second")
        if ran[-3:] == ["second"] * 3:
            second.stop_spin()

    def leave() -> None:
        ran.append("first")
        first.stop_spin()

    first.new_timer(0.001, leave)
    second.new_timer(0.002, tick)
    nep.spin(first, second)
    assert (ran.count("first"), ran[-3:]) == (1, ["second"] * 3)
    ran.clear()
    nep.spin(first, second, timeout_s=0.0)
    assert ran == [], "and the next spin is not stopped, only over"
    first.spin(30.0)
    assert ran == ["first"]


def test_servers_reply_to_calls_during_a_spin_of_several_nodes(
    make: Nodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wait that isn't woken lasts an hour, so a missing wake fails the test."""
    monkeypatch.setattr("nep.nodes.executor.WAIT_SLICE_S", 3600.0)
    nodes = [make("a", "zeromq"), make("b", "memory")]
    thread = threading.Thread(target=nep.spin, args=nodes)
    thread.start()
    for node, backend in zip(nodes, ("zeromq", "memory"), strict=True):
        node.new_server("double", lambda n: 2 * n)  # type: ignore[operator]
        client = make("client", backend).new_client("double", timeout_s=30.0)
        for n in range(20):
            assert client.call(n) == 2 * n
    for node in nodes:
        node.stop_spin()
    thread.join(30.0)
    assert not thread.is_alive()


@pytest.mark.parametrize("how", ["stop_spin", "close"])
def test_spin_ends_when_all_nodes_are_stopped_or_closed_by_other_threads(make: Nodes, how: str) -> None:
    nodes = [make(f"n{n}", backend) for n, backend in enumerate(BACKENDS)]
    spinning = threading.Event()
    for node in nodes:
        node.new_callback("t", "json", print)
    nodes[-1].new_timer(0.001, spinning.set)
    thread = threading.Thread(target=nep.spin, args=nodes)
    thread.start()
    assert spinning.wait(30.0)
    for node in nodes:
        assert thread.is_alive()
        getattr(node, how)()
    thread.join(30.0)
    assert not thread.is_alive()


def test_timers_and_callbacks_added_by_other_threads_run(make: Nodes) -> None:
    first, second = make("first", "zeromq"), make("second", "memory")
    spinning, got = threading.Event(), threading.Event()
    timer = first.new_timer(0.001, spinning.set)
    thread = threading.Thread(target=nep.spin, args=(first, second))
    thread.start()
    assert spinning.wait(30.0)
    timer.cancel()
    second.new_timer(0.001, second.stop_spin)
    first.new_callback("t", "json", lambda _payload: (got.set(), first.stop_spin()))
    make("out", "zeromq").new_pub("t").publish(1)
    assert got.wait(30.0)
    thread.join(30.0)
    assert not thread.is_alive()


def test_exception_in_a_callback_propagates_and_loses_no_other_message(make: Nodes) -> None:
    nodes = [make("a", "zeromq"), make("b", "memory")]
    got: list[object] = []

    def callback(payload: object) -> None:
        got.append(payload)
        if payload == "bad":
            raise ZeroDivisionError
        if len(got) == 4:
            nodes[0].stop_spin()
            nodes[1].stop_spin()

    for node in nodes:
        node.new_callback("t", "json", callback)
    pubs = [make("c", "zeromq").new_pub("t"), make("d", "memory").new_pub("t")]
    pubs[0].publish("bad")
    with pytest.raises(ZeroDivisionError):
        nep.spin(*nodes, timeout_s=30.0)
    for pub in pubs:
        pub.publish("good")
    pubs[0].publish("last")
    nep.spin(*nodes, timeout_s=30.0)
    assert sorted(map(str, got)) == ["bad", "good", "good", "last"]


def test_callback_can_close_its_node_and_spin_another(make: Nodes) -> None:
    first, second = make("first", "zeromq"), make("second", "zenoh")
    ran: list[str] = []

    def close() -> None:
        ran.append("close")
        first.close()

    def again() -> None:
        ran.append("again")
        timer.cancel()
        second.new_timer(0.001, second.stop_spin)
        second.spin(30.0)
        ran.append("inner ended")
        second.stop_spin()

    first.new_timer(0.001, close)
    timer = second.new_timer(0.005, again)
    nep.spin(first, second)
    assert ran == ["close", "again", "inner ended"]
    nep.spin(first, second, timeout_s=0.01)


def test_spin_rejects_invalid_nodes_and_timeouts(make: Nodes) -> None:
    node = make("a", "memory")
    for wrong in ((), (None,), (node, "b")):
        with pytest.raises(ValueError, match="'spin' requires at least one node"):
            nep.spin(*wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"timeout_s must be .*, not -1"):
        nep.spin(node, timeout_s=-1)
    node.new_timer(0.001, node.stop_spin)
    nep.spin(node, node)
    node.close()
    nep.spin(node, node)


def test_spin_rejects_coroutine_callback_without_losing_its_message(make: Nodes) -> None:
    node = make("a", "memory")
    got: list[object] = []

    async def callback(payload: object) -> None:
        got.append(payload)

    sub = node.new_callback("t", "json", callback)
    make("b", "memory").new_pub("t").publish(1)
    sentence = "the callback of 't' is a coroutine function, which 'spin' can't run"
    for spin in (node.spin, lambda: nep.spin(node, make("c", "memory"))):
        with pytest.raises(nep.NepError, match=sentence):
            spin()
    assert sub.listen() == (True, 1)
    timer = node.new_timer(1.0, functools.partial(callback, 1))
    sub.close()
    with pytest.raises(nep.NepError, match=r"the callback of 'Timer\(1.0\)' is a coroutine function"):
        node.spin()
    timer.cancel()
    node.spin(0.0)


def test_back_end_without_poll_support_is_polled_periodically(make: Nodes) -> None:
    """This includes third-party back ends that are older than `enter_wait`."""

    class Older:
        is_closed = False

    waits = shared_wait.SharedWait()
    older = Older()
    assert waits.arm(older)  # type: ignore[arg-type]
    assert waits.wait(60.0) == [older]
    older.is_closed = True
    assert not waits.arm(older)  # type: ignore[arg-type]
    waits.close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
def test_callback_can_fork(master: Master) -> None:
    code = """
    import os, sys, nep
    nodes = [nep.node("a"), nep.node("b", "memory")]
    def fork():
        pid = os.fork()
        if pid:
            print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
            timer.cancel()
            nodes[0].new_callback("t", "json", lambda n: (print(n), [each.stop_spin() for each in nodes]))
            nodes[0].new_pub("t").publish(7)
    timer = nodes[1].new_timer(0.001, fork)
    nodes[0].new_callback("u", "json", print)
    parent = os.getpid()
    try:
        nep.spin(*nodes)
    except nep.ClosedError as error:
        assert os.getpid() != parent and error.is_forked
        sys.exit(3)
    """
    with running(code) as program:
        assert program.line() == "3"
        assert program.line() == "7"
        assert program.end()[1] == ""


def test_two_threads_can_spin_the_same_nodes(make: Nodes) -> None:
    nodes = [make("a", "zeromq"), make("b", "memory")]
    got: list[object] = []
    lock = threading.Lock()

    def callback(payload: object) -> None:
        with lock:
            got.append(payload)

    for node in nodes:
        node.new_callback("t", "json", callback)
    threads = [threading.Thread(target=nep.spin, args=nodes) for _ in range(2)]
    for thread in threads:
        thread.start()
    pubs = [make("c", "zeromq").new_pub("t"), make("d", "memory").new_pub("t")]
    for n in range(500):
        pubs[n % 2].publish(n)
    eventually(lambda: len(got) == 500)
    for node in nodes:
        node.close()
    for thread in threads:
        thread.join(30.0)
    assert sorted(got) == list(range(500))  # type: ignore[type-var]


def test_spin_and_async_receive_at_the_open_file_limit_raise_too_many_files_error(
    make: Nodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    nodes = [make("a", "zeromq"), make("b", "memory")]

    def no_room() -> None:
        raise OSError(errno.EMFILE, "too many open files")

    monkeypatch.setattr(selectors, "DefaultSelector", no_room)
    with pytest.raises(nep.TooManyFilesError, match=r"waiting thread: .*files open"):
        nep.spin(*nodes)

    async def main() -> None:
        sub = nodes[1].new_sub("t")
        with pytest.raises(nep.TooManyFilesError, match=r"waiting thread: .*files open"):
            await sub.receive_async(0.01)
        monkeypatch.undo()
        assert await sub.receive_async(0.01) is None

    loop = asyncio.SelectorEventLoop(selectors.SelectSelector())
    try:
        loop.run_until_complete(main())
        loop.run_until_complete(loop.shutdown_asyncgens())
    finally:
        loop.close()


def test_descriptor_that_cannot_be_polled_is_checked_periodically(
    make: Nodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    sub = make("a", "zeromq").new_sub("t")
    waits = shared_wait.SharedWait()

    def register(*_args: object) -> None:
        raise OSError

    monkeypatch.setattr(type(waits._selector), "register", register)
    monkeypatch.setattr(type(waits._selector), "unregister", register)
    assert isinstance(waits._selector, selectors.BaseSelector)
    assert waits.arm(sub._transport)
    assert waits.wait(60.0) == [sub._transport]
    waits.close()
