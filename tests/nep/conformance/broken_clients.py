"""Clients with one deliberate error each: `BROKEN` maps each rule to a client that breaks it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgpack  # type: ignore[import-untyped]
import zmq

from nep.errors import WireError
from nep.protocol import service_wire, wire
from nep.protocol.batch import encode_batch
from tests.nep.conformance.client import Client
from tests.nep.conformance.client_state import Pub, Source, Sub

BROKEN: dict[str, type[Client]] = {}


def breaks(rule: str) -> Callable[[type[Client]], type[Client]]:
    """Decorator that registers the client that breaks a rule."""

    def register(client: type[Client]) -> type[Client]:
        assert rule not in BROKEN
        BROKEN[rule] = client
        return client

    return register


# ---- registration


@breaks("node-record")
class NamelessNode(Client):
    def do_node(self, name: str) -> dict[str, Any]:
        return super().do_node(name + "!")


@breaks("node-key")
class IdsOutOfOrder(Client):
    def publisher_record(self, topic: str, msg_type: str, port: int) -> dict[str, Any]:
        record = super().publisher_record(topic, msg_type, port)
        return {**record, "number": record["number"] + 1}


@breaks("publisher-record")
class CodecAsNumber(Client):
    def publisher_record(self, topic: str, msg_type: str, port: int) -> dict[str, Any]:
        return {**super().publisher_record(topic, msg_type, port), "codec": 1}


@breaks("publisher-port")
class PortOfTheOriginal(Client):
    def publisher_record(self, topic: str, msg_type: str, port: int) -> dict[str, Any]:
        return {**super().publisher_record(topic, msg_type, port), "endpoints": ["tcp://127.0.0.1:9001"]}


@breaks("subscriber-record")
class SubscriberWithoutType(Client):
    def subscriber_record(self, topic: str, msg_type: str) -> dict[str, Any]:
        return {**super().subscriber_record(topic, msg_type), "msg_type": "json"}


@breaks("request-form")
class OneCallNumber(Client):
    def tell(self, do: str, **what: Any) -> int:
        self.calls = 0
        return super().tell(do, **what)


# ---- handshake


@breaks("hello-after-topic")
class PrefixFilter(Client):
    def filters(self, topic: str, hello: bytes) -> list[bytes]:
        return [topic.encode(), hello]


@breaks("hello-form")
class HelloInCapitals(Client):
    def hello(self, id: int, topic: str) -> bytes:
        return b"\xffhello3/" + b"%016X" % id + b"/" + topic.encode()


@breaks("echo")
class EchoWithoutSeq(Client):
    def echo(self, pub: Pub, own: bytes) -> None:
        pub.socket.send_multipart([own, wire.Header(1, 0, 0, 1, pub.id).pack()])


@breaks("foreign-hello")
class GreetsEverybody(Client):
    def is_for(self, pub: Pub, hello: wire.Hello) -> bool:
        return True


@breaks("first-message")
class NeverWaits(Client):
    def wait_for_hellos(self, pub: Pub, wanted: set[int]) -> None:
        pass


@breaks("new-pub-bounded")
class WaitsForEver(Client):
    def wait_for_hellos(self, pub: Pub, wanted: set[int]) -> None:
        self.until(lambda: wanted <= pub.hellos.keys(), 3.5)


@breaks("missing")
class NamesNobody(Client):
    def missing(self, names: list[str]) -> list[str]:
        return []


@breaks("new-sub-waits")
class NeverWaitsForEchoes(Client):
    def wait_for_echoes(self, sub: Sub) -> None:
        pass


@breaks("new-sub-bounded")
class WaitsForEchoesForEver(Client):
    def wait_for_echoes(self, sub: Sub) -> None:
        self.until(lambda: all(each.has_echoed for each in sub.sources.values()), 3.5)


@breaks("push-connects")
class IgnoresPushes(Client):
    def follow(self, body: bytes) -> None:
        if b"publisher+" not in body[:20]:
            super().follow(body)

    def in_topics(self, what: Mapping[str, Any]) -> list[Mapping[str, Any]]:
        return []


@breaks("latched")
class LatchedAfterTheEcho(Client):
    def greet(self, pub: Pub, own: bytes) -> None:
        self.echo(pub, own)
        for header, payload in pub.kept:
            pub.socket.send_multipart([own, header, payload])


@breaks("history")
class NewestFirst(Client):
    def greet(self, pub: Pub, own: bytes) -> None:
        for header, payload in reversed(pub.kept):
            pub.socket.send_multipart([own, header, payload])
        self.echo(pub, own)


# ---- messages


@breaks("three-parts")
class OnePartForEverybody(Client):
    def all_read_one_part(self, pub: Pub) -> bool:
        return True


@breaks("batches-to-readers")
class BatchesForEverybody(Client):
    def send(self, pub: Pub, header: bytes, payload: bytes) -> None:
        form = wire.encode_form(pub.codec, 0)
        pub.socket.send(encode_batch(pub.topic, form, pub.seq, pub.id, [time.time_ns()], [payload]))


@breaks("forms")
class SkipsAMessage(Client):
    def send(self, pub: Pub, header: bytes, payload: bytes) -> None:
        if pub.seq != 100:
            super().send(pub, header, payload)


@breaks("header")
class WrongCodec(Client):
    def header(self, pub: Pub, flags: int, size: int = 0) -> bytes:
        return wire.Header(1, flags, pub.seq, time.time_ns(), pub.id, size).pack()


@breaks("payload")
class JsonInLatin1(Client):
    def encode(self, pub: Pub, value: Any) -> bytes:
        return json.dumps(value, ensure_ascii=False).encode("latin-1")


@breaks("seq-unheard")
class CountsHeardOnly(Client):
    def publish(self, pub: Pub, payload: bytes) -> None:
        if pub.hellos or pub.others:
            super().publish(pub, payload)


@breaks("stamp")
class StampInSeconds(Client):
    def header(self, pub: Pub, flags: int, size: int = 0) -> bytes:
        return wire.Header(pub.codec, flags, pub.seq, int(time.time()), pub.id, size).pack()


# ---- receiving


@breaks("reads-parts")
class ReadsOnePartOnly(Client):
    def parsed(self, sub: Sub, parts: list[bytes]) -> list[wire.ParsedMessage]:
        return super().parsed(sub, parts) if len(parts) == 1 else []


@breaks("reads-one-part")
class ReadsPartsOnly(Client):
    def parsed(self, sub: Sub, parts: list[bytes]) -> list[wire.ParsedMessage]:
        return super().parsed(sub, parts) if len(parts) > 1 else []


@breaks("reads-batches")
class ReadsTheFirstOfABatch(Client):
    def parsed(self, sub: Sub, parts: list[bytes]) -> list[wire.ParsedMessage]:
        return super().parsed(sub, parts)[:1]


@breaks("reads-alone")
class IgnoresWhatIsAlone(Client):
    def message(self, sub: Sub, read: wire.ParsedMessage, *, is_alone: bool) -> None:
        if not is_alone:
            super().message(sub, read, is_alone=False)


@breaks("latched-once")
class HearsLatchedTwice(Client):
    def is_heard(self, source: Source, seq: int) -> bool:
        return False


@breaks("other-topics")
class ComparesTheBeginning(Client):
    def filters(self, topic: str, hello: bytes) -> list[bytes]:
        return [topic.encode(), hello]

    def is_its_topic(self, sub: Sub, topic: str) -> bool:
        return topic.startswith(sub.record["topic"])


@breaks("read")
class NeverSaysWhatItRead(Client):
    def tell_read(self, sub: Sub, header: wire.Header) -> None:
        pass


@breaks("receives-in-order")
class DeliversTwice(Client):
    def deliver(self, sub: Sub, read: wire.ParsedMessage) -> None:
        super().deliver(sub, read)
        if read.header.seq == 250:
            super().deliver(sub, read)


# ---- losses


@breaks("lost-gap")
class CountsNoGaps(Client):
    def gap(self, missing: int) -> int:
        return 0


@breaks("lost-echo")
class IgnoresEchoes(Client):
    def lost_at_echo(self, source: Source, seq: int) -> int:
        return source.last or 0

    def gap(self, missing: int) -> int:
        return 0


@breaks("lost-bye")
class IgnoresTheSeqOfAByes(Client):
    def lost_at_bye(self, source: Source, seq: int) -> int:
        return source.last or 0


@breaks("lost-last-seq")
class IgnoresLastSeqs(Client):
    def promised(self, sub: Sub, publisher: int, seq: int) -> None:
        pass


@breaks("lost-late")
class LostForGood(Client):
    def found_again(self) -> int:
        return 0


@breaks("lost-leap")
class LosesMillions(Client):
    def is_leap(self, source: Source, seq: int) -> bool:
        return False


@breaks("lost-new")
class CountsFromTheFirstReceived(Client):
    def expect_all_of(self, publisher: int) -> None:
        pass


@breaks("lost-unreachable")
class CountsOnceConnected(Client):
    def promised(self, sub: Sub, publisher: int, seq: int) -> None:
        if publisher in sub.sources and sub.sources[publisher].has_echoed:
            super().promised(sub, publisher, seq)


# ---- closing


@breaks("bye")
class ClosesWithoutBye(Client):
    def bye(self, pub: Pub) -> None:
        pass


@breaks("bye-again")
class SaysByeOnce(Client):
    def finish(self, pub: Pub) -> None:
        self.bye(pub)
        self.until(lambda: False, 0.2)
        pub.socket.close()


@breaks("bye-disconnects")
class StaysAfterTheBye(Client):
    def leave_source(self, sub: Sub, publisher: int) -> None:
        sub.sources[publisher].ends_at = None


@breaks("closed-is-heard")
class LeavesAtOnce(Client):
    def unlisted(self, what: Mapping[str, Any]) -> None:
        for sub in self.subs.values():
            if what.get("is_closed") and what["id"] in sub.sources:
                self.leave_source(sub, what["id"])


@breaks("closed-is-left")
class NeverLeaves(Client):
    def unlisted(self, what: Mapping[str, Any]) -> None:
        pass


@breaks("lapsed-is-heard")
class LeavesWhatLapsed(Client):
    def unlisted(self, what: Mapping[str, Any]) -> None:
        for sub in self.subs.values():
            if not what.get("is_closed") and what["id"] in sub.sources:
                self.leave_source(sub, what["id"])


@breaks("subscriber-closes")
class SubscriberStaysListed(Client):
    def do_close_subscriber(self, sub: int) -> dict[str, Any]:
        closing = self.subs.pop(sub)
        closing.handshakes.close()
        closing.socket.close()
        return {}


@breaks("leave")
class LeavesWithoutRenewal(Client):
    def leave(self) -> None:
        self.tell("leave", node_id=self.node["id"])


# ---- lease


@breaks("renew")
class RenewsWithAnEpochOfItsOwn(Client):
    def tell(self, do: str, **what: Any) -> int:
        if do == "renew":
            what["epoch"] = 1
        return super().tell(do, **what)

    def join(self) -> None:
        pass


@breaks("statistics")
class TellsNoBytes(Client):
    def publisher_counts(self, pub: Pub) -> dict[str, Any]:
        return {**super().publisher_counts(pub), "bytes": 0}


@breaks("next-s")
class RenewsAsItLikes(Client):
    def next_s(self, what: Mapping[str, Any]) -> float:
        return super().next_s({})


@breaks("again")
class NeverJoins(Client):
    def join(self) -> None:
        pass


@breaks("restart")
class ForgetsSubscribers(Client):
    def adopt(self, what: Mapping[str, Any]) -> None:
        if self.epoch and what["epoch"] != self.epoch:
            for sub in self.subs.values():
                for each in list(sub.sources):
                    self.leave_source(sub, each)
        super().adopt(what)


@breaks("other-socket-at-master")
class ConnectsToTheMasterOnce(Client):
    def reconnect_master(self) -> None:
        pass


@breaks("renewed-topics")
class HearsPushesOnly(Client):
    def in_topics(self, what: Mapping[str, Any]) -> list[Mapping[str, Any]]:
        return []


@breaks("unknown-answers")
class EndsOnUnknownAnswers(Client):
    def follow(self, body: bytes) -> None:
        assert msgpack.unpackb(body, strict_map_key=False)["is"] != "later"
        super().follow(body)


# ---- limits


@breaks("malformed")
class EndsOnMalformedParts(Client):
    def refuse(self, sub: Sub, error: WireError) -> None:
        raise SystemExit(error)


@breaks("malformed-named")
class NamesNoProblem(Client):
    def refuse(self, sub: Sub, error: WireError) -> None:
        pass


@breaks("deep")
class EndsOnDeepPayloads(Client):
    def decode(self, codec: str, payload: bytes) -> Any:
        try:
            return super().decode(codec, payload)
        except RecursionError as error:
            raise SystemExit from error


@breaks("undecodable")
class EndsOnUndecodablePayloads(Client):
    def decode(self, codec: str, payload: bytes) -> Any:
        try:
            return super().decode(codec, payload)
        except ValueError as error:
            raise SystemExit from error


@breaks("large")
class OneMegabyteAtMost(Client):
    def deliver(self, sub: Sub, read: wire.ParsedMessage) -> None:
        if len(read.payload) < 2**20:
            super().deliver(sub, read)


@breaks("unknown-filters")
class EndsOnUnknownFilters(Client):
    def read_filters(self, pub: Pub) -> None:
        if pub.socket.poll(0) and pub.hellos:
            pub.socket.close()
            self.pubs = {number: each for number, each in self.pubs.items() if each is not pub}
            return
        super().read_filters(pub)


# ---- connections


@breaks("connect-once")
class ConnectsTwice(Client):
    def connect(self, remotes: Any) -> None:
        for remote in remotes:
            for sub in self.subs.values():
                if remote["publisher"]["id"] in sub.sources and not sub.problem:
                    sub.problem = "connected twice"
                    self.deliver_twice = True
        super().connect(remotes)

    deliver_twice = False

    def deliver(self, sub: Sub, read: wire.ParsedMessage) -> None:
        for _turn in range(1 + self.deliver_twice):
            super().deliver(sub, read)


@breaks("several-publishers")
class HearsTheFirstOnly(Client):
    def connect(self, remotes: Any) -> None:
        super().connect(
            each
            for each in remotes
            if not any(
                sub.sources for sub in self.subs.values() if sub.record["topic"] == each["publisher"]["topic"]
            )
        )


@breaks("reconnect")
class ConnectsOnce(Client):
    def move(self, sub: Sub, source: Source, endpoint: str) -> None:
        sub.socket.setsockopt(zmq.RECONNECT_IVL, -1)
        super().move(sub, source, endpoint)


@breaks("other-socket-at-publisher")
class LeavesConnectingToLibzmq(Client):
    def fix(self, sub: Sub, failed: set[str]) -> None:
        pass


@breaks("endpoint-change")
class KeepsTheFirstEndpoint(Client):
    def move(self, sub: Sub, source: Source, endpoint: str) -> None:
        if not source.endpoint:
            super().move(sub, source, endpoint)


@breaks("unusable-endpoint")
class EndsOnBadEndpoints(Client):
    def unusable(self, sub: Sub, endpoint: str) -> None:
        raise SystemExit(endpoint)


@breaks("subscriber-lost")
class WaitsForTheLost(Client):
    def do_close_publisher(self, pub: int) -> dict[str, Any]:
        self.until(lambda: False, 3.5)
        return super().do_close_publisher(pub)


# ---- services and patterns


@breaks("service-record")
class ServiceOfAnotherType(Client):
    def service_type(self) -> str:
        return "json"


@breaks("service-answer")
class AnswersAsRefused(Client):
    def answer(self, call: service_wire.ReceivedCall) -> service_wire.Reply:
        return super().answer(call)._replace(kind=service_wire.CallKind.REJECTED)


@breaks("service-malformed")
class EndsOnMalformedCalls(Client):
    def refuse_call(self, error: WireError) -> None:
        raise SystemExit(error)


@breaks("service-call")
class CallsForEver(Client):
    def timeout(self, timeout_s: float) -> float:
        return 1000.0


@breaks("other-socket-at-server")
class ConnectsToTheServerOnce(Client):
    def repeat_call(self, socket: zmq.Socket[bytes], endpoint: str, call: Sequence[bytes]) -> None:
        pass


@breaks("service-error")
class TakesErrorsForAnswers(Client):
    def result(self, reply: service_wire.Reply) -> dict[str, Any]:
        return {"value": json.loads(bytes(reply.data))}


@breaks("pattern")
class FiltersByItsPattern(Client):
    def do_subscriber(
        self, topic: str, msg_type: str, latest: bool = False, pattern: bool = False
    ) -> dict[str, Any]:
        return super().do_subscriber(topic, msg_type, latest)
