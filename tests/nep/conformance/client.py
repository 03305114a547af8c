"""Small client of the native wire that passes every rule; subclasses override single methods.

It is also an adapter: it runs in a thread and reads its requests from a queue. All durations except the
handshake timeout are multiplied by `SCALE`.
"""

from __future__ import annotations

import base64
import json
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from typing import Any

import msgpack  # type: ignore[import-untyped]
import zmq

from nep.errors import WireError
from nep.messages.codecs import codec_by_number, codec_for
from nep.protocol import wire
from nep.protocol.batch import parse_parts
from tests.nep.conformance.client_connections import Connections, Handshakes
from tests.nep.conformance.client_services import Services
from tests.nep.conformance.client_state import Pub, Source, Stream, Sub

SCALE = 0.2
BOUND_S = 0.5
GAP_MAX = 2**32


class Client(Connections, Services):
    """Conforming client and adapter; see the module."""

    def __init__(self, master: str) -> None:
        self.output, self.input = Stream(), Stream()
        """Streams of the tester."""
        self._context: zmq.Context[Any] = zmq.Context()
        self._context.linger = 0
        self.master: zmq.Socket[bytes] = self._context.socket(zmq.DEALER)
        self.master.setsockopt(zmq.RECONNECT_IVL, 20)
        self.master_endpoint = f"tcp://{master}"
        self.master_handshakes = Handshakes(self.master)
        self.master.connect(self.master_endpoint)
        self.key = "00112233445566778899aabbccddeeff"
        self.node: dict[str, Any] = {}
        self.pubs: dict[int, Pub] = {}
        self.subs: dict[int, Sub] = {}
        self.servers = []
        self.counted = []
        self.replies: dict[int, dict[str, Any]] = {}
        self.epoch = self.revision = self.calls = self.numbers = 0
        self.renew_at = 0.0
        self.join_at = 0.0
        self.code: int | None = None
        self.is_done = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    # ---- process interface of an adapter

    def wait(self, timeout_s: float) -> int | None:
        self._thread.join(timeout_s)
        return None if self._thread.is_alive() else self.code

    def stop(self) -> None:
        self.input.close()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self.is_done:
                line = self.input.read_now()
                if line == b"":
                    break
                if line is not None:
                    self._do(json.loads(line))
                self.step()
            self.code = 0
        except BaseException:  # noqa: BLE001 - reported as the exit code
            self.code = 1
        finally:
            self.output.close()
            self.master_handshakes.close()
            for sub in self.subs.values():
                sub.handshakes.close()
            self._context.destroy()

    def say(self, line: Mapping[str, Any]) -> None:
        self.output.write(json.dumps(line).encode() + b"\n")

    def _do(self, request: dict[str, Any]) -> None:
        number = request.pop("id")
        for name, own in (("type", "msg_type"), ("bytes", "data")):
            if name in request:
                request[own] = request.pop(name)
        self.say({"re": number, **getattr(self, "do_" + request.pop("do"))(**request)})

    # ---- requests of the tester

    def do_features(self) -> dict[str, Any]:
        features = [
            "patterns",
            "services",
            "hello1",
            "hello2",
            "hello3",
            "losses",
            "latched",
            "history",
            "statistics",
            "keys",
        ]
        return {"language": "Python", "version": "0", "features": features}

    def do_node(self, name: str) -> dict[str, Any]:
        id = sha256(self.key.encode()).hexdigest()[:16]
        self.node = {"id": id, "name": name, "host": "here", "pid": 1, "key": self.key}
        return {}

    def do_publisher(
        self, topic: str, msg_type: str, latched: bool = False, history: int = 0
    ) -> dict[str, Any]:
        socket = self._context.socket(zmq.XPUB)
        socket.setsockopt(zmq.XPUB_VERBOSE, 1)
        socket.setsockopt(zmq.MAXMSGSIZE, wire.MAX_SUBSCRIPTION_BYTES)
        socket.sndhwm = 50_000
        port = socket.bind_to_random_port("tcp://127.0.0.1", 20000, 50000)
        kept = max(history, 1 if latched else 0)
        record = self.publisher_record(topic, msg_type, port)
        record |= {"latched": True} if kept else {}
        record |= {"history": history} if history else {}
        pub = Pub(record, socket, codec_for(msg_type).number, deque(maxlen=kept))
        number = len(self.pubs) + 1
        self.pubs[number] = pub
        reply = self.ask("publisher+", publisher=record)
        expected = {each["id"]: each["node_name"] for each in reply["what"].get("expected", ())}
        self.wait_for_hellos(pub, set(expected))
        missing = [each for each in expected if each not in pub.hellos]
        if missing:
            self.tell("missing", node_id=self.node["id"], publisher_id=pub.id, subscriber_ids=missing)
        return {"pub": number, "missing": self.missing([expected[each] for each in missing])}

    def missing(self, names: list[str]) -> list[str]:
        return names

    def publisher_record(self, topic: str, msg_type: str, port: int) -> dict[str, Any]:
        endpoints = [f"tcp://127.0.0.1:{port}"]
        return {
            **self.new_id(),
            "topic": topic,
            "msg_type": msg_type,
            "codec": msg_type,
            "endpoints": endpoints,
        }

    def subscriber_record(self, topic: str, msg_type: str) -> dict[str, Any]:
        return {**self.new_id(), "topic": topic, "msg_type": msg_type}

    def new_id(self) -> dict[str, Any]:
        self.numbers += 1
        digest = sha256(f"{self.key}/{self.numbers}".encode()).digest()
        return {"id": int.from_bytes(digest[:8], "little") >> 1 or 1, "number": self.numbers}

    def wait_for_hellos(self, pub: Pub, wanted: set[int]) -> None:
        self.until(lambda: wanted <= pub.hellos.keys(), BOUND_S)

    def do_publish(
        self,
        pub: int,
        value: Any = None,
        text: str | None = None,
        data: str | None = None,
        count: int | None = None,
    ) -> dict[str, Any]:
        for number in range(1, (count or 1) + 1):
            if text is not None:
                payload = text.encode()
            elif data is not None:
                payload = base64.b64decode(data)
            else:
                counted = {**value, "n": number} if count and isinstance(value, dict) else value
                payload = self.encode(self.pubs[pub], counted)
            self.publish(self.pubs[pub], payload)
        return {}

    def encode(self, pub: Pub, value: Any) -> bytes:
        is_packed = pub.record["msg_type"] == "msgpack"
        return msgpack.packb(value) if is_packed else json.dumps(value, ensure_ascii=False).encode()

    def publish(self, pub: Pub, payload: bytes) -> None:
        pub.seq += 1
        pub.bytes_sent += len(payload)
        header = self.header(pub, wire.LATCHED if pub.kept.maxlen else 0, len(payload))
        pub.kept.append((header, payload))
        self.send(pub, header, payload)

    def header(self, pub: Pub, flags: int, size: int = 0) -> bytes:
        return wire.Header(pub.codec, flags, pub.seq, time.time_ns(), pub.id, size).pack()

    def send(self, pub: Pub, header: bytes, payload: bytes) -> None:
        if self.all_read_one_part(pub):
            pub.socket.send(pub.topic + header + payload)
        else:
            pub.socket.send_multipart([pub.topic, header, payload])

    def all_read_one_part(self, pub: Pub) -> bool:
        return not pub.others

    def do_subscriber(
        self, topic: str, msg_type: str, latest: bool = False, pattern: bool = False
    ) -> dict[str, Any]:
        socket = self._context.socket(zmq.SUB)
        socket.sndhwm = socket.rcvhwm = 0
        record = self.subscriber_record(topic, msg_type)
        hello = self.hello(record["id"], topic)
        record |= {"pattern": True} if pattern else {}
        for each in [] if pattern else self.filters(topic, hello):
            socket.subscribe(each)
        sub = Sub(len(self.subs) + 1, record, socket, hello, Handshakes(socket))
        self.subs[sub.number] = sub
        reply = self.ask("subscriber+", subscriber=record)
        self.connect(reply["what"].get("publishers", ()))
        self.wait_for_echoes(sub)
        return {"sub": sub.number}

    def hello(self, id: int, topic: str) -> bytes:
        return wire.hello_part(id, topic, reads_batches=True)

    def filters(self, topic: str, hello: bytes) -> list[bytes]:
        return [wire.topic_part(topic), hello]

    def wait_for_echoes(self, sub: Sub) -> None:
        self.until(lambda: all(each.has_echoed for each in sub.sources.values()), BOUND_S)

    def do_counts(self, sub: int | None = None, pub: int | None = None) -> dict[str, Any]:
        if pub is not None:
            return {"sent": str(self.pubs[pub].seq), "subscribers": len(self.pubs[pub].hellos)}
        assert sub is not None
        return {"received": str(self.subs[sub].received), "lost": str(self.subs[sub].lost)}

    def do_close_publisher(self, pub: int) -> dict[str, Any]:
        closing = self.pubs.pop(pub)
        self.tell_closed(closing)
        self.finish(closing)
        return {}

    def tell_closed(self, pub: Pub) -> None:
        self.tell("publisher-", node_id=self.node["id"], id=pub.id, last_seq=pub.seq)

    def finish(self, pub: Pub) -> None:
        deadline = time.monotonic() + 2.0 * SCALE
        while pub.hellos and time.monotonic() < deadline:
            self.bye(pub)
            self.until(lambda: self.read_filters(pub) or not pub.hellos, 0.05 * SCALE)
        pub.socket.close()

    def bye(self, pub: Pub) -> None:
        for own, _hello in pub.hellos.values():
            pub.socket.send_multipart([own, self.header(pub, wire.BYE)])

    def do_close_subscriber(self, sub: int) -> dict[str, Any]:
        closing = self.subs.pop(sub)
        self.tell("subscriber-", node_id=self.node["id"], id=closing.id)
        closing.handshakes.close()
        closing.socket.close()
        return {}

    def do_close(self) -> dict[str, Any]:
        self.leave()
        pubs, self.pubs = list(self.pubs.values()), {}
        for each in pubs:
            self.finish(each)
        self.is_done = True
        return {}

    def leave(self) -> None:
        self.renew()
        self.tell("leave", node_id=self.node["id"])

    # ---- the master

    def tell(self, do: str, **what: Any) -> int:
        self.calls += 1
        with suppress(zmq.Again):  # no connection
            self.master.send(msgpack.packb({"do": do, "call": self.calls, "what": what}), zmq.DONTWAIT)
        return self.calls

    def ask(self, do: str, **what: Any) -> dict[str, Any]:
        call = self.tell(do, node=self.node, **what)
        self.until(lambda: call in self.replies, 5.0)
        return self.replies.pop(call)

    def renew(self) -> None:
        self.renew_at = time.monotonic() + SCALE
        self.tell(
            "renew",
            node_id=self.node["id"],
            epoch=self.epoch,
            revision=self.revision,
            publishers=[self.publisher_counts(each) for each in (*self.pubs.values(), *self.counted)],
            subscribers=[self.subscriber_counts(each) for each in self.subs.values()],
        )

    def publisher_counts(self, pub: Pub) -> dict[str, Any]:
        return {"id": pub.id, "count": pub.seq, "bytes": pub.bytes_sent, "last_seq": pub.seq}

    def subscriber_counts(self, sub: Sub) -> dict[str, Any]:
        return {"id": sub.id, "received": sub.received, "lost": sub.lost, "problem": sub.problem}

    def join(self) -> None:
        if time.monotonic() >= self.join_at:
            self.join_at = time.monotonic() + 0.1
            publishers = [each.record for each in (*self.pubs.values(), *self.counted)]
            subscribers = [each.record for each in self.subs.values()]
            self.tell(
                "join", node=self.node, epoch=self.epoch, publishers=publishers, subscribers=subscribers
            )

    def follow(self, body: bytes) -> None:
        try:
            answer = msgpack.unpackb(body, strict_map_key=False)
            name, call, what = answer["is"], answer["re"], answer["what"]
        except (ValueError, TypeError, KeyError):
            return
        if call:
            self.replies[call] = answer
        if name == "publisher+":
            self.listed(what)
        elif name == "publisher-":
            self.unlisted(what)
        elif name == "renewed" and what.get("again"):
            self.join()
        elif name == "renewed":
            self.renewed(what)
        elif name == "found":
            self.connect(what.get("publishers", ()))
        if name in {"added", "found"}:
            self.adopt(what)
        elif what["epoch"] != self.epoch and self.epoch:
            self.join()

    def adopt(self, what: Mapping[str, Any]) -> None:
        self.epoch = what["epoch"]
        self.renew_at = self.renew_at or time.monotonic() + SCALE

    def renewed(self, what: Mapping[str, Any]) -> None:
        self.revision = what["revision"]
        self.renew_at = time.monotonic() + self.next_s(what)
        self.connect(self.in_topics(what))
        for id, seq in what.get("last_seqs", {}).items():
            for sub in self.subs.values():
                self.promised(sub, id, seq)

    def next_s(self, what: Mapping[str, Any]) -> float:
        next_s = what.get("next_s")
        return SCALE if next_s is None or next_s == 1.0 else float(next_s)

    def in_topics(self, what: Mapping[str, Any]) -> list[Mapping[str, Any]]:
        return [each for topic in what.get("topics", ()) for each in topic["publishers"]]

    def listed(self, what: Mapping[str, Any]) -> None:
        self.connect([what["publisher"]])
        if what.get("is_new"):
            self.expect_all_of(what["publisher"]["publisher"]["id"])

    def unlisted(self, what: Mapping[str, Any]) -> None:
        for sub in self.subs.values():
            source = sub.sources.get(what["id"])
            if source is not None and what.get("is_closed"):
                source.ends_at = time.monotonic() + 3.0 * SCALE

    # ---- publishers' filters

    def read_filters(self, pub: Pub) -> None:
        while pub.socket.poll(0):
            event = pub.socket.recv()
            is_added, what = event[:1] == b"\1", event[1:]
            hello = wire.parse_hello(what)
            if hello is not None and self.is_for(pub, hello):
                self.note_hello(pub, what, hello, is_added=is_added)
            elif what == pub.topic:
                pub.others = pub.others + 1 if is_added else 0

    def is_for(self, pub: Pub, hello: wire.Hello) -> bool:
        return hello.topic == pub.record["topic"]

    def note_hello(self, pub: Pub, what: bytes, hello: wire.Hello, *, is_added: bool) -> None:
        if not is_added:
            pub.hellos.pop(hello.subscriber, None)
            return
        pub.others -= 1 if hello.reads_one_part and pub.others else 0
        pub.hellos[hello.subscriber] = (what, hello)
        self.greet(pub, what)

    def greet(self, pub: Pub, own: bytes) -> None:
        for header, payload in pub.kept:
            pub.socket.send_multipart([own, header, payload])
        self.echo(pub, own)

    def echo(self, pub: Pub, own: bytes) -> None:
        pub.socket.send_multipart([own, self.header(pub, 0)])

    # ---- subscribers

    def read(self, sub: Sub, parts: list[bytes]) -> None:
        if parts[0] != sub.hello and parts[0].startswith(
            b"\xffhello"
        ):  # pattern subscribers have a hello for each topic
            sub.sources[wire.read_header(parts[1]).publisher].has_echoed = True
            return
        if parts[0] == sub.hello and len(parts) == 2:
            self.notice(sub, wire.read_header(parts[1]))
            return
        is_alone = parts[0] == sub.hello
        for each in self.parsed(
            sub, [wire.topic_part(sub.record["topic"]), *parts[1:]] if is_alone else parts
        ):
            if self.is_its_topic(sub, each.topic):
                self.message(sub, each, is_alone=is_alone)

    def parsed(self, sub: Sub, parts: list[bytes]) -> list[wire.ParsedMessage]:
        return parse_parts(parts)

    def is_its_topic(self, sub: Sub, topic: str) -> bool:
        return topic == sub.record["topic"] or topic in sub.topics

    def message(self, sub: Sub, read: wire.ParsedMessage, *, is_alone: bool) -> None:
        header = read.header
        source = sub.sources.setdefault(header.publisher, Source(""))
        if self.is_leap(source, header.seq):
            raise WireError("leap")
        if is_alone and self.is_heard(source, header.seq):
            return
        if header.seq in source.late:
            sub.lost -= self.found_again()
        elif source.last is not None and header.seq > source.last:
            sub.lost += self.gap(header.seq - source.last - 1)
        source.last = max(source.last or 0, header.seq) if source.last is not None else header.seq
        sub.received += 1
        self.deliver(sub, read)

    def is_leap(self, source: Source, seq: int) -> bool:
        return source.last is not None and seq - source.last > GAP_MAX

    def is_heard(self, source: Source, seq: int) -> bool:
        return source.last is not None and seq <= source.last

    def gap(self, missing: int) -> int:
        return missing

    def found_again(self) -> int:
        return 1

    def deliver(self, sub: Sub, read: wire.ParsedMessage) -> None:
        header, payload = read.header, bytes(read.payload)
        codec = codec_by_number(header.codec)
        assert codec is not None
        event = {
            "event": "message",
            "sub": sub.number,
            "topic": read.topic,
            "codec": codec.name,
            "seq": str(header.seq),
            "stamp_ns": str(header.stamp_ns),
            "publisher": str(header.publisher),
            "payload": base64.b64encode(payload).decode(),
        }
        if codec.name != "bytes":
            try:
                event["value"] = self.decode(codec.name, payload)
                json.dumps(event["value"])
            except (ValueError, RecursionError):
                event.pop("value", None)
        self.say(event)

    def decode(self, codec: str, payload: bytes) -> Any:
        if codec == "msgpack":
            return msgpack.unpackb(payload)
        return payload.decode() if codec == "string" else json.loads(payload)

    def notice(self, sub: Sub, header: wire.Header) -> None:
        source = sub.sources.setdefault(header.publisher, Source(""))
        if header.flags & wire.BYE:
            self.reached(sub, source, self.lost_at_bye(source, header.seq))
            self.leave_source(sub, header.publisher)
            return
        self.reached(sub, source, self.lost_at_echo(source, header.seq))
        if self.is_answered(source):
            self.tell_read(sub, header)
        source.has_echoed = True

    def lost_at_bye(self, source: Source, seq: int) -> int:
        return seq

    def lost_at_echo(self, source: Source, seq: int) -> int:
        return seq

    def is_answered(self, source: Source) -> bool:
        return source.has_echoed

    def tell_read(self, sub: Sub, header: wire.Header) -> None:
        answer = wire.acknowledgement_part(wire.Acknowledgement(sub.id, header.publisher, header.seq, 2**30))
        sub.socket.subscribe(answer)
        sub.socket.unsubscribe(answer)

    def reached(self, sub: Sub, source: Source, seq: int) -> None:
        if source.last is not None and seq > source.last:
            sub.lost += seq - source.last
        source.last = seq if source.last is None else max(source.last, seq)

    def promised(self, sub: Sub, publisher: int, seq: int) -> None:
        source = sub.sources.get(publisher)
        if source is None or source.last is None:
            return
        if source.promised > source.last:
            source.late = range(source.last + 1, source.promised + 1)
            self.reached(sub, source, source.promised)
        source.promised = seq

    def leave_source(self, sub: Sub, publisher: int) -> None:
        source = sub.sources.pop(publisher)
        if source.endpoint:
            sub.socket.disconnect(source.endpoint)

    def refuse(self, sub: Sub, error: WireError) -> None:
        sub.problem = error.reason

    # ---- event loop

    def step(self) -> None:
        now = time.monotonic()
        if self.epoch and now >= self.renew_at:
            self.renew()
        poller = zmq.Poller()
        for socket in (
            self.master,
            *self.servers,
            *(each.socket for each in (*self.pubs.values(), *self.subs.values())),
        ):
            poller.register(socket, zmq.POLLIN)
        poller.poll(2)
        while self.master.poll(0):
            self.follow(self.master.recv())
        if self.master_handshakes.failed():
            self.reconnect_master()
        for server in self.servers:
            while server.poll(0):
                self.serve(server)
        for pub in list(self.pubs.values()):
            self.read_filters(pub)
        for sub in list(self.subs.values()):
            self.read_all(sub, now)

    def read_all(self, sub: Sub, now: float) -> None:
        while sub.socket.poll(0):
            try:
                self.read(sub, sub.socket.recv_multipart())
            except WireError as error:
                self.refuse(sub, error)
        if failed := sub.handshakes.failed():
            self.fix(sub, failed)
        for each, source in list(sub.sources.items()):
            if source.ends_at is not None and now >= source.ends_at:
                self.leave_source(sub, each)

    def until(self, is_met: Callable[[], bool], timeout_s: float) -> None:
        deadline = time.monotonic() + timeout_s
        while not is_met() and time.monotonic() < deadline:
            self.step()
