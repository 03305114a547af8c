"""Tests of services of the back end `ros` with real ROS programs.

The contract tests run in a separate process.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.nep.backends.ros_programs import FIND_ROS, free_port, ros_master, skip_without_ros, told
from tests.nep.programs import ROOT, running


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[str]:
    skip_without_ros()
    with ros_master(tmp_path) as address:
        yield address


def test_ros_services_pass_the_contract() -> None:
    skip_without_ros()
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "tests/nep/backends/ros_services_contract.py"]
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTEST_", "ROS_"))}
    ended = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=140
    )
    assert ended.returncode == 0, ended.stdout[-8000:] + ended.stderr[-2000:]
    assert " passed" in ended.stdout
    assert "skipped" not in ended.stdout


SERVES = (
    FIND_ROS
    + """
import sys
from std_srvs.srv import SetBool, SetBoolResponse, Trigger
from sensor_msgs.srv import SetCameraInfo, SetCameraInfoResponse
rospy.init_node("server", disable_signals=True)
def switch(request):
    return SetBoolResponse(not request.data, "switched")
def fails(request):
    raise RuntimeError("no power")
def camera(request):
    info = request.camera_info
    said = info.height, len(info.D), info.K[8], info.header.frame_id
    return SetCameraInfoResponse(True, "%d %d %s %s" % said)
class Other(Trigger):
    _md5sum = "0" * 32
class Unknown(Trigger):
    _type = "nothing_msgs/Known"
servers = [rospy.Service(*each) for each in (
    ("/switch", SetBool, switch), ("/fails", Trigger, fails), ("/camera", SetCameraInfo, camera),
    ("/other", Other, fails), ("/unknown", Unknown, fails))]
print("ready")
sys.stdin.readline()
"""
)
CALLS = """
import nep
node = nep.node("client", "ros")
def call(service, request, **more):
    try:
        print(node.new_client(service, **more).call(request, timeout_s=30.0))
    except nep.NepError as error:
        print(type(error).__name__, error)
call("/switch", {"data": True})
call("switch", {})
call("/switch", {"data": 5})
call("/switch", {"dat": True})
call("/switch", {"data": False}, msg_type="msgpack")
call("/switch", [])
call("/fails", {})
info = {"header": {"frame_id": "eye"}, "height": 480, "D": [0.5] * 5, "K": list(range(9))}
call("/camera", {"camera_info": info})
call("/other", {})
call("/unknown", {})
print(sorted(node.graph().services))
"""


def test_nep_calls_a_ros_server(ros: str) -> None:
    with running(SERVES, **told(ros)) as server:
        assert server.line() == "ready"
        with running(CALLS, **told(ros)) as client:
            assert client.line() == "{'success': False, 'message': 'switched'}"
            assert client.line() == "{'success': True, 'message': 'switched'}"
            assert "EncodeError" in (said := client.line())
            assert "field 'data' is 5; expected a 'bool'" in said
            assert "field 'dat' doesn't exist; did you mean 'data'?" in client.line()
            assert client.line() == "{'success': True, 'message': 'switched'}"
            assert "publish a 'dict' with the fields 'data'" in client.line()
            assert client.line() == (
                "ServiceError the server of '/fails' failed: ServiceException: error processing request: "
                "no power"
            )
            assert client.line() == "{'success': True, 'status_message': '480 5 8.0 eye'}"
            assert "use the same version on both sides" in client.line()
            assert "unknown ROS service 'nothing_msgs/Known'" in client.line()
            assert client.line() == "['/camera', '/fails', '/other', '/switch', '/unknown']"
            client.end()


NEP_SERVES = """
import nep, threading
node = nep.node("server", "ros")
def switch(request):
    print(request)
    if request["data"]:
        raise ValueError("no")
    return {"success": True, "message": "done"}
first = node.new_server("/switch", switch, msg_type="std_srvs/SetBool")
second = node.new_server("/wrong", lambda request: {"succes": True}, threads=1, msg_type="std_srvs/Trigger")
third = node.new_server("/empty", lambda request: None, threads=1, msg_type="std_srvs/Empty")
node.new_timer(0.01, lambda: second.errors and first.calls == 3 and third.calls and node.stop_spin())
print("ready")
node.spin()
print(first.calls, first.errors, second.errors)
"""
ROS_CALLS = (
    FIND_ROS
    + """
from std_srvs.srv import Empty, SetBool, Trigger
rospy.init_node("client", disable_signals=True)
def call(service, kind, *args, **more):
    rospy.wait_for_service(service, 30)
    try:
        print(repr(rospy.ServiceProxy(service, kind, **more)(*args)).replace(chr(10), " "))
    except rospy.ServiceException as error:
        print(error)
call("/switch", SetBool, False)
call("/switch", SetBool, True)
call("/switch", SetBool, False, persistent=True)
call("/empty", Empty)
call("/switch", Trigger)
call("/wrong", Trigger)
"""
)


def test_ros_client_calls_a_nep_server(ros: str) -> None:
    with running(NEP_SERVES, **told(ros)) as server:
        assert server.line() == "ready"
        with running(ROS_CALLS, **told(ros)) as client:
            assert client.line() == 'success: True message: "done"'
            assert client.line() == (
                "service [/switch] responded with an error: b'service cannot process request: ValueError: no'"
            )
            assert client.line() == 'success: True message: "done"'
            assert client.line() == ""
            assert "md5sums do not match" in client.line()
            assert "field 'succes' doesn't exist; did you mean 'success'?" in client.line()
            client.end()
        assert [server.line() for _ in range(3)] == ["{'data': False}", "{'data': True}", "{'data': False}"]
        assert server.line() == "3 1 1"
        server.end()
        assert server.process.returncode == 0


DIES = """
import nep, sys
node = nep.node("server", "ros")
server = node.new_server("/x")
print("ready")
while True:
    if server.listen_info() == "end":
        print("asked")
        sys.stdin.readline()
    server.send_info("answer")
"""
ASKS = """
import nep, sys
node = nep.node("client", "ros")
client = node.new_client("/x", timeout_s=60.0)
print(client.call(1))
future = client.call_async("end", timeout_s=None)
print("waits", flush=True)
for limit in (60.0, None):
    try:
        future.result(limit)
    except nep.NepError as error:
        print(type(error).__name__)
    sys.stdin.readline()
    future = client.call_async(2)
print(future.result(60.0))
"""


def test_killed_server_is_reported_and_its_successor_is_found(ros: str) -> None:
    with running(DIES, **told(ros)) as server, running(ASKS, **told(ros)) as client:
        assert server.line() == "ready"
        assert (client.line(), client.line(), server.line()) == ("answer", "waits", "asked")
        server.kill()
        assert client.line() == "ServerGoneError"
        client.say("")
        with running(DIES, **told(ros)) as other:
            assert other.line() == "ready"
            client.say("")
            assert client.line() == "answer"
            client.end()


SHUT_DOWN = """
import nep
node = nep.node("first", "ros")
server, other = node.new_server("/x"), node.new_server("/y", print)
print("ready")
for call in (server.listen_info, node.spin, lambda: node.new_server("/z")):
    try:
        call()
    except nep.ClosedError as error:
        print(error)
print(server.is_closed)
node.close()
"""
SAME_NAME = "import nep; nep.node('second', 'ros').new_pub('topic'); print('ready'); input()"


def test_server_whose_node_name_is_taken_raises_instead_of_blocking(ros: str) -> None:
    with running(SHUT_DOWN, "__name:=same", **told(ros)) as first:
        assert first.line() == "ready"
        with running(SAME_NAME, "__name:=same", **told(ros)) as second:
            assert second.line() == "ready"
            assert first.line().startswith("shutdown request: ")
            assert first.line().startswith("server of '/x' is closed")
            for _each in range(2):
                assert first.line().startswith("rospy was shut down")
            assert first.line() == "True"
            _said, errors = first.end()
            assert (first.process.returncode, "Traceback" in errors) == (0, False)


OBEYS = """
import nep, sys
node = nep.node("client", "ros")
client = node.new_client("/x")
for line in sys.stdin:
    limit, request = line.split()
    try:
        print(client.call(request, float(limit)))
    except nep.NepError as error:
        print(type(error).__name__)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="there are no signals that stop")
def test_call_to_a_hung_server_raises_no_server_error_and_works_after_it_resumes(ros: str) -> None:
    with running(DIES, **told(ros)) as server, running(OBEYS, **told(ros)) as client:
        assert server.line() == "ready"
        client.say("60 1")
        assert client.line() == "answer"
        server.stop()
        client.say("0.3 1")
        assert client.line() == "NoServerError", "it did not say that it is one: nothing was sent"
        server.signal(signal.SIGCONT)
        client.say("60 1")
        assert client.line() == "answer"


def test_services_register_again_at_a_restarted_ros_master(tmp_path: Path) -> None:
    skip_without_ros()
    address = f"127.0.0.1:{free_port()}"
    with running(DIES, **told(address)) as server, running(OBEYS, **told(address)) as client:
        with ros_master(tmp_path, address):
            assert server.line() == "ready"
            client.say("60 1")
            assert client.line() == "answer"
        client.say("0.1 2")
        assert client.line() == "NoServerError", "a call needs the master"
        with ros_master(tmp_path, address):
            client.say("60 3")
            assert client.line() == "answer"
