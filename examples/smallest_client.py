"""The smallest client of the native wire, on pyzmq and msgpack alone: see docs/smallest-client.md.

python smallest_client.py talk      publish on the topic "example"
python smallest_client.py listen    print its messages
"""

import json
import os
import secrets
import socket
import struct
import sys
import time
from hashlib import sha256

import msgpack
import zmq

HEADER = struct.Struct("<BBHIQQQ")  # version, codec, flags, size, seq, stamp, publisher
JSON = 1


class Node:
    """Connection to the master, with publishers and subscribers. Not thread-safe."""

    def __init__(self, name, master=None):
        self.key = secrets.token_hex(16)
        self.id = sha256(self.key.encode()).hexdigest()[:16]
        self.record = {"id": self.id, "name": name, "host": socket.gethostname(), "pid": os.getpid(),
                       "language": "Smallest", "key": self.key}  # fmt: skip
        self.records = {"publishers": [], "subscribers": []}
        self.counts = {"publishers": [], "subscribers": []}
        self.subscribers = []
        self.epoch = self.revision = self.calls = 0
        self.renew_at = time.monotonic() + 1
        self.context = zmq.Context()
        self.sockets = []
        self.master = self.socket(zmq.DEALER)
        self.master.connect(f"tcp://{master or os.environ.get('NEP_MASTER', '127.0.0.1:7780')}")

    def socket(self, kind):
        """Return a new socket, which is closed with the node."""
        self.sockets.append(self.context.socket(kind))
        self.sockets[-1].linger = 0
        return self.sockets[-1]

    def register(self, do, kind, record, counts):
        """Register a publisher or subscriber; its id is derived from the node's key."""
        number = len(self.records["publishers"]) + len(self.records["subscribers"]) + 1
        digest = sha256(f"{self.key}/{number}".encode()).digest()
        record |= {"id": int.from_bytes(digest[:8], "little") >> 1 or 1, "number": number}
        counts |= {"id": record["id"]}
        self.records[kind].append(record)
        self.counts[kind].append(counts)
        call = self.request(do, node=self.record, **{kind[:-1]: record})
        while self.master.poll(2000):
            if self.process() == call:
                return
        raise TimeoutError("no master answers")

    def request(self, do, **what):
        """Send a request, and return its number."""
        self.calls += 1
        self.master.send(msgpack.packb({"do": do, "call": self.calls, "what": what}))
        return self.calls

    def process(self):
        """Process one reply or push; return the number of the request that it answers."""
        answer = msgpack.unpackb(self.master.recv(), strict_map_key=False)  # last_seqs has integer keys
        name, call, what = answer["is"], answer["re"], answer["what"]
        if name == "refused":
            raise RuntimeError(what["reason"])
        if name == "renewed" and not what.get("again"):
            self.revision, self.renew_at = what["revision"], time.monotonic() + what.get("next_s", 1.0)
        if name in {"added", "found"}:
            self.epoch = what["epoch"]
        elif what.get("again") or self.epoch not in {0, what["epoch"]}:
            self.request("join", node=self.record, epoch=self.epoch, **self.records)
        found = [*what.get("publishers", ()), *([what["publisher"]] if name == "publisher+" else ())]
        for each in found + [one for topic in what.get("topics", ()) for one in topic["publishers"]]:
            for subscriber in self.subscribers:
                if subscriber.topic == each["publisher"]["topic"] and each["publisher"]["endpoints"]:
                    subscriber.socket.connect(
                        each["publisher"]["endpoints"][0]
                    )  # no effect when already connected
        return call

    def serve(self):
        """Renew the lease when due, and process replies and pushes. Call at least once a second."""
        if time.monotonic() >= self.renew_at and self.epoch:
            self.renew_at = time.monotonic() + 1
            self.request("renew", node_id=self.id, epoch=self.epoch, revision=self.revision, **self.counts)
        while self.master.poll(0):
            self.process()

    def close(self):
        """Leave the network and close all sockets."""
        self.request("leave", node_id=self.id)
        self.master.poll(1000)
        self.context.destroy()


class Publisher:
    """Publisher of JSON on a topic."""

    def __init__(self, node, topic):
        self.topic, self.seq = topic, 0
        self.socket = node.socket(zmq.XPUB)
        self.socket.linger = 1000  # send queued messages before closing; their delivery is not confirmed
        self.socket.sndhwm = (
            50_000  # libzmq drops the newest beyond this; limit the bytes of large messages, too
        )
        port = self.socket.bind_to_random_port("tcp://127.0.0.1", 20000, 30000)
        self.counts = {"count": 0, "bytes": 0, "last_seq": 0}
        record = {
            "topic": topic,
            "msg_type": "json",
            "codec": "json",
            "endpoints": [f"tcp://127.0.0.1:{port}"],
        }
        node.register("publisher+", "publishers", record, self.counts)

    def publish(self, value):
        """Send a value to all connected subscribers."""
        payload = json.dumps(value, allow_nan=False).encode()
        self.seq += 1
        self.counts |= {"count": self.seq, "last_seq": self.seq, "bytes": self.counts["bytes"] + len(payload)}
        header = HEADER.pack(1, JSON, 0, len(payload), self.seq, time.time_ns(), self.counts["id"])
        self.socket.send_multipart([self.topic.encode() + b"\0", header, payload])


class Subscriber:
    """Subscriber to JSON on a topic."""

    def __init__(self, node, topic):
        self.topic, self.node = topic, node
        self.socket = node.socket(zmq.SUB)
        self.socket.subscribe(topic.encode() + b"\0")
        self.counts = {"received": 0, "lost": None}  # nil: losses are not counted
        node.subscribers.append(self)
        node.register("subscriber+", "subscribers", {"topic": topic, "msg_type": "json"}, self.counts)

    def receive(self, timeout_s):
        """Return the next value, or None after the timeout."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            self.node.serve()
            if self.socket.poll(50):
                parts = self.socket.recv_multipart()
                if len(parts) != 3 or len(parts[1]) != HEADER.size:
                    continue
                version, codec, flags, size, *_numbers = HEADER.unpack(parts[1])
                if version == 1 and codec == JSON and flags in {0, 1} and size in {0, len(parts[2])}:
                    self.counts["received"] += 1
                    return json.loads(parts[2])
        return None


def main():
    node = Node(f"smallest_{sys.argv[1]}")
    try:
        if sys.argv[1] == "talk":
            publisher = Publisher(node, "example")
            while True:
                publisher.publish({"n": publisher.seq + 1})
                node.serve()
                time.sleep(0.5)
        subscriber = Subscriber(node, "example")
        while True:
            value = subscriber.receive(1.0)
            print("no message within 1 s" if value is None else value)
    finally:
        node.close()


if __name__ == "__main__":
    main()
