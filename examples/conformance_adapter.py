"""Adapter of the nep library for the conformance tester: see docs/wire-check.md.

    nep wire check -- python examples/conformance_adapter.py

Reads requests from stdin and writes replies and events to stdout, one JSON object per line.
"""

import base64
import json
import sys
import threading

import nep
from nep.errors import DecodeError

FEATURES = [
    *("hello1", "hello2", "hello3", "losses", "latched", "history"),
    *("patterns", "services", "latest", "statistics", "keys"),
]


class Adapter:
    """Executor of the tester's requests. The node's thread writes events, the main thread replies."""

    def __init__(self):
        self.node = None
        self.publishers, self.subscribers, self.clients = {}, {}, {}
        self.writing = threading.Lock()

    def write(self, line):
        """Write an object as one line."""
        with self.writing:
            sys.stdout.write(json.dumps(line) + "\n")
            sys.stdout.flush()

    def do(self, request):
        """Carry out a request and return its result."""
        return getattr(self, f"_do_{request.pop('do')}")(**request)

    def _do_features(self):
        return {"language": "Python", "version": nep.__version__, "features": FEATURES}

    def _do_node(self, name):
        self.node = nep.node(name)
        return {}

    def _do_publisher(self, topic, type, latched=False, history=0):  # noqa: A002 - the name in the protocol
        publisher = self.node.new_pub(topic, type, latched=latched, history=history)
        self.publishers[len(self.publishers) + 1] = publisher
        return {"pub": len(self.publishers), "missing": list(publisher.missing)}

    def _do_publish(self, pub, value=None, text=None, bytes=None, count=None):  # noqa: A002 - the name in the protocol
        payload = base64.b64decode(bytes) if bytes is not None else value if text is None else text
        for number in range(1, (count or 1) + 1):
            counted = count is not None and isinstance(payload, dict)
            self.publishers[pub].publish({**payload, "n": number} if counted else payload)
        return {}

    def _do_subscriber(self, topic, type, latest=False, pattern=False):  # noqa: A002 - the name in the protocol
        number = len(self.subscribers) + 1
        self.subscribers[number] = None  # messages may arrive before new_sub returns
        self.subscribers[number] = self.node.new_sub(
            topic,
            type,
            keep="latest" if latest else "all",
            sink=lambda messages: [self.report(number, each) for each in messages],
            wildcards=pattern,
        )
        return {"sub": number}

    def report(self, number, message):
        """Write the event of a received message."""
        event = {
            "event": "message",
            "sub": number,
            "topic": message.topic,
            "codec": message.codec,
            "seq": str(message.seq),
            "stamp_ns": str(message.stamp_ns),
            "publisher": str(message.publisher),
            "payload": base64.b64encode(message.data).decode(),
        }
        try:
            if message.codec in {"json", "string", "msgpack"}:
                json.dumps(message.payload)
                event["value"] = message.payload
        except (DecodeError, TypeError, ValueError):
            pass  # not decodable, or not representable in JSON
        self.write(event)

    def _do_counts(self, sub=None, pub=None):
        if pub is not None:
            found = self.publishers[pub]
            return {"sent": str(found.count), "subscribers": found.subscribers}
        return {"received": str(self.subscribers[sub].received), "lost": str(self.subscribers[sub].lost)}

    def _do_close_publisher(self, pub):
        self.publishers[pub].close()
        return {}

    def _do_close_subscriber(self, sub):
        self.subscribers[sub].close()
        return {}

    def _do_serve(self, service):
        self.node.new_server(service, lambda payload: payload, threads=1)
        return {}

    def _do_call(self, service, value, timeout_s):
        client = self.clients.get(service) or self.node.new_client(service)
        self.clients[service] = client
        return {"value": client.call(value, timeout_s=timeout_s)}

    def _do_close(self):
        self.node.close()
        self.node = None
        return {}

    def run(self):
        """Serve requests until the node is closed or stdin ends."""
        for line in sys.stdin:
            request = json.loads(line)
            number = request.pop("id")
            has_node = self.node is not None
            try:
                result = self.do(request)
            except Exception as error:  # noqa: BLE001 - reported to the tester
                self.write({"re": number, "error": f"{type(error).__name__}: {error}"})
                continue
            self.write({"re": number, **result})
            if has_node and self.node is None:
                return
        if self.node is not None:
            self.node.close()


if __name__ == "__main__":
    Adapter().run()
