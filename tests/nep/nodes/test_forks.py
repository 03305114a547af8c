"""Tests of forks: the child's inherited nodes are closed, new nodes work, and the parent is not affected.

The programs really fork. A child that hangs is ended by an alarm after 60 s, which its parent reports.
"""

from __future__ import annotations

import re
import socket
import sys

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import eventually, running

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")

CHILD = """
import logging, os, signal, sys, threading, time, traceback
import nep

def child(do):
    '''Run `do` in a child that ends as a program ends; how it ended: 0, or its signal or error.'''
    pid = os.fork()
    if not pid:
        signal.alarm(60)
        threading.excepthook = sys.excepthook
        do()
        sys.exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])

def closed(do):
    try:
        do()
    except nep.ClosedError as error:
        assert error.is_forked
        return str(error)
    raise AssertionError("not closed")

def nodes_left(node):
    '''Return the number of nodes, at once if it is 1: of a busy program the lease may have expired.'''
    deadline = time.monotonic() + 30.0
    while len(node.graph().nodes) != 1 and time.monotonic() < deadline:
        node.spin(0.1)
    return len(node.graph().nodes)
"""


@pytest.mark.parametrize("transport", ["zeromq", "memory"])
def test_inherited_node_is_closed_in_a_forked_child_and_a_new_node_works(
    master: Master, transport: str
) -> None:
    code = (
        CHILD
        + """
node = nep.node("parent", sys.argv[1])
pub, sub = node.new_pub("topic"), node.new_sub("topic")
pub.publish(0)
node.new_callback("topic", "json", print)
node.new_sub("topic", sink=len)
waiting = node.new_sub("topic")
pub.publish("read ahead"); pub.publish("not read")
assert waiting.listen(timeout_s=30.0) == (True, "read ahead")
node.log.warning("hello")

def use():
    sentences = [closed(lambda: pub.publish(1)), closed(lambda: pub.publish_bytes(b"1")), closed(sub.listen),
        closed(waiting.listen), closed(lambda: sub.listen(True)), closed(lambda: sub.receive(30.0)),
        closed(node.spin), closed(lambda: node.spin(1.0)), closed(lambda: node.new_pub("x")),
        closed(lambda: node.new_sub("x")), closed(lambda: node.new_callback("x", "json", print)),
        closed(node.graph)]
    print(sentences[0])
    print(sentences[-1])
    assert list(sub) == []
    assert (pub.subscribers, pub.missing, sub.is_closed) == (0, (), True)
    node.log.warning("nobody hears this")
    node.stop_spin()
    for each in (pub, sub, waiting, node, node):
        each.close()
    with nep.node("child", sys.argv[1]) as mine:
        own, heard = mine.new_pub("own"), mine.new_sub("own")
        for payload in (1, "x" * 200_000):
            own.publish(payload)
            assert heard.listen(timeout_s=30.0) == (True, payload)
        mine.log.warning("the child is heard")
    left = nep.node("left open", sys.argv[1])
    left.new_pub("left").publish("x" * 200_000)

print(child(use))
pub.publish("after")
while sub.listen(timeout_s=30.0) != (True, "after"):
    pass
print(nodes_left(node))
"""
    )
    with running(code, transport) as program:
        assert program.line() == (
            "publisher 'topic' belongs to the parent process and can't be used after a fork; create a new "
            "node in the child process"
        )
        assert re.match("node 'parent' .* after a fork", program.line())
        assert program.line() == "0"
        assert program.line() == "1"
        assert program.end()[1] == ""


def test_forked_child_exits_cleanly_by_return_sys_exit_or_multiprocessing(master: Master) -> None:
    code = (
        CHILD
        + """
import gc, multiprocessing
node = nep.node("parent")
pub, sub = node.new_pub("topic"), node.new_sub("topic")

def collect():
    global node, pub, sub
    del node, pub, sub
    gc.collect()

def in_a_node():
    with node, pub, sub:
        sys.exit(0)

def target():
    try:
        pub.publish(1)
    except nep.ClosedError:
        with nep.node("worker") as worker:
            worker.new_pub("topic").publish("from the worker")

print(child(lambda: None), child(lambda: sys.exit(0)), child(collect), child(in_a_node))
print(child(lambda: print(child(target))))
context = multiprocessing.get_context("fork")
process = context.Process(target=target)
process.start()
process.join(60)
print(process.exitcode)
print([sub.listen(timeout_s=30.0)[1] for _ in range(2)])
pub.publish("still here")
print(sub.listen(timeout_s=30.0)[1], sub.lost)
"""
    )
    with running(code) as program:
        assert [program.line() for _ in range(5)] == [
            "0 0 0 0",
            "0",
            "0",
            "0",
            "['from the worker', 'from the worker']",
        ]
        assert program.line() == "still here 0"
        assert program.end()[1] == ""


@pytest.mark.parametrize("forks", [10, pytest.param(30, marks=pytest.mark.long)])
def test_fork_while_threads_use_the_node_does_not_deadlock(master: Master, forks: int) -> None:
    """Fork while threads publish, listen, spin, log and open nodes, so that any lock may be held."""
    code = (
        CHILD
        + """
node = nep.node("parent")
stop = threading.Event()
pub, sub = node.new_pub("topic"), node.new_sub("topic", max_messages=100)
node.new_callback("topic", "json", lambda _payload: None)

def forever(do):
    def run():
        while not stop.is_set():
            do()
    thread = threading.Thread(target=run)
    thread.start()
    return thread

def come_and_go():
    with nep.node("guest", wait_s=30.0) as guest:
        guest.new_pub("topic").publish("guest")

logging.getLogger().addHandler(node.log_handler)
logging.getLogger().addHandler(logging.NullHandler())
logging.getLogger().setLevel(logging.INFO)
threads = [forever(do) for do in (lambda: pub.publish("x" * 100_000), lambda: pub.publish(1),
    lambda: sub.listen(timeout_s=0.1), lambda: node.spin(0.1), lambda: node.log.info("x"), come_and_go)]

def use():
    logging.info("not heard")
    closed(lambda: pub.publish(1))
    closed(sub.listen)
    closed(lambda: node.spin(1.0))
    assert pub.missing == ()
    with nep.node("child") as mine:
        mine.new_pub("own").publish("x" * 100_000)

print([child(use) for _ in range(int(sys.argv[1]))])
stop.set()
for thread in threads:
    thread.join()
print(nodes_left(node))
"""
    )
    with running(code, str(forks)) as program:
        assert program.line() == str([0] * forks)
        assert program.line() == "1"
        assert program.end()[1] == ""


def test_callbacks_and_sinks_can_fork(master: Master) -> None:
    code = (
        CHILD
        + """
node = nep.node("parent")
ended = threading.Event()
codes = []

def callback(payload):
    codes.append(child(lambda: None))
    pid = os.fork()
    if not pid:
        signal.alarm(60)
        return  # and goes on spinning
    codes.append(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    node.stop_spin()

def sink(messages):
    pid = os.fork()
    if not pid:
        signal.alarm(60)
        return  # the only thread ends, and the child with it
    codes.append(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    ended.set()

node.new_callback("topic", "json", callback)
pub = node.new_pub("topic")
pub.publish(1)
try:
    node.spin()
except nep.ClosedError as error:
    assert error.is_forked
    sys.exit(7)
sub = node.new_sub("topic", sink=sink)
pub.publish(2)
assert ended.wait(60)
print(codes)
"""
    )
    with running(code) as program:
        assert program.line() == "[0, 7, 0]"
        assert program.end()[1] == ""


def test_long_lived_child_holds_no_port_or_connection_of_its_parent(master: Master) -> None:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    code = (
        CHILD
        + """
node, own = nep.node("parent"), nep.master("127.0.0.1:0", learn_s=0.0).start()
pub, sub = node.new_pub("here"), node.new_sub("there")
direct = node.new_pub("direct", "json", node.direct(port=sys.argv[1], mode="one2many"))
print("ready")
sys.stdin.readline()
waits, ends = os.pipe()
pid = os.fork()
if not pid:
    signal.alarm(60)
    os.close(ends)
    closed(own.view)
    own.close()
    print("child")
    os.read(waits, 1)  # until the parent ends it
    os._exit(0)
sys.stdin.readline()
sub.close()
own.close()
direct.close()
nep.master(own.address, learn_s=0.0).start().close()
node.new_pub("direct", "json", node.direct(port=sys.argv[1], mode="one2many"))
print("bound again")
sys.stdin.readline()
os.close(ends)
print(os.waitpid(pid, 0)[1])
"""
    )
    with (
        nep.node("peer") as node,
        node.new_pub("there") as pub,
        node.new_sub("here"),
        running(code, str(port)) as program,
    ):
        assert program.line() == "ready"
        eventually(lambda: pub.subscribers == 1)
        program.say("fork")
        assert program.line() == "child"
        assert pub.subscribers == 1
        program.say("close")
        assert program.line() == "bound again"
        eventually(lambda: pub.subscribers == 0)  # the connection ended with the parent's socket
        program.say("end")
        assert program.line() == "0"
        assert program.end()[1] == ""


def test_last_message_of_a_multiprocessing_worker_is_delivered(master: Master) -> None:
    code = """
import multiprocessing, sys, nep

def work(number):
    pub = nep.node(f"worker {number}").new_pub("done")
    for part in range(200):
        pub.publish({"part": part, "long": "x" * 20_000})
    if number:
        sys.exit(number)

node = nep.node("parent")
sub = node.new_sub("done")
for number in range(3):
    child = multiprocessing.get_context("fork").Process(target=work, args=(number,))
    child.start()
    child.join(60)
    parts = [sub.receive(30.0).payload["part"] for _ in range(200)]
    assert (parts, child.exitcode) == (list(range(200)), number)
assert sub.lost == 0
print("all", flush=True)
"""
    with running(code) as program:
        assert program.line() == "all"
        assert program.end()[1] == ""


def test_fork_keeps_blocking_mode_of_parent_sockets(master: Master) -> None:
    """Also with a default timeout, as set by rospy: parent and child share the blocking mode of a socket."""
    code = (
        CHILD
        + """
import fcntl, socket
node = nep.node("parent")
node.new_pub("topic")
listening = socket.socket()
listening.bind(("127.0.0.1", 0))
listening.listen()
socket.setdefaulttimeout(60.0)
def own():
    assert socket.getdefaulttimeout() == 60.0
assert child(own) == 0
print(bool(fcntl.fcntl(listening.fileno(), fcntl.F_GETFL) & os.O_NONBLOCK))
node.close()
"""
    )
    with running(code, NEP_MASTER=master.address) as program:
        assert program.line() == "False"
        assert program.end() == ("", "")


@pytest.mark.parametrize("transport", ["zeromq", "memory"])
def test_child_of_a_sink_ends_with_the_sink(master: Master, transport: str) -> None:
    code = (
        CHILD
        + """
node = nep.node("parent", sys.argv[1])
ended = threading.Event()
codes = []

def sink(messages):
    pid = os.fork()
    if not pid:
        signal.alarm(60)
        return  # the only thread ends, and the child with it
    codes.append(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    ended.set()

subs = [node.new_sub("topic", sink=sink), node.new_sub("topic", sink=len)]
node.new_pub("topic").publish(1)
assert ended.wait(60)
print(codes)
"""
    )
    with running(code, transport) as program:
        assert program.line() == "[0]"
        assert program.end()[1] == ""


def test_callback_can_fork_while_several_nodes_spin(master: Master) -> None:
    code = (
        CHILD
        + """
nodes = [nep.node("a"), nep.node("b")]
codes = []

def callback(payload):
    pid = os.fork()
    if not pid:
        signal.alarm(60)
        return  # and goes on spinning
    codes.append(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    for node in nodes:
        node.stop_spin()

for node in nodes:
    node.new_callback("topic", "json", callback)
nodes[0].new_pub("topic").publish(1)
try:
    nep.spin(*nodes)
except nep.ClosedError as error:
    assert error.is_forked
    sys.exit(7)
print(set(codes))
"""
    )
    with running(code) as program:
        assert program.line() == "{7}"
        assert program.end()[1] == ""


def test_server_callback_can_fork_and_only_the_parent_replies(master: Master) -> None:
    code = (
        CHILD
        + """
node = nep.node("parent")
codes = []

def answer(request):
    pid = os.fork()
    if not pid:
        signal.alarm(60)
        return {"from": "child"}
    codes.append(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    return {"from": "parent"}

node.new_server("who", answer, threads=1)
client = node.new_client("who", timeout_s=30.0)
print(client.call({}), codes)
"""
    )
    with running(code) as program:
        assert program.line() == "{'from': 'parent'} [0]"
        assert program.end()[1] == ""


def test_locks_are_renewed_in_the_child_and_in_the_grandchild() -> None:
    code = (
        CHILD
        + """
from nep.system import forks

class Shared:
    def __init__(self):
        self.renew()

    def renew(self):
        self.lock = threading.Lock()
        forks.call_in_child(self.renew)

shared = Shared()

def use(depth):
    print(shared.lock.acquire(blocking=False))
    if depth:
        print(child(lambda: use(depth - 1)))

use(2)
"""
    )
    with running(code) as program:
        assert [program.line() for _ in range(5)] == ["True", "True", "True", "0", "0"]
        assert program.end()[1] == ""


def test_timer_is_cancelled_in_the_child_and_continues_in_the_parent(master: Master) -> None:
    code = (
        CHILD
        + """
node = nep.node("parent")
ticks = []
timer = node.new_timer(0.01, lambda: (ticks.append(1), node.stop_spin()))

def use():
    print(timer.is_cancelled, flush=True)
    timer.cancel()

print(child(use), timer.is_cancelled)
node.spin(30.0)
print(ticks)
"""
    )
    with running(code) as program:
        assert [program.line() for _ in range(3)] == ["True", "0 False", "[1]"]
        assert program.end()[1] == ""
