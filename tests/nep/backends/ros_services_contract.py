"""Contract tests of services over ROS, in a separate process that `test_ros_services.py` starts.

Features that ROS lacks are left out: late replies, because a client closes its connection after its
timeout, and two servers of one name in one program.
"""

from __future__ import annotations

import pytest

import nep
from tests.nep.backends.ros_contract import Make, _fail_on_leaks, make, ros
from tests.nep.programs import eventually
from tests.nep.services import test_calls as contract
from tests.nep.services.test_calls import spin

__all__ = ["_fail_on_leaks", "make", "ros", "spin"]

pytestmark = [  # raised inside rospy
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
]
LEFT_OUT = {
    "test_cancelled_awaited_call_discards_its_reply",
    "test_slow_server_raises_service_timeout_and_its_late_reply_is_discarded",
    "test_closing_server_finishes_its_running_call",
    "test_second_server_raises_an_alert_and_takes_over",
    "test_services_are_listed_in_the_graph_apart_from_topics",
}
globals().update({
    name: test
    for name, test in vars(contract).items()
    if name.startswith("test_") and name not in LEFT_OUT
})  # fmt: skip


@pytest.fixture
def registered(make: Make) -> Make:
    """Same as `make`: the ROS master knows all nodes."""
    return make


def test_slow_server_raises_service_timeout_error(make: Make) -> None:
    server = make("server").new_server("/slow")
    client = make("client").new_client("/slow")
    with pytest.raises(nep.ServiceTimeoutError, match=r"0\.2 s.*'/slow'"):
        client.call({"n": 1}, timeout_s=0.2)
    assert server.listen_info(30.0) == {"n": 1}
    server.send_info({})
    assert client.late == 0


def test_graph_lists_services_but_not_those_of_rospy(make: Make) -> None:
    a, b = make("a"), make("b")
    server = a.new_server("x", lambda request: 1 / 0 if request == "bad" else request, threads=1)
    client = b.new_client("/x", timeout_s=30.0)
    assert client.call(1) == 1
    with pytest.raises(nep.ServiceError):
        client.call("bad")
    eventually(lambda: b.graph().services["/x"].calls == 2)
    graph = b.graph()
    assert graph.services.keys() == {"/x"}
    assert not any("/x" in topic for topic in graph.topics)
    info = graph.services["/x"]
    assert (info.errors, info.clients[0].answered) == (1, 2)
    assert [each.node_id for each in info.servers] == [a.id]
    assert [each.node_id for each in info.clients] == [b.id]
    assert server.endpoints[0].startswith("rosrpc://127.0.0.1:")
    server.close()
    client.close()
    assert not b.graph().services


def test_second_server_in_one_program_is_rejected_until_the_first_closes(make: Make) -> None:
    first = make("a").new_server("/x")
    with pytest.raises(nep.NepError, match=r"program .*'/x'.*ROS"):
        make("b").new_server("/x")
    first.close()
    make("c").new_server("/x", lambda request: request, threads=1)
    assert make("d").new_client("/x").call(5, timeout_s=30.0) == 5


def test_unknown_service_types_are_rejected(make: Make) -> None:
    with pytest.raises(nep.NepError, match=r"'std_srvs/SetBoot'.*-srvs'"):
        make("a").new_server("/x", msg_type="std_srvs/SetBoot")
    with pytest.raises(nep.NepError, match=r"ROS service.*'image'.*'std_srvs/SetBool'"):
        make("b").new_server("/x", msg_type="image")
