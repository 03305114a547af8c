"""Services of the small client: servers and calls."""

from __future__ import annotations

import contextlib
import json
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import zmq

from nep.errors import WireError
from nep.protocol import service_wire
from tests.nep.conformance.client_state import Handshakes, Pub


class Services:
    """Mixin of `Client` for servers and calls."""

    node: dict[str, Any]
    servers: list[zmq.Socket[bytes]]
    counted: list[Pub]
    """Servers whose counts are sent in renewals."""
    _context: zmq.Context[Any]
    ask: Callable[..., dict[str, Any]]
    tell: Callable[..., int]
    until: Callable[..., None]
    new_id: Callable[[], dict[str, Any]]
    publisher_record: Callable[[str, str, int], dict[str, Any]]

    def do_serve(self, service: str) -> dict[str, Any]:
        socket = self._context.socket(zmq.ROUTER)
        port = socket.bind_to_random_port("tcp://127.0.0.1", 20000, 50000)
        topic = service_wire.topic_of(service)
        record = {**self.publisher_record(topic, self.service_type(), port), "codec": "service"}
        pub = Pub(record, socket, 1, deque(maxlen=0))
        self.servers.append(socket)
        self.counted.append(pub)
        self.ask("publisher+", publisher=record)
        return {}

    def service_type(self) -> str:
        return "service"

    def serve(self, socket: zmq.Socket[bytes]) -> None:
        sender, *parts = socket.recv_multipart()
        try:
            call = service_wire.NATIVE.read_call(parts)
        except WireError as error:
            self.refuse_call(error)
            return
        try:
            json.loads(bytes(call.data))
            reply = self.answer(call)
        except ValueError:
            reply = service_wire.error_reply(service_wire.CallKind.REJECTED, "", "not JSON")
        socket.send_multipart([sender, *service_wire.NATIVE.encode_reply(call.number, reply)])

    def refuse_call(self, error: WireError) -> None:
        pass

    def answer(self, call: service_wire.ReceivedCall) -> service_wire.Reply:
        return service_wire.Reply(service_wire.CallKind.REPLY, call.data, call.codec)

    def do_call(self, service: str, value: Any, timeout_s: float) -> dict[str, Any]:
        topic = service_wire.topic_of(service)
        record = {**self.new_id(), "topic": topic, "msg_type": "service"}
        (found,) = self.ask("subscriber+", subscriber=record)["what"]["publishers"]
        self.tell("subscriber-", node_id=self.node["id"], id=record["id"])
        call = service_wire.NATIVE.encode_call(1, 1, self.timeout(timeout_s), json.dumps(value).encode())
        with self._context.socket(zmq.DEALER) as socket:
            handshakes = Handshakes(socket)
            self.call_at(socket, found["publisher"]["endpoints"][0], call)

            def is_answered() -> bool:
                if handshakes.failed():
                    self.repeat_call(socket, found["publisher"]["endpoints"][0], call)
                return bool(socket.poll(0))

            self.until(is_answered, timeout_s)
            handshakes.close()
            if not socket.poll(0):
                return {"error": "not responding"}
            reply = service_wire.NATIVE.read_reply(socket.recv_multipart()).reply
        return self.result(reply)

    def call_at(self, socket: zmq.Socket[bytes], endpoint: str, call: Sequence[bytes]) -> None:
        socket.connect(endpoint)
        # After a failed handshake a blocking send would never return; the call is then repeated.
        with contextlib.suppress(zmq.Again):
            socket.send_multipart(call, zmq.NOBLOCK)

    def repeat_call(self, socket: zmq.Socket[bytes], endpoint: str, call: Sequence[bytes]) -> None:
        socket.disconnect(endpoint)
        self.call_at(socket, endpoint, call)

    def timeout(self, timeout_s: float) -> float:
        return timeout_s

    def result(self, reply: service_wire.Reply) -> dict[str, Any]:
        if reply.kind != service_wire.CallKind.REPLY:
            return {"error": bytes(reply.data).decode()}
        return {"value": json.loads(bytes(reply.data))}
