"""Tests with real processes that are started, killed, suspended and ended at critical moments."""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from time import monotonic

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import GREETINGS_S, MASTER, eventually, running

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="uses POSIX signals")

COLLECT = """
import sys, nep
node = nep.node("collector" + sys.argv[2])
sub = node.new_sub(sys.argv[1])
print("ready")
wanted = int(sys.argv[3])
got = [sub.listen(timeout_s=30.0)[1] for _ in range(wanted)]
print(got)
"""

PUBLISH = """
import sys, nep
node = nep.node("publisher")
pub = node.new_pub(sys.argv[1], latched=True)
pub.publish({"n": 1})
print("ready")
sys.stdin.readline()
"""

ECHO = """
import sys, nep
node = nep.node("sleeper")
pub = node.new_pub(sys.argv[1])
print("ready")
for line in sys.stdin:
    pub.publish(line.strip())
"""


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("tester") as made:
        yield made


@pytest.mark.usefixtures("patient")
def test_first_message_reaches_every_process(node: nep.Node) -> None:
    with ExitStack() as stack:
        programs = [stack.enter_context(running(COLLECT, "topic", str(n), "40")) for n in range(4)]
        assert [program.line() for program in programs] == ["ready"] * 4
        for n in range(40):
            with node.new_pub("topic") as pub:
                assert (pub.subscribers, pub.missing) == (4, ())
                assert len(pub.subscriber_ids) == 4
                pub.publish(n)
        with node.new_pub("topic") as pub:
            assert pub.subscriber_ids == {each.id for each in node.graph().topics["topic"].subscribers}
        for program in programs:
            assert json.loads(program.line()) == list(range(40))


def test_new_process_receives_the_next_message(node: nep.Node) -> None:
    pub = node.new_pub("topic")
    for n in range(3):
        with running(COLLECT, "topic", str(n), "1") as program:
            assert program.line() == "ready"
            pub.publish(n)
            assert program.line() == f"[{n}]"
            program.end()


def test_killed_publisher_is_removed_from_the_graph(node: nep.Node) -> None:
    sub = node.new_sub("topic")
    with running(PUBLISH, "topic") as program:
        program.line()
        assert sub.listen(timeout_s=30.0) == (True, {"n": 1})
        assert len(node.graph().topics["topic"].publishers) == 1
        program.signal(signal.SIGKILL)
        eventually(lambda: not node.graph().topics["topic"].publishers)
        eventually(lambda: {each.name for each in node.graph().nodes.values()} == {"tester"})


def test_restarted_publisher_is_received(node: nep.Node) -> None:
    sub = node.new_sub("topic")
    for _ in range(2):
        with running(PUBLISH, "topic") as program:
            program.line()
            assert sub.listen(timeout_s=30.0) == (True, {"n": 1})
            program.signal(signal.SIGKILL)
            program.end()
    assert sub.lost == 0


@pytest.mark.usefixtures("patient")
def test_killed_subscriber_does_not_delay_a_new_publisher(node: nep.Node) -> None:
    with running(COLLECT, "topic", "0", "1") as program:
        program.line()
        program.signal(signal.SIGKILL)
        program.end()
        started = monotonic()
        pub = node.new_pub("topic")
        assert monotonic() - started < GREETINGS_S
        assert (pub.subscribers, pub.missing) == (0, ())


@pytest.mark.usefixtures("patient")
def test_killed_publisher_does_not_delay_a_new_subscriber(node: nep.Node) -> None:
    with running(PUBLISH, "topic") as program:
        program.line()
        program.signal(signal.SIGKILL)
        program.end()
        started = monotonic()
        node.new_sub("topic")
        assert monotonic() - started < GREETINGS_S


def test_hung_subscriber_delays_the_first_publisher_once_and_is_reported(
    request: pytest.FixtureRequest,
) -> None:
    with (
        Master("127.0.0.1:0", learn_s=0.0, lease_s=60.0) as master,  # the hung node must stay registered
        nep.node("tester", master=master.address) as node,
        running(COLLECT, "topic", "0", "2", NEP_MASTER=master.address) as program,
    ):
        program.line()
        program.stop()
        started = monotonic()
        pub = node.new_pub("topic")
        assert monotonic() - started > 0.4
        assert pub.missing == ("collector0",)
        eventually(lambda: any(alert.id.startswith("missing:") for alert in node.graph().alerts))
        request.getfixturevalue("patient")
        started = monotonic()
        again = node.new_pub("topic")
        assert monotonic() - started < GREETINGS_S
        assert again.missing == ("collector0",)
        program.signal(signal.SIGCONT)
        eventually(lambda: pub.subscribers == again.subscribers == 1)
        assert pub.missing == ()
        pub.publish(1)
        again.publish(2)
        assert sorted(json.loads(program.line())) == [1, 2]
        eventually(lambda: not node.graph().alerts)


def test_suspended_publisher_is_unlisted_but_stays_connected(node: nep.Node) -> None:
    code = """
    import nep, sys
    pub = nep.node("p").new_pub("topic")
    print("ready")
    for line in sys.stdin:
        pub.publish(line.strip())
    """
    sub = node.new_sub("topic")
    with running(code) as program:
        program.line()
        program.say("one")
        assert sub.listen(timeout_s=30.0) == (True, "one")
        program.stop()
        eventually(lambda: not node.graph().topics["topic"].publishers)
        program.say("two")
        program.signal(signal.SIGCONT)
        assert sub.listen(timeout_s=30.0) == (True, "two")
        eventually(lambda: bool(node.graph().topics["topic"].publishers))
        assert sub.lost == 0


@pytest.mark.usefixtures("patient")
def test_killed_master_under_traffic_loses_no_messages(monkeypatch: pytest.MonkeyPatch) -> None:
    with ExitStack() as stack:
        first = stack.enter_context(running(MASTER, "127.0.0.1:0"))
        address = first.line()
        monkeypatch.setenv("NEP_MASTER", address)
        made = [stack.enter_context(nep.node(f"n{n}")) for n in range(3)]
        subs = [each.new_sub("traffic", max_messages=100_000) for each in made[:2]]
        pub = made[2].new_pub("traffic")
        stop = threading.Event()

        def work() -> None:
            while not stop.wait(0.001):
                pub.publish(pub.count)

        thread = threading.Thread(target=work)
        thread.start()
        try:
            epoch = made[0].graph().epoch
            first.signal(signal.SIGKILL)
            first.end()
            with pytest.raises(nep.MasterUnreachable, match="start one with 'nep master'"):
                made[0].graph(0.3)
            second = stack.enter_context(running(MASTER, address))
            second.line()
            eventually(
                lambda: {each.name for each in made[0].graph(30.0).nodes.values()} == {"n0", "n1", "n2"}
            )
            topic = made[0].graph().topics["traffic"]
            assert (len(topic.publishers), len(topic.subscribers)) == (1, 2)
            assert made[0].graph().epoch != epoch
            # A new publisher knows the subscribers that rejoined: its first message arrives.
            late = made[2].new_pub("traffic")
            assert late.subscribers == 2
            late.publish("late")
        finally:
            stop.set()
            thread.join()
        for sub in subs:
            got = []
            while len(got) < pub.count + 1:
                ok, value = sub.listen(timeout_s=30.0)
                assert ok
                got.append(value)
            got.remove("late")
            assert got == list(range(pub.count))
            assert sub.lost == 0


def test_interpreter_exit_delivers_queued_large_messages(node: nep.Node) -> None:
    code = """
    import nep
    import nep.nodes.node as nodes
    nodes.FLUSH_TIMEOUT_S = 50.0
    pub = nep.node("p").new_pub("topic", "bytes")
    for n in range(20):
        pub.publish(bytes([n]) * 4_000_000)
    """
    sub = node.new_sub("topic", "bytes")
    with running(code) as program:
        got = [sub.listen(timeout_s=30.0) for _ in range(20)]
        assert program.end() == ("", "")
        assert program.process.returncode == 0
    assert [(ok, value[0], len(value)) for ok, value in got] == [  # type: ignore[index,arg-type]
        (True, n, 4_000_000) for n in range(20)
    ]
    eventually(lambda: "p" not in {each.name for each in node.graph().nodes.values()})


def test_interpreter_exit_with_an_empty_queue_does_not_wait_for_the_flush_timeout(master: Master) -> None:
    code = """
    import nep, time
    import nep.nodes.node as nodes
    nodes.FLUSH_TIMEOUT_S = 50.0
    node = nep.node("p")
    pub, sub = node.new_pub("topic"), node.new_sub("topic")
    pub.publish(1)
    assert sub.listen(timeout_s=30.0) == (True, 1)
    print(time.monotonic())
    """
    with running(code) as program:
        closing_at = float(program.line())
        assert program.end(50.0) == ("", "")
        assert monotonic() - closing_at < 50.0


def test_undelivered_messages_are_reported_at_exit(master: Master) -> None:
    code = """
    import nep, sys
    pub = nep.node("p").new_pub("topic", "bytes")
    print("ready")
    sys.stdin.readline()
    for n in range(20):
        pub.publish(bytes(4_000_000))
    """
    with running(COLLECT, "topic", "0", "20") as hung:
        hung.line()
        with running(code) as program:
            program.line()
            hung.stop()
            started = monotonic()
            program.say("go")
            _out, error = program.end()
            assert monotonic() - started > 1.9
    assert "closed before 1 subscriber(s) received everything: up to 20 messages not delivered" in error


def test_ctrl_c_interrupts_a_blocking_listen(master: Master) -> None:
    code = """
    import nep
    node = nep.node("p")
    sub = node.new_sub("topic")
    try:
        print("ready")
        sub.listen(True)
    except KeyboardInterrupt:
        print("interrupted")
    """
    with running(code) as program:
        program.line()
        program.signal(signal.SIGINT)
        assert program.line() == "interrupted"
        program.end()
        assert program.process.returncode == 0


def test_new_pub_without_a_master_raises_an_error_with_the_command_to_start_a_master(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")
    with nep.node("n", wait_s=0.2) as node:
        with pytest.raises(nep.MasterUnreachable) as caught:
            node.new_pub("topic")
        assert str(caught.value) == (
            "no master replied at '127.0.0.1:1' (waited 0.2 s); start one with 'nep master'"
        )
        with pytest.raises(nep.MasterUnreachable):
            node.new_sub("topic")


def test_unlimited_wait_ends_when_a_master_starts() -> None:
    with Master("127.0.0.1:0", learn_s=0.0) as probe:
        address = probe.address
    made: list[nep.Publisher] = []
    with nep.node("n", master=address, wait_s=None) as node:
        thread = threading.Thread(target=lambda: made.append(node.new_pub("topic")))
        thread.start()
        with Master(address, learn_s=0.0):
            thread.join(30.0)
            assert made


def test_suspended_process_registers_again_and_loses_no_messages(node: nep.Node) -> None:
    """The lease expires meanwhile; messages from before and after the suspension are all received."""
    sub = node.new_sub("topic")
    with running(ECHO, "topic") as program:
        program.line()
        program.say("before")
        assert sub.listen(timeout_s=30.0) == (True, "before")
        program.stop()
        eventually(lambda: not node.graph().topics["topic"].publishers)
        program.signal(signal.SIGCONT)
        program.say("after")
        assert sub.listen(timeout_s=30.0) == (True, "after")
        eventually(lambda: len(node.graph().topics["topic"].publishers) == 1)
        assert sub.lost == 0
