"""Tests of closing nodes, publishers and subscribers in any order and from any thread, without leaks."""

from __future__ import annotations

import gc
import signal
import threading
import time
import weakref
from collections.abc import Callable, Iterator

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import eventually, running


@pytest.fixture(params=["zeromq", "memory"])
def node(request: pytest.FixtureRequest, master: Master) -> Iterator[nep.Node]:
    with nep.node("n", request.param) as made:
        yield made


def test_spin_idles_after_its_callbacks_are_closed(node: nep.Node) -> None:
    node.new_callback("topic", "json", lambda _payload: None).close()
    with node.new_callback("topic", "json", lambda _payload: None):
        pass
    began, used = time.monotonic(), time.thread_time()
    node.spin(0.5)
    share = (time.thread_time() - used) / (time.monotonic() - began)
    assert share < 0.2  # was 1.0 before the fix


def test_callback_can_close_its_own_and_another_subscriber(node: nep.Node) -> None:
    got: list[object] = []

    def callback(payload: object) -> None:
        got.append(payload)
        first.close()
        second.close()
        node.stop_spin()

    first = node.new_callback("topic", "json", callback)
    second = node.new_callback("topic", "json", callback)
    pub = node.new_pub("topic")
    pub.publish(1)
    pub.publish(2)
    node.spin(30.0)
    node.spin(0.05)
    assert got == [1]


def test_closed_publishers_and_subscribers_are_garbage_collected(node: nep.Node) -> None:
    kept = node.new_pub("topic", latched=True)
    kept.publish(1)
    gone = []
    for _ in range(3):
        pub, sub = node.new_pub("topic"), node.new_sub("topic")
        called = node.new_callback("topic", "json", print)
        for each in (pub, sub, called):
            gone.append(weakref.ref(each))
            each.close()
        del pub, sub, called, each
    gc.collect()
    assert [ref() for ref in gone if ref() is not None] == []
    assert node.new_sub("topic").listen(timeout_s=30.0) == (True, 1)


CYCLES = """
import gc, os, sys, threading
import nep
import psutil

process = psutil.Process()

def tell():
    gc.collect()
    files = len(os.listdir("/proc/self/fd"))
    print(process.memory_info().rss, files, threading.active_count(), process.num_threads())

def cycle(times):
    for n in range(times):
        with nep.node("n") as node:
            pub, sub = node.new_pub("topic"), node.new_sub("topic")
            pub.publish("x" * 1000)
            assert sub.listen(timeout_s=30.0)[0]
def reopen(times):
    for n in range(times):
        with held.new_pub("other") as pub, held.new_sub("other"), held.new_callback("other", "json", print):
            pub.publish(n)

held = nep.node("held") if sys.argv[1] == "held" else None
do = reopen if held else cycle
do(50)
tell()
do(int(sys.argv[2]))
tell()
"""


@pytest.mark.parametrize("what", ["held", "all"])
def test_repeated_open_and_close_leaks_no_resources(master: Master, what: str) -> None:
    with running(CYCLES, what, "200") as program:
        before = [int(word) for word in program.line().split()]
        after = [int(word) for word in program.line().split()]
        assert after[1] <= before[1] + 3  # libzmq closes sockets asynchronously
        assert after[2:] == before[2:]
        assert after[0] - before[0] < 4 * 2**20


def until_closed(do: Callable[[], object], begun: threading.Barrier, errors: list[BaseException]) -> None:
    begun.wait()
    try:
        while True:
            do()
    except nep.ClosedError:
        pass
    except BaseException as error:  # noqa: BLE001 - shown by the test
        errors.append(error)


def test_close_during_concurrent_publish_listen_and_spin_raises_closed_error_without_hang(
    node: nep.Node,
) -> None:
    pub, sub = node.new_pub("topic"), node.new_sub("topic")
    node.new_callback("topic", "json", lambda _payload: None)

    def make() -> None:
        with node.new_pub("other"), node.new_sub("other"):
            node.graph()

    def work() -> None:
        pub.publish("x" * 100)

    errors: list[BaseException] = []
    whats: list[Callable[[], object]] = [work, lambda: sub.listen(True), make]
    begun = threading.Barrier(len(whats) + 2)
    threads = [threading.Thread(target=until_closed, args=(what, begun, errors)) for what in whats]
    spinning = threading.Thread(target=lambda: (begun.wait(), node.spin()))
    for thread in (*threads, spinning):
        thread.start()
    begun.wait()
    eventually(lambda: pub.count > 200)
    node.close()
    for thread in (*threads, spinning):
        thread.join(20.0)
        assert not thread.is_alive()
    assert errors == []


def test_blocked_sink_of_one_node_does_not_block_other_nodes(master: Master) -> None:
    """While the sink of one node blocks, a third node opens, exchanges a message and closes."""
    held, let_go = threading.Event(), threading.Event()

    def sink(_messages: object) -> None:
        held.set()
        let_go.wait(20.0)

    with nep.node("slow") as slow, nep.node("other") as other:
        slow.new_sub("slow", sink=sink)
        other.new_pub("slow").publish(1)
        assert held.wait(30.0)
        try:
            with nep.node("third") as third:
                pub, sub = third.new_pub("topic"), third.new_sub("topic")
                pub.publish(1)
                assert sub.listen(timeout_s=30.0) == (True, 1)
                assert slow.graph().nodes  # its registration is still renewed
        finally:
            let_go.set()


def test_sink_can_create_publishers_and_subscribers_and_query_the_graph(node: nep.Node) -> None:
    done = threading.Event()
    made: list[object] = []

    def sink(_messages: object) -> None:
        answer = node.new_pub("answer")
        heard = node.new_sub("answer")
        answer.publish("sure")
        made.append((heard.listen(timeout_s=30.0), "topic" in node.graph().topics))
        made.append(answer.missing)
        done.set()

    node.new_sub("topic", sink=sink)
    node.new_pub("topic").publish(1)
    assert done.wait(30.0)
    assert made == [((True, "sure"), True), ()]


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="there are no signals that stop")
def test_all_nodes_flush_concurrently_at_interpreter_exit(master: Master) -> None:
    """The subscriber of the first node hangs; the messages of the second one must arrive nevertheless."""
    hung = """
    import sys, nep
    node = nep.node("hung")
    subs = node.new_sub("hung", "bytes"), node.new_sub("quiet", "bytes")
    print("ready")
    sys.stdin.readline()
    """
    code = """
    import sys, nep
    import nep.nodes.node as nodes
    nodes.FLUSH_TIMEOUT_S = 10.0  # 32 MB must arrive meanwhile
    first = nep.node("first").new_pub("hung", "bytes")
    second = nep.node("second").new_pub("pictures", "bytes")
    third = nep.node("third").new_pub("quiet", "bytes")
    print("ready")
    sys.stdin.readline()
    for n in range(8):
        first.publish(bytes(4_000_000))
        second.publish(bytes([n]) * 4_000_000)
    """
    with running(hung) as stuck, nep.node("n") as node, running(code) as program:
        stuck.line()
        sub = node.new_sub("pictures", "bytes")
        program.line()
        eventually(lambda: len(node.graph().topics["pictures"].publishers) == 1)
        stuck.stop()
        program.say("go")
        got = [sub.listen(timeout_s=30.0) for _ in range(8)]
        _out, error = program.end()
    assert [(ok, data[:1]) for ok, data in got] == [(True, bytes([n])) for n in range(8)]  # type: ignore[index]
    assert "'hung' was closed before 1 subscriber(s) received everything: up to 8 messages" in error
    assert "pictures" not in error
    assert "quiet" not in error, "nothing was sent there, so nothing is missing"


def test_unused_master_connections_beyond_a_limit_are_closed(master: Master) -> None:
    with nep.node("n") as node:
        pub = node.new_pub("topic")
        for port in range(1, 40):
            with pytest.raises(nep.MasterUnreachable):
                node._transport.graph(nep.Hybrid(f"127.0.0.1:{port}"), 0.01)
        assert len(node._transport._sessions) <= 8  # type: ignore[attr-defined]
        assert node.graph().topics["topic"].publishers[0].id == pub.id
