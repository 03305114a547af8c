"""Tests of a blackboard that watches topics, over the memory and ZeroMQ back ends."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable, Iterator
from itertools import count

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import eventually, running

_names = count()
Make = Callable[[str], nep.Node]


@pytest.fixture(params=["memory", "zeromq"])
def make(request: pytest.FixtureRequest, master: Master, patient: None) -> Iterator[Make]:
    """Factory of nodes on one network; they are closed after the test."""
    made: list[nep.Node] = []
    where = f"blackboard-{next(_names)}" if request.param == "memory" else master.address

    def new(name: str) -> nep.Node:
        node = nep.node(name, request.param, master=where)
        made.append(node)
        return node

    yield new
    for node in made:
        node.close()


def test_published_values_are_stored_without_spinning(make: Make) -> None:
    board = nep.Blackboard(make("watcher"))
    watch = board.watch("/perception/humans", key="human", fields=["1", "2"])
    pub = make("camera").new_pub("/perception/humans", "json")
    pub.publish({"1": {"position": [1, 2]}, "noise": 5})
    assert board.wait_for("human.1.position", timeout_s=30.0) == [1, 2]
    pub.publish({"1": {"position": [3, 4]}, "2": {"name": "é"}})
    board.wait_for("human.1.position", lambda at: at == [3, 4], timeout_s=30.0)
    assert board["human"] == {"1": {"position": [3, 4]}, "2": {"name": "é"}}
    entry = board.entry("human.1.position")
    assert entry is not None
    assert (entry.age_by, entry.source) == ("stamp", "/perception/humans")
    assert board.age_s("human.1.position") < 60.0
    eventually(lambda: watch.received == 2)
    assert watch.refused == 0
    watch.close()
    pub.publish({"1": {"position": [5, 6]}})
    watch.close()
    assert board["human.1.position"] == [3, 4], "what came stays"


def test_rize_perceptions_are_stored(make: Make) -> None:
    board = nep.Blackboard(make("watcher"))
    board.watch("/blackboard")
    pub = make("pepper").new_pub("/blackboard", "json")
    pub.publish({"primitive": "touched", "input": {"head": 1}, "robot": "Pepper"})
    assert board.wait_for("touched.head", timeout_s=30.0) == 1
    entry = board.entry("touched.head")
    assert entry is not None
    assert entry.robot == "Pepper"


def test_invalid_messages_are_rejected_and_counted_and_valid_parts_are_stored(
    make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    board = nep.Blackboard(make("watcher"))
    watch = board.watch("/x", key="h.{id}")
    pub = make("camera").new_pub("/x", "json")
    bad = (
        b"{no json",
        b"",
        b"\xff\xfe",
        b"5",
        b"null",
        b'{"id": []}',
        b'[{"id": 3, "a": 1}, {"b": 2}]',
        b"[" * 10_000,
    )
    for data in bad:
        pub.publish_bytes(data)
    pub.publish_bytes(b'{"id": 1, "v": NaN, "' + b"x" * 2_000 + b'": 1, "w": 2}')
    pub.publish({"id": 2, "v": 1})
    board.wait_for("h.2.v", timeout_s=30.0)
    assert board["h.1.w"] == 2, "what can be kept of a message is kept"
    assert board["h.3.a"] == 1
    eventually(lambda: watch.refused == len(bad) + 1)
    assert watch.problem == ""
    assert "on '/x'" in caplog.text


def test_value_larger_than_the_byte_limit_is_rejected_and_others_are_stored(make: Make) -> None:
    board = nep.Blackboard(make("watcher"), max_bytes=2_000_000)
    watch = board.watch("/x", key="x")
    pub = make("camera").new_pub("/x", "json")
    pub.publish({"small": 1, "large": "x" * 8_000_000, "last": 2})
    board.wait_for("x.last", timeout_s=60.0)
    assert board["x"] == {"small": 1, "last": 2}
    eventually(lambda: watch.refused == 1)
    assert re.match(r"'x\.large' .* 2000000 ", watch.problem)


def test_wildcard_watch_stores_values_of_two_publishers(make: Make) -> None:
    board = nep.Blackboard(make("watcher"))
    board.watch("/robot/*/touch")
    one, two = make("one").new_pub("/robot/a/touch"), make("two").new_pub("/robot/b/touch")
    one.publish({"head": 1})
    two.publish({"head": 0})
    board.wait_for("robot.b.touch.head", timeout_s=30.0)
    board.wait_for("robot.a.touch.head", timeout_s=30.0)
    assert board["robot"] == {"a": {"touch": {"head": 1}}, "b": {"touch": {"head": 0}}}
    same = nep.Blackboard(make("same"))
    same.watch("/robot/*/touch", key="touch")
    for number in range(100):
        one.publish({"one": number, "head": number})
        two.publish({"two": number, "head": number})
    same.wait_for("touch", lambda all_: (all_.get("one"), all_.get("two")) == (99, 99), timeout_s=30.0)  # type: ignore[attr-defined]
    assert same["touch.head"] == 99


def test_change_callbacks_run_in_the_spinning_thread(make: Make) -> None:
    node = make("watcher")
    board = nep.Blackboard(node)
    board.watch("/touch", key="touched", lives_s=2.0)
    seen: list[tuple[str, object, str]] = []

    def callback(change: nep.BlackboardChange) -> None:
        seen.append((change.cause, change.value, threading.current_thread().name))
        if change.is_gone:
            node.stop_spin()

    board.on_change("touched.*", callback)
    make("camera").new_pub("/touch").publish({"head": 1})
    board.wait_for("touched.head", timeout_s=30.0)
    assert seen == []
    node.spin(timeout_s=60.0)
    own = threading.current_thread().name
    assert seen == [("new", 1, own), ("expired", None, own)]


def test_exception_in_a_callback_propagates_from_spin(make: Make) -> None:
    node = make("watcher")
    board = nep.Blackboard(node)
    seen: list[object] = []

    def callback(change: nep.BlackboardChange) -> None:
        if change.value == 1:
            raise ZeroDivisionError
        seen.append(change.value)
        node.stop_spin()

    board.on_change("x", callback)
    board.put("x", 1)
    board.put("x", 2)
    with pytest.raises(ZeroDivisionError):
        node.spin(timeout_s=60.0)
    node.spin(timeout_s=60.0)
    assert seen == [2]


def test_closed_node_wakes_a_waiting_thread(make: Make) -> None:
    node = make("watcher")
    board = nep.Blackboard(node)
    board.watch("/x")
    waits, raised = threading.Event(), threading.Event()

    def wait() -> None:
        try:
            board.wait_for("y", lambda _value: waits.set())
        except nep.ClosedError:
            raised.set()

    board.put("y", 1)
    board.on_change("**", lambda _change: None)
    thread = threading.Thread(target=wait)
    thread.start()
    assert waits.wait(60.0)
    node.close()
    thread.join(60.0)
    assert raised.is_set()
    board.put("y", 2)
    assert board["y"] == 2
    with pytest.raises(nep.ClosedError):
        board.watch("/z")
    board.close()


def test_invalid_watches_are_rejected(make: Make) -> None:
    board = nep.Blackboard(make("watcher"))
    with pytest.raises(nep.BadTopicError):
        board.watch("")
    with pytest.raises(nep.BadKeyError):
        board.watch("/x", key="")
    with pytest.raises(ValueError, match="lives_s"):
        board.watch("/x", lives_s=0)
    with pytest.raises((TypeError, ValueError)):
        board.watch(5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="msg_type is empty"):
        board.watch("/x", "")
    assert board._watches == ()
    with board:
        pass
    with pytest.raises(nep.ClosedError):
        board.watch("/x")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows does not fork")
def test_forked_child_keeps_values_but_has_no_watches(master: Master) -> None:
    code = """
    import os, threading, nep
    node = nep.node("robot")
    board = nep.Blackboard(node)
    board.watch("/x")
    board.on_change("**", lambda change: None)
    node.new_pub("/x").publish({"a": 1})
    board.wait_for("x.a", timeout_s=30.0)
    ending = threading.Event()
    def write():
        while not ending.is_set():
            board.put("busy", {"n": {"m": ending.is_set()}})
            board.remove("busy")
    thread = threading.Thread(target=write)
    thread.start()
    codes = []
    for number in range(20):
        pid = os.fork()
        if not pid:
            board.put("own", 2)
            ok = board["x.a"] == 1 and board["own"] == 2
            board.put("busy", 1)
            ok = ok and board["busy"] == 1
            for call in (lambda: board.watch("/y"), lambda: board.wait_for("never", timeout_s=30.0)):
                try:
                    call()
                    ok = False
                except nep.ClosedError as error:
                    ok = ok and error.is_forked
            board.close()
            os._exit(0 if ok else 4)
        codes.append(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    ending.set()
    thread.join()
    print(set(codes), "own" in board)
    """
    with running(code) as program:
        assert program.line() == "{0} False"
        assert program.end()[1] == ""
