"""The gateway alone: raw sockets play the originals, a fake plays the native network."""

from __future__ import annotations

import json
import os
import socket
import threading

import pytest
import zmq

from nep.gateway.desk import Ports
from nep.gateway.gateway import Gateway
from nep.gateway.processes import SystemProcesses
from nep.message import Message

pytestmark = [pytest.mark.ports]
LONG_MS = 10_000


class FakeNative:
    """Remembers what the gateway does, and lets a test wait for it."""

    def __init__(self):
        self._news = threading.Condition()
        self.published = []
        self.subscribed = set()
        self.publishing = set()
        self.programs = ()
        self.alerts = {}
        self.inbox = None

    def _set(self, change):
        with self._news:
            change()
            self._news.notify_all()

    def wait(self, done):
        with self._news:
            assert self._news.wait_for(done, 10), vars(self)

    def start(self, inbox):
        self.inbox = inbox

    def publish(self, topic, codec, data):
        self._set(lambda: (self.published.append((topic, codec, data)), self.publishing.add((topic, codec))))

    def stop_publishing(self, topic, codec):
        self._set(lambda: self.publishing.discard((topic, codec)))

    def subscribe(self, topic, codec):
        self._set(lambda: self.subscribed.add((topic, codec)))
        return True

    def unsubscribe(self, topic, codec):
        self._set(lambda: self.subscribed.discard((topic, codec)))

    def data_of(self, message):
        return message.data

    def show(self, programs):
        self._set(lambda: setattr(self, "programs", programs))

    def look(self):
        pass

    def tell(self, id, sentence, hint=""):
        self._set(lambda: self.alerts.update({id: sentence}))

    def cure(self, id):
        self._set(lambda: self.alerts.pop(id, None))

    def close(self):
        pass


class Original:
    """Raw sockets, used as programs of the original NEP use them."""

    def __init__(self):
        self.context = zmq.Context()
        self.context.setsockopt(zmq.LINGER, 0)

    def socket(self, kind):
        opened = self.context.socket(kind)
        opened.setsockopt(zmq.RCVTIMEO, LONG_MS)
        opened.setsockopt(zmq.SNDTIMEO, LONG_MS)
        return opened

    def ask_raw(self, data, port=7000):
        with self.socket(zmq.REQ) as asking:
            asking.connect(f"tcp://127.0.0.1:{port}")
            asking.send(data)
            return asking.recv()

    def ask(self, topic="t", socket="publisher", port=7000, node="n", **more):
        fields = {"node": node, "topic": topic, "mode": "many2many", "socket": socket, "pid": os.getpid()}
        return json.loads(self.ask_raw(json.dumps({**fields, "msg_type": "json", **more}).encode(), port))

    def publisher(self, port):
        opened = self.socket(zmq.PUB)
        opened.connect(f"tcp://127.0.0.1:{port}")
        return opened

    def subscriber(self, port, filter_=b""):
        opened = self.socket(zmq.SUB)
        opened.setsockopt(zmq.SUBSCRIBE, filter_)
        opened.connect(f"tcp://127.0.0.1:{port}")
        return opened


@pytest.fixture
def native():
    return FakeNative()


@pytest.fixture
def gateway_at(fixed_ports, native, tmp_path):
    """Starts gateways that share one file, one after the other."""
    running = []

    def start(outside=native, **more):
        gateway = Gateway(outside, SystemProcesses(), tmp_path / "map.json", **more)
        running.append(gateway)
        assert gateway.start()
        return gateway

    yield start
    for gateway in running:
        gateway.close()


@pytest.fixture
def gateway(gateway_at):
    return gateway_at()


@pytest.fixture
def original():
    program = Original()
    yield program
    program.context.destroy(linger=0)


def publish_until(publisher, frame, done):
    """Publish until the slow joiner has joined."""
    waited = threading.Event()
    for _ in range(200):
        publisher.send(frame)
        if done():
            return
        waited.wait(0.05)
    pytest.fail("nothing arrived")


def waiting(subscriber):
    """All frames that have arrived."""
    frames = []
    while subscriber.poll(0):
        frames.append(subscriber.recv())
    return frames


def test_the_answer_has_the_originals_shape_and_ports_from_9000_up(gateway, original):
    first = original.ask_raw(
        b'{"node":"n1","topic":"t1","mode":"many2many","socket":"publisher","pid":1,"msg_type":"json"}'
    )
    assert first == (
        b'{"topic":"t1","port":9000,"mode":"many2many","ip":"127.0.0.1","socket":"publisher","state":"success"}'
    )
    assert original.ask("t2")["port"] == 9002
    assert original.ask("t1", "subscriber")["port"] == 9000


def test_the_two_framings_of_a_topic_have_pairs_of_their_own(gateway, original):
    assert original.ask("t", port=7000)["port"] != original.ask("t", port=50000)["port"]
    assert (
        original.ask("t", port=50000, msg_type="dictionary")["port"] == original.ask("t", port=7000)["port"]
    )


@pytest.mark.parametrize("port", [7000, 50000])
@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"hello",
        b"\xff\xfe\x00",
        b"{}",
        b"[]",
        b"null",
        b'{"node":"n"}',
        b'{"node":"n","topic":7,"socket":"publisher"}',
        b'{"node":"n","topic":"t","socket":"telephone"}',
        b'{"node":"n","topic":"t","socket":"publisher","mode":"all"}',
        b'{"node":"n","topic":"t","socket":"publisher","mode":["many2many"]}',
        b'{"node":"n","topic":"t","socket":"publisher","msg_type":{}}',
        b"{" * 50_000,
        b'"' + b"x" * 3_000_000 + b'"',
    ],
    ids=range(14),
)
def test_bad_requests_are_answered_and_kill_nothing(gateway, original, bad, port):
    assert json.loads(original.ask_raw(bad, port))["state"] == "failure"
    assert original.ask("fine", port=port)["state"] == "success"


def test_a_request_of_many_parts_and_one_without_an_answer_kill_nothing(gateway, original):
    with original.socket(zmq.REQ) as asking:
        asking.connect("tcp://127.0.0.1:7000")
        asking.send_multipart([b'{"node":"n",', b'"topic":"t","socket":"publisher"}'])
        assert json.loads(asking.recv())["state"] == "success"
    with original.socket(zmq.REQ) as leaving:
        leaving.connect("tcp://127.0.0.1:7000")
        leaving.send(b"{}")
    with original.socket(zmq.DEALER) as odd:
        odd.connect("tcp://127.0.0.1:7000")
        odd.send(b"no envelope")
    assert original.ask("t")["state"] == "success"


def test_unknown_keys_a_missing_pid_and_a_pid_as_text_are_fine(gateway, original):
    assert original.ask("t", pid="4711", colour="green")["state"] == "success"
    assert original.ask("t", pid="none", language="Rust")["state"] == "success"


def test_a_second_node_of_one_name_harms_nobody(gateway, original, native):
    original.ask("t", node="twin", pid=os.getpid())
    assert original.ask("t", node="twin", pid=os.getppid())["state"] == "success"
    native.wait(lambda: len(native.programs) == 2)


def test_frames_are_translated_once_in_every_direction(gateway, original, native):
    a, b = original.ask("t", port=7000)["port"], original.ask("t", port=50000)["port"]
    with (
        original.subscriber(a + 1, b"t") as to_a,
        original.subscriber(b + 1) as to_b,
        original.publisher(a) as from_a,
        original.publisher(b) as from_b,
    ):
        publish_until(from_a, b't {"warm":"a"}', lambda: to_b.poll(0) and to_a.poll(0))
        publish_until(from_b, b'{"warm": "b"}', lambda: any(b"b" in each[2] for each in native.published))
        for number in range(40):
            from_a.send(b't {"a":%d}' % number)
            from_b.send(b'{"b":%d}' % number)
        from_a.send(b't {"end":1}')
        from_b.send(b'{"end":2}')
        heard_a, heard_b = read_to_end(to_a), read_to_end(to_b)
        native.wait(lambda: sum(b"end" in each[2] for each in native.published) == 2)
    heard_native = [data for _, _, data in native.published]
    for number in range(40):
        assert heard_a.count(b't {"a":%d}' % number) == heard_a.count(b't {"b":%d}' % number) == 1
        assert heard_b.count(b'{"a":%d}' % number) == heard_b.count(b'{"b":%d}' % number) == 1
        assert heard_native.count(b'{"a":%d}' % number) == heard_native.count(b'{"b":%d}' % number) == 1


def read_to_end(subscriber):
    frames = []
    while sum(b"end" in frame for frame in frames) < 2:
        frames.append(subscriber.recv())
    while subscriber.poll(200):
        frames.append(subscriber.recv())
    return frames


def test_native_is_subscribed_only_while_an_original_wants_it(gateway, original, native):
    port = original.ask("t", "subscriber", port=50000)["port"]
    assert not native.subscribed
    with original.subscriber(port + 1) as subscriber:
        native.wait(lambda: native.subscribed == {("t", "json")})
        native.inbox.post(Message("t", b'{"native":1}', "json", "json"))
        assert subscriber.recv() == b'{"native":1}'
        assert not native.published
    native.wait(lambda: not native.subscribed)


def test_a_native_string_does_not_reach_those_who_want_json(gateway, original, native):
    port = original.ask("t", "subscriber")["port"]
    with original.subscriber(port + 1, b"t") as subscriber:
        native.wait(lambda: native.subscribed)
        native.inbox.post(Message("t", b"hello", "string", "string"))
        native.inbox.post(Message("t", b'{"native":1}', "json", "json"))
        assert subscriber.recv() == b't {"native":1}'


def test_the_role_comes_from_the_traffic_and_ends_with_it(gateway, original, native):
    port = original.ask("t", "publisher", node="js")["port"]
    native.wait(lambda: [program.name for program in native.programs] == ["js"])
    with original.subscriber(port + 1, b"t"):
        native.wait(
            lambda: [link.role for program in native.programs for link in program.links] == ["subscriber"]
        )
    native.wait(lambda: not native.programs)


def test_a_restarted_gateway_serves_the_same_ports_to_those_who_never_ask_again(gateway_at, original):
    first, second = FakeNative(), FakeNative()
    gateway = gateway_at(first)
    original.ask("other", node="other")
    port = original.ask("t", node="both")["port"]
    with original.subscriber(port + 1, b"t") as subscriber, original.publisher(port) as publisher:
        publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
        gateway.close()
        gateway_at(second)
        publish_until(publisher, b't {"n":2}', lambda: b't {"n":2}' in waiting(subscriber))
        second.wait(lambda: second.published)
        second.wait(lambda: second.subscribed)
        second.wait(lambda: {program.name for program in second.programs} == {"other", "both"})
        assert original.ask("t", "subscriber")["port"] == port


def test_a_visitor_who_does_not_speak_zeromq_harms_nobody(gateway, original, native):
    port = original.ask("t", "subscriber")["port"]
    with original.subscriber(port + 1, b"t") as subscriber, original.publisher(port) as publisher:
        publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
        for _ in range(3):
            for visited in (port, port + 1, 7000):
                with socket.create_connection(("127.0.0.1", visited)) as visitor:
                    visitor.sendall(b"GET / HTTP/1.1\r\n\r\n")
        original.ask("other", node="other")
        native.wait(
            lambda: (
                {link.role for each in native.programs for link in each.links} == {"publisher", "subscriber"}
            )
        )
        publisher.send(b't {"n":2}')
        while subscriber.recv() != b't {"n":2}':
            pass


def test_one2many_the_program_binds_and_the_gateway_connects(gateway, original, native):
    port = original.ask("t", "publisher", mode="one2many")["port"]
    other = original.ask("t", "subscriber", mode="one2many")["port"]
    prefixed = original.ask("t", "subscriber")["port"]
    with (
        original.socket(zmq.PUB) as publisher,
        original.subscriber(other, b"t") as subscriber,
        original.subscriber(prefixed + 1, b"t") as many,
    ):
        publisher.bind(f"tcp://127.0.0.1:{port}")
        publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0) and many.poll(0))
        native.wait(lambda: native.published)


def test_many2one_the_subscriber_binds_and_the_gateway_connects(gateway, original, native):
    port = original.ask("t", "subscriber", mode="many2one")["port"]
    other = original.ask("t", "publisher", mode="many2one")["port"]
    with original.socket(zmq.SUB) as subscriber, original.publisher(other) as publisher:
        subscriber.setsockopt(zmq.SUBSCRIBE, b"t")
        subscriber.bind(f"tcp://127.0.0.1:{port}")
        publish_until(publisher, b't {"n":1}', lambda: subscriber.poll(0))
        native.wait(lambda: native.published)


def test_client_and_server_get_one_port_and_no_translation(gateway, original, native):
    answer = original.ask("s", "server")
    assert "mode" not in answer
    assert original.ask("s", "client", port=50000)["port"] == answer["port"]
    with original.socket(zmq.REP) as server, original.socket(zmq.REQ) as client:
        server.bind(f"tcp://127.0.0.1:{answer['port']}")
        client.connect(f"tcp://127.0.0.1:{answer['port']}")
        client.send(b"ping")
        server.send(server.recv())
        assert client.recv() == b"ping"
    assert not native.published


def test_the_broadcast_tells_all_topics_after_each_request(gateway, original):
    with original.subscriber(7777, b"master") as tool:
        for number in range(100):
            original.ask(f"t{number % 3}", node="n1")
            if tool.poll(50):
                break
        frame = tool.recv()
        assert frame.startswith(b"master {")
        topics = json.loads(frame[7:])
        assert topics["t0"]["nodes"] == {"n1": {"socket": "publisher", "pid": os.getpid(), "ip": "127.0.0.1"}}


def test_nep_0546_and_0547_are_named_in_an_alert(gateway, original, native):
    port = original.ask("t", "subscriber", port=50000)["port"]
    with original.subscriber(port + 1, b"t"):
        native.wait(lambda: "0.5.4.6" in native.alerts.get("version:t:subscriber", ""))
    native.wait(lambda: "version:t:subscriber" not in native.alerts)
    with original.publisher(port) as publisher:
        publish_until(
            publisher,
            json.dumps('{"a":1}').encode(),
            lambda: "0.5.4.7" in native.alerts.get("version:t:publisher", ""),
        )
    native.wait(lambda: not native.alerts)
    assert not native.published


def test_a_taken_port_is_an_alert_and_is_served_as_soon_as_it_is_free(
    fixed_ports, gateway_at, original, native
):
    with socket.socket() as airplay:
        airplay.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        airplay.bind(("127.0.0.1", 7000))
        airplay.listen()
        gateway_at()
        assert "7000 is taken" in native.alerts["port:7000"]
        assert original.ask("t", port=50000)["state"] == "success"
    native.wait(lambda: "port:7000" not in native.alerts)
    assert original.ask("t", port=7000)["state"] == "success"


def test_a_taken_pair_is_passed_over(fixed_ports, gateway, original):
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", 9001))
        other.listen()
        assert original.ask("t")["port"] == 9002


def test_a_topic_that_programs_leave_keeps_its_port_but_no_sockets(gateway, original, native):
    port = original.ask("t", "subscriber")["port"]
    with original.subscriber(port + 1, b"t"):
        native.wait(lambda: native.subscribed)
    native.wait(lambda: not native.programs)
    original.ask("other")
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0
    assert original.ask("t")["port"] == port


def test_nothing_is_bound_but_on_the_loopback_address(gateway, original):
    import psutil

    original.ask("t")
    listening = [
        each.laddr for each in psutil.Process().net_connections("tcp") if each.status == psutil.CONN_LISTEN
    ]
    assert {7000, 50000, 7777, 9000, 9001} <= {address.port for address in listening}
    assert {address.ip for address in listening} == {"127.0.0.1"}


def test_other_ports_can_be_chosen_and_left_out(gateway_at):
    gateway_at(ports=Ports(0, 0, 0))
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", 7000)) != 0
