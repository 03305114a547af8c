"""Fixtures for tests of the gateway alone.

Raw sockets act as programs of the original NEP, a fake as the native network.
"""

from __future__ import annotations

import json
import os
import threading

import pytest
import zmq

from nep.programs.gateway.gateway import Gateway
from nep.programs.gateway.processes import SystemProcesses

LONG_MS = 60_000


class FakeNative:
    """Fake native network that records the gateway's calls and lets a test wait for them."""

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
            assert self._news.wait_for(done, 60), vars(self)

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

    def set_programs(self, programs):
        self._set(lambda: setattr(self, "programs", programs))

    def tick(self):
        pass

    def report(self, id, sentence, hint=""):
        self._set(lambda: self.alerts.update({id: sentence}))

    def resolve(self, id):
        self._set(lambda: self.alerts.pop(id, None))

    def close(self):
        pass


class Original:
    """Raw ZeroMQ sockets, used as programs of the original NEP use them."""

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

    def publish_until(self, publisher, frame, done):
        """Publish a frame repeatedly until `done` returns true, because the subscriber joins late."""
        waited = threading.Event()
        for _ in range(1200):
            publisher.send(frame)
            if done():
                return
            waited.wait(0.05)
        pytest.fail("nothing arrived")

    def waiting(self, subscriber):
        """Return all frames that have arrived."""
        frames = []
        while subscriber.poll(0):
            frames.append(subscriber.recv())
        return frames


@pytest.fixture
def new_native():
    """Factory of further fake native networks."""
    return FakeNative


@pytest.fixture
def native():
    return FakeNative()


@pytest.fixture
def gateway_at(fixed_ports, native, tmp_path):
    """Function that starts gateways, one after the other, which share a file."""
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
