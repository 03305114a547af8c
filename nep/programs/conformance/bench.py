"""The bench: one adapter, the master and the peers that it meets, all pumped in one thread."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import zmq

from nep.i18n import _
from nep.masters.graph import Outgoing
from nep.programs.conformance.adapter import Adapter, AdapterError, AdapterStreams
from nep.programs.conformance.peers import ScriptedPublisher, ScriptedSubscriber
from nep.programs.conformance.scripted_master import HeardRequest, ScriptedMaster
from nep.programs.conformance.verdict import broken
from nep.protocol.requests import AddPublisher, AddSubscriber, Leave, PublisherCame

__all__ = ["Bench", "Start"]

Start = Callable[[str], AdapterStreams]
"""Starts an adapter that finds the master at this address."""
_POLL_MS = 2
_ANSWER_S = 15.0


class Bench:
    """See the module. `scale` shortens all times of the wire, for a client that shortens them as well."""

    def __init__(self, start: Start, scale: float = 1.0) -> None:
        self.scale = scale
        self._context: zmq.Context[Any] = zmq.Context()
        self._context.linger = 0
        self.master = ScriptedMaster(self._context, self._pushed)
        self.publishers: list[ScriptedPublisher] = []
        self.subscribers: list[ScriptedSubscriber] = []
        self.connect_delay_s: float | None = 0.0
        """How long the tester's subscribers take to connect; None: they never do."""
        self._connecting: list[tuple[float, ScriptedSubscriber, str]] = []
        self._made: list[tuple[str, Mapping[str, Any]]] = []
        self._numbers = itertools.count(1)
        try:
            self.adapter = Adapter(start(self.master.address))
        except BaseException:
            self._release()
            raise
        try:
            self.features = self.ask("features")
            self.node_name = "conformance"
            self.ask("node", name=self.node_name)
        except BaseException:
            self.close()
            raise

    # ---- time

    def pump(self) -> None:
        """Let everybody do what there is to do."""
        self.master.pump()
        for peer in self._peers():
            peer.pump()
        now = time.monotonic()
        for due in [each for each in self._connecting if each[0] <= now]:
            self._connecting.remove(due)
            due[1].connect(due[2])
        self.adapter.pump()

    def until(self, is_met: Callable[[], bool], timeout_s: float) -> bool:
        """Pump until something is so; False when it is not within `timeout_s`, which is not scaled."""
        deadline = time.monotonic() + timeout_s
        while True:
            self.pump()
            if is_met():
                return True
            if time.monotonic() >= deadline:
                return False
            self._wait()

    def _wait(self) -> None:
        poller = zmq.Poller()
        sockets = [each.socket for each in self._peers()]
        for socket in (*self.master.sockets, *sockets):
            if not socket.closed:
                poller.register(socket, zmq.POLLIN)
        poller.poll(_POLL_MS)

    def wait(self, seconds: float) -> None:
        """Pump for some time, which is scaled."""
        self.until(lambda: False, seconds * self.scale)

    def need(self, is_met: Callable[[], bool], what: str, timeout_s: float = 5.0) -> None:
        """Pump until something is so. Raises `BrokenRuleError`; `what` is a name on the wire."""
        if not self.until(is_met, max(timeout_s * self.scale, 2.0 if self.scale < 1 else timeout_s)):
            raise broken(_("'{what}' did not come within {seconds:g} s").format(what=what, seconds=timeout_s))

    # ---- the adapter

    def ask(self, do: str, **members: object) -> Mapping[str, Any]:
        """Let the adapter do something, and return its reply. Raises `AdapterError`."""
        return self.finish(self.adapter.begin(do, **members), do)

    def finish(self, number: int, do: str) -> Mapping[str, Any]:
        """Wait for the reply to a request that was begun."""
        found: list[Mapping[str, Any]] = []

        def has_come() -> bool:
            reply = self.adapter.reply(number)
            if reply is not None:
                found.append(reply)
            return reply is not None or self.adapter.has_ended

        if not self.until(has_come, _ANSWER_S):
            raise AdapterError(
                _("the adapter did not answer '{do}' within {seconds:g} s").format(do=do, seconds=_ANSWER_S)
            )
        if not found:
            raise AdapterError(_("the adapter ended while it was asked for '{do}'").format(do=do))
        return found[0]

    def new_topic(self) -> str:
        """Return a topic that nobody has had."""
        return f"/check/{next(self._numbers)}"

    def new_pub(self, topic: str, msg_type: str = "json", **members: object) -> int:
        """Let the adapter make a publisher; its number there."""
        reply = self.ask("publisher", topic=topic, type=msg_type, **members)
        return self._keep("close_publisher", "pub", reply)

    def new_sub(self, topic: str, msg_type: str = "json", **members: object) -> int:
        """Let the adapter make a subscriber; its number there."""
        reply = self.ask("subscriber", topic=topic, type=msg_type, **members)
        return self._keep("close_subscriber", "sub", reply)

    def _keep(self, closes: str, name: str, reply: Mapping[str, Any]) -> int:
        number = reply.get(name)
        if not isinstance(number, int):
            raise AdapterError(_("the adapter's reply has no '{name}'").format(name=name))
        self._made.append((closes, {name: number}))
        return number

    def close_pub(self, number: int) -> None:
        """Let the adapter close a publisher."""
        self._close("close_publisher", {"pub": number})

    def close_sub(self, number: int) -> None:
        """Let the adapter close a subscriber."""
        self._close("close_subscriber", {"sub": number})

    def _close(self, do: str, members: Mapping[str, Any]) -> None:
        self._made = [each for each in self._made if each != (do, members)]
        self.ask(do, **members)

    def events(self, sub: int) -> list[Mapping[str, Any]]:
        """Return the messages that this subscriber of the adapter has received."""
        return [each for each in self.adapter.events if each.get("sub") == sub]

    def counts(self, sub: int) -> tuple[int, int]:
        """Return what a subscriber of the adapter has received and lost."""
        reply = self.ask("counts", sub=sub)
        return int(reply.get("received", -1)), int(reply.get("lost", -1))

    # ---- what the master hears

    def requests(self, do: str) -> list[HeardRequest]:
        """Return the requests of this name so far."""
        return [each for each in self.master.heard if each.do == do]

    def request(self, do: str, field: str, id: object) -> HeardRequest:
        """Wait for the request of this name with this id in a field, and return it."""
        self.need(lambda: any(each.what.get(field) == id for each in self.requests(do)), do)
        return next(each for each in self.requests(do) if each.what.get(field) == id)

    def record(self, kind: str, topic: str) -> Mapping[str, Any]:
        """Return the newest record of the adapter's publisher or subscriber of a topic."""
        for each in reversed(self.requests(f"{kind}+")):
            record = each.what.get(kind)
            if isinstance(record, dict) and record.get("topic") == topic:
                return record
        raise broken(_("'{what}' did not come").format(what=f"{kind}+ {topic}"))

    @property
    def node_id(self) -> str:
        """The id of the adapter's node."""
        for each in reversed(self.master.heard):
            node = each.what.get("node")
            if isinstance(node, dict):
                return str(node.get("id"))
        raise broken(_("'{what}' did not come").format(what="node"))

    def renewal(self, after: int, timeout_s: float = 5.0) -> HeardRequest:
        """Wait for a renewal after so many requests, and return it."""
        self.need(lambda: any(each.do == "renew" for each in self.master.heard[after:]), "renew", timeout_s)
        return next(each for each in self.master.heard[after:] if each.do == "renew")

    # ---- peers

    def new_socket(self, kind: int) -> zmq.Socket[bytes]:
        """Return a socket, which the rule closes."""
        socket: zmq.Socket[bytes] = self._context.socket(kind)
        socket.linger = 0
        return socket

    def publisher(
        self, topic: str, msg_type: str = "json", *, echoes: bool = True, is_listed: bool = True
    ) -> ScriptedPublisher:
        """Return a publisher of the tester, which the master names to the adapter."""
        made = ScriptedPublisher(self._context, topic, msg_type, echoes=echoes)
        self.publishers.append(made)
        if is_listed:
            self.list_publisher(made)
        return made

    def list_publisher(self, made: ScriptedPublisher) -> None:
        """Register a publisher of the tester."""
        self.master.submit(AddPublisher(made.node, made.record))

    def subscriber(
        self, topic: str, msg_type: str = "json", *, level: int | None = 3, endpoint: str | None = None
    ) -> ScriptedSubscriber:
        """Return a subscriber of the tester: the master names it, or it connects to `endpoint` at once."""
        made = ScriptedSubscriber(self._context, topic, msg_type, level)
        self.subscribers.append(made)
        if endpoint is None:
            self.master.submit(AddSubscriber(made.node, made.record))
        else:
            made.connect(endpoint)
        return made

    def heard_publisher(self, topic: str, msg_type: str = "json") -> tuple[ScriptedPublisher, int]:
        """Return a publisher of the tester, and the adapter's subscriber that hears it."""
        publisher = self.publisher(topic, msg_type)
        sub = self.new_sub(topic, msg_type)
        self.need(lambda: bool(publisher.hellos), "hello")
        return publisher, sub

    def _pushed(self, each: Outgoing) -> None:
        if isinstance(each.answer, PublisherCame) and self.connect_delay_s is not None:
            record = each.answer.publisher.publisher
            due = time.monotonic() + self.connect_delay_s * self.scale
            for subscriber in self.subscribers:
                if subscriber.topic == record.topic and subscriber.node.id == each.to:
                    self._connecting.append((due, subscriber, record.endpoints[0]))

    # ---- between rules and at the end

    def forget(self) -> None:
        """Leave to the rule what it has made; it closes it itself."""
        self._made.clear()

    def clear(self) -> None:
        """Close what a rule has made; the adapter goes on."""
        self.master.change = lambda _heard, reply: reply
        self.connect_delay_s = 0.0
        self._connecting.clear()
        for peer in self._peers():
            if peer.node.id in self.master.graph.members:
                self.master.submit(Leave(peer.node.id))
        for publisher in self.publishers:
            publisher.pump()
            publisher.bye()
        for subscriber in self.subscribers:
            subscriber.socket.close(0)
        self.subscribers.clear()
        while self._made:
            do, members = self._made.pop()
            self.ask(do, **members)
        for publisher in self.publishers:
            publisher.socket.close(0)
        self.publishers.clear()
        self.adapter.events.clear()

    def _peers(self) -> Iterator[ScriptedPublisher | ScriptedSubscriber]:
        yield from self.publishers
        yield from self.subscribers

    def close(self) -> None:
        """End the adapter and close everything."""
        try:
            self.adapter.end()
        finally:
            self._release()

    def _release(self) -> None:
        for peer in self._peers():
            peer.socket.close(0)
        self.master.stop()
        self._context.term()
