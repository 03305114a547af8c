"""Tests of programs at their open-file limit: a clear error, no crash in libzmq, and nothing half created."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import psutil
import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import Program, eventually, running

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")

FEW = """
import os, resource, sys
import nep

def refused(do):
    try:
        do()
    except nep.TooManyFilesError as error:
        return str(error)
    raise AssertionError("there was room")
"""


def test_new_publishers_are_rejected_at_the_open_file_limit_and_existing_ones_work(master: Master) -> None:
    code = (
        FEW
        + """
resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
node = nep.node("many")
pubs = []
def more():
    while True:
        pubs.append(node.new_pub(f"t{len(pubs)}"))
print(refused(more))
print(len(pubs))
refused(lambda: node.new_sub("t0"))
refused(lambda: node.new_callback("t0", "json", print))
refused(lambda: nep.node("another").new_pub("x"))
refused(lambda: nep.master("127.0.0.1:0").start())
refused(lambda: nep.is_running())
print(sorted(node.graph().topics) == sorted(f"t{n}" for n in range(len(pubs))))
for pub in pubs[10:20]:
    pub.close()
sub = node.new_sub("t0")
pubs[0].publish("there")
print(sub.listen(timeout_s=30.0))
"""
    )
    with running(code) as program:
        sentence, count = program.line(), int(program.line())
        assert sentence.startswith(f"can't create a publisher of 't{count}': this program has 2")
        assert sentence.endswith(
            " of 256 files open; close unused nodes and files, "
            "or raise the limit with 'ulimit -n 8192' before you start it"
        )
        assert count > 60
        assert program.line() == "True"
        assert program.line() == "(True, 'there')"
        assert program.end()[1] == ""
        assert program.process.returncode == 0


def test_existing_endpoints_survive_without_free_file_descriptors(master: Master) -> None:
    """The program itself has used all its descriptors."""
    code = (
        FEW
        + """
import gc, threading
resource.setrlimit(resource.RLIMIT_NOFILE, (128, 128))
node = nep.node("full")
pub, sub = node.new_pub("own"), node.new_sub("own")
taken = []
try:
    while True:
        taken.append(os.dup(0))
except OSError:
    pass
for do in (lambda: node.new_pub("x"), lambda: node.new_sub("x"), lambda: nep.node("y").new_pub("x"),
           lambda: nep.master("127.0.0.1:0").start(), lambda: sub.listen(timeout_s=0.01)):
    refused(do)
pub.publish(1)
while not (got := sub.listen())[0]:
    pass
print(got)
print("ready")
for line in sys.stdin:
    pub.publish(line.strip())
    break
for number in taken:
    os.close(number)
print(sub.listen(timeout_s=30.0)[0])
print(node.new_sub("own").listen(), [each for each in node.graph().topics])
"""
    )
    with nep.node("peer") as node, running(code) as program:
        assert program.line() == "(True, 1)"
        assert program.line() == "ready"
        with node.new_sub("own", keep="latest") as late:  # not accepted now; waits half a second
            program.say("go on")
            assert program.line() == "True"
            assert program.line() == "(False, {}) ['own']"
            assert program.process.wait(60) == 0
            assert not late.is_closed


@pytest.mark.usefixtures("patient")
def test_publisher_with_a_low_open_file_limit_survives_a_hundred_subscribers(master: Master) -> None:
    """libzmq accepts as many connections as it can; the publisher keeps serving those."""
    code = (
        FEW
        + """
resource.setrlimit(resource.RLIMIT_NOFILE, (100, 100))
node = nep.node("few")
pub = node.new_pub("wanted")
print("ready")
for line in sys.stdin:
    pub.publish(line.strip())
    print(pub.subscribers)
"""
    )
    with running(code) as program, nep.node("peer", wait_s=60.0) as node:
        assert program.line() == "ready"
        first = node.new_sub("wanted")
        subscribers = [node.new_sub("wanted", keep="latest") for _ in range(20)]
        program.say("one")
        assert int(program.line()) == 21
        assert first.listen(timeout_s=30.0) == (True, "one")
        more = SUBSCRIBERS.replace("COUNT", "100")
        with running(more) as crowd:
            assert crowd.line() == "connecting"
            eventually(lambda: _asked(program) > 40)
        for each in subscribers:
            each.close()
        eventually(lambda: _asked(program) == 1)
        assert first.listen(timeout_s=30.0)[0]


def _asked(program: object) -> int:
    program.say("again")  # type: ignore[attr-defined]
    return int(program.line())  # type: ignore[attr-defined]


SUBSCRIBERS = """
import nep, threading
nodes = [nep.node(f"n{n}") for n in range(COUNT)]
threads = [threading.Thread(target=each.new_sub, args=("wanted",)) for each in nodes]
for thread in threads:
    thread.start()
print("connecting")
import sys
sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has local names")
def test_publisher_closes_its_local_socket_when_file_descriptors_run_out(master: Master) -> None:
    """libzmq aborts the program if it can't accept on a local socket; with TCP, others only wait."""
    code = (
        FEW
        + """
node = nep.node("p")
pub = node.new_pub("wanted", latched=True)
pub.publish("here")
print("ready")
sys.stdin.readline()
resource.setrlimit(resource.RLIMIT_NOFILE, (128, 128))
sys.stdin.readline()
"""
    )
    with running(code) as program, nep.node("peer") as node:
        program.line()
        node.new_sub("wanted").close()
        assert local_names(program)
        program.say("few")
        eventually(lambda: not local_names(program))
        eventually(lambda: node.new_sub("wanted").listen(timeout_s=1.0) == (True, "here"))


def local_names(program: Program) -> list[str]:
    connections = psutil.Process(program.process.pid).net_connections(kind="unix")
    return [each.laddr for each in connections if str(each.laddr).startswith("@nep-")]


@pytest.mark.skipif(sys.platform != "linux", reason="counts files as Linux does")
def test_gateway_without_free_file_descriptors_rejects_originals_and_survives(tmp_path: Path) -> None:
    code = (
        FEW
        + """
from pathlib import Path
import json, zmq
from nep.programs.gateway.attachment import GatewayAttachment
from nep.programs.gateway.request_server import Ports
attached = GatewayAttachment(Path(sys.argv[1]) / "ports.json", Ports(int(sys.argv[2]), 0, 0))
def ask(topic):
    said = {"node": "n", "topic": topic, "mode": "many2many", "socket": "publisher", "msg_type": "json"}
    socket.send_json({**said, "pid": os.getpid()})
    assert socket.poll(20_000)
    return socket.recv_json()
with nep.master("127.0.0.1:0", attachments=[attached], learn_s=0.0), zmq.Context() as context:
    with context.socket(zmq.REQ) as socket:
        socket.connect(f"tcp://127.0.0.1:{sys.argv[2]}")
        ask("first")
        used = len(os.listdir("/proc/self/fd"))
        hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
        resource.setrlimit(resource.RLIMIT_NOFILE, (used + 20, hard))
        print(ask("second"))
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
        print(ask("third")["state"])
"""
    )
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    with running(code, str(tmp_path), str(port)) as program:
        assert "the master has too many files open" in program.line()
        assert program.line() == "success"
        assert program.end()[1] == ""
