"""Test bench: one adapter with a simulated master and peers, all served by one thread."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from typing import Any

import zmq

from nep.i18n import _
from nep.masters.graph import OutgoingMessage
from nep.programs.conformance.adapter import Adapter, AdapterError, AdapterStreams
from nep.programs.conformance.other_socket import OtherSocket
from nep.programs.conformance.peers import ScriptedPublisher, ScriptedSubscriber
from nep.programs.conformance.scripted_master import RecordedRequest, ScriptedMaster
from nep.programs.conformance.verdict import broken_rule_error
from nep.protocol.requests import AddPublisher, AddSubscriber, Leave, PublisherAdded

AdapterStarter = Callable[[str], AdapterStreams]
"""Function that starts an adapter, given the address of the master."""
_POLL_MS = 2
_REPLY_TIMEOUT_S = 15.0
_BYE_INTERVAL_S = 0.05


class Bench:
    """Test bench that runs the checks of rules.

    Args:
        start: Starts the adapter, given the address of the master.
        scale: Factor for all times of the wire; the adapter must use the same factor.
    """

    def __init__(self, start: AdapterStarter, scale: float = 1.0) -> None:
        self.scale = scale
        self._context: zmq.Context[Any] = zmq.Context()
        self._context.linger = 0
        self.master = ScriptedMaster(self._context, self._on_push)
        self.publishers: list[ScriptedPublisher] = []
        self.subscribers: list[ScriptedSubscriber] = []
        self.connect_delay_s: float | None = 0.0
        """Delay before the tester's subscribers connect to a listed publisher; None if they don't connect."""
        self._pending_connections: list[tuple[float, ScriptedSubscriber, str]] = []
        self._close_requests: list[tuple[str, Mapping[str, Any]]] = []
        self._topic_numbers = itertools.count(1)
        try:
            self.adapter = Adapter(start(self.master.address))
        except BaseException:
            self._release()
            raise
        try:
            self.features = self.call("features")
            self.node_name = "conformance"
            self.call("node", name=self.node_name)
        except BaseException:
            self.close()
            raise

    # ---- time

    def pump(self) -> None:
        """Process all pending input of the master, the peers and the adapter.

        Also connects the tester's subscribers whose delay (`connect_delay_s`) has passed.
        """
        self.master.pump()
        for peer in self._peers():
            peer.pump()
        now = time.monotonic()
        for connection in [each for each in self._pending_connections if each[0] <= now]:
            self._pending_connections.remove(connection)
            connection[1].connect(connection[2])
        self.adapter.pump()

    def wait_until(self, is_met: Callable[[], bool], timeout_s: float) -> bool:
        """Pump until a condition is met; return False if the time limit has passed.

        Args:
            is_met: Condition, evaluated after each pump.
            timeout_s: Time limit in seconds, which is not scaled.
        """
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
        """Pump for `seconds`, multiplied by the scale."""
        self.wait_until(lambda: False, seconds * self.scale)

    def require(self, is_met: Callable[[], bool], event: str, timeout_s: float = 5.0) -> None:
        """Pump until a condition is met.

        Args:
            is_met: Condition, evaluated after each pump.
            event: Name of the expected event, for the error message.
            timeout_s: Time limit in seconds, multiplied by the scale; at least 2 s if the scale is less
                than 1.

        Raises:
            BrokenRuleError: The time limit has passed.
        """
        if not self.wait_until(is_met, max(timeout_s * self.scale, 2.0 if self.scale < 1 else timeout_s)):
            raise broken_rule_error(
                _("no '{what}' within {seconds:g} s").format(what=event, seconds=timeout_s)
            )

    # ---- the adapter

    def call(self, do: str, **members: object) -> Mapping[str, Any]:
        """Send a request to the adapter and return its reply.

        Args:
            do: Name of the request.
            members: Further fields of the request.

        Raises:
            AdapterError: The adapter reported an error, exited or did not reply.
        """
        return self.wait_for_reply(self.adapter.send_request(do, **members), do)

    def wait_for_reply(self, request_id: int, do: str) -> Mapping[str, Any]:
        """Wait for the reply to a request that `Adapter.send_request` sent, and return the reply.

        Args:
            request_id: Id of the request.
            do: Name of the request, for the error message.

        Raises:
            AdapterError: The adapter reported an error, exited or did not reply.
        """
        replies: list[Mapping[str, Any]] = []

        def has_finished() -> bool:
            reply = self.adapter.reply(request_id)
            if reply is not None:
                replies.append(reply)
            return reply is not None or self.adapter.has_ended

        if not self.wait_until(has_finished, _REPLY_TIMEOUT_S):
            raise AdapterError(
                _("the adapter didn't reply to '{do}' within {seconds:g} s").format(
                    do=do, seconds=_REPLY_TIMEOUT_S
                )
            )
        if not replies:
            raise AdapterError(_("the adapter exited before it replied to '{do}'").format(do=do))
        return replies[0]

    def new_topic(self) -> str:
        """Return the name of an unused topic."""
        return f"/check/{next(self._topic_numbers)}"

    def new_pub(self, topic: str, msg_type: str = "json", **members: object) -> int:
        """Open a publisher in the adapter and return its id.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            members: Further fields of the request.

        Raises:
            AdapterError: The adapter reported an error, exited, or did not reply with an id.
        """
        reply = self.call("publisher", topic=topic, type=msg_type, **members)
        return self._add_close_request("close_publisher", "pub", reply)

    def new_sub(self, topic: str, msg_type: str = "json", **members: object) -> int:
        """Open a subscriber in the adapter and return its id.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            members: Further fields of the request.

        Raises:
            AdapterError: The adapter reported an error, exited, or did not reply with an id.
        """
        reply = self.call("subscriber", topic=topic, type=msg_type, **members)
        return self._add_close_request("close_subscriber", "sub", reply)

    def _add_close_request(self, close_request: str, name: str, reply: Mapping[str, Any]) -> int:
        number = reply.get(name)
        if not isinstance(number, int):
            raise AdapterError(_("the adapter's reply has no '{name}'").format(name=name))
        self._close_requests.append((close_request, {name: number}))
        return number

    def close_pub(self, number: int) -> None:
        """Close a publisher of the adapter."""
        self._close("close_publisher", {"pub": number})

    def close_sub(self, number: int) -> None:
        """Close a subscriber of the adapter."""
        self._close("close_subscriber", {"sub": number})

    def _close(self, do: str, members: Mapping[str, Any]) -> None:
        self._close_requests = [each for each in self._close_requests if each != (do, members)]
        self.call(do, **members)

    def events(self, sub: int) -> list[Mapping[str, Any]]:
        """Return the "message" events of a subscriber of the adapter, oldest first."""
        return [each for each in self.adapter.events if each.get("sub") == sub]

    def counts(self, sub: int) -> tuple[int, int]:
        """Return the received and lost counts of a subscriber of the adapter; -1 if not reported."""
        reply = self.call("counts", sub=sub)
        return int(reply.get("received", -1)), int(reply.get("lost", -1))

    # ---- requests to the master

    def requests(self, do: str) -> list[RecordedRequest]:
        """Return all requests with a given name that the master has received."""
        return [each for each in self.master.received if each.do == do]

    def wait_for_request(self, do: str, field: str, id: object) -> RecordedRequest:
        """Wait for a request of the adapter to the master, and return it.

        Args:
            do: Name of the request.
            field: Field of the request's content that is compared.
            id: Expected value of the field.

        Raises:
            BrokenRuleError: The request didn't arrive in time.
        """
        self.require(lambda: any(each.fields.get(field) == id for each in self.requests(do)), do)
        return next(each for each in self.requests(do) if each.fields.get(field) == id)

    def latest_record(self, kind: str, topic: str) -> Mapping[str, Any]:
        """Return the newest record with which the adapter registered a publisher or subscriber.

        Args:
            kind: "publisher" or "subscriber".
            topic: Topic of the record.

        Raises:
            BrokenRuleError: The master received no such record.
        """
        for request in reversed(self.requests(f"{kind}+")):
            record = request.fields.get(kind)
            if isinstance(record, dict) and record.get("topic") == topic:
                return record
        raise broken_rule_error(_("no '{what}' was received").format(what=f"{kind}+ {topic}"))

    @property
    def node_id(self) -> str:
        """Id of the adapter's node. Raises `BrokenRuleError` if no request has contained its record."""
        for request in reversed(self.master.received):
            node = request.fields.get("node")
            if isinstance(node, dict):
                return str(node.get("id"))
        raise broken_rule_error(_("no '{what}' was received").format(what="node"))

    def wait_for_renewal(self, after: int, timeout_s: float = 5.0) -> RecordedRequest:
        """Wait for a renewal of the adapter's lease, and return the request.

        Args:
            after: Number of received requests to skip.
            timeout_s: Time limit in seconds, scaled as in `require`.

        Raises:
            BrokenRuleError: The renewal didn't arrive in time.
        """
        self.require(
            lambda: any(each.do == "renew" for each in self.master.received[after:]), "renew", timeout_s
        )
        return next(each for each in self.master.received[after:] if each.do == "renew")

    # ---- peers

    def new_socket(self, kind: int) -> zmq.Socket[bytes]:
        """Create a ZeroMQ socket of a type such as `zmq.DEALER`; the caller must close it."""
        socket: zmq.Socket[bytes] = self._context.socket(kind)
        socket.linger = 0
        return socket

    def fail_handshake(self, kind: str, endpoint: str) -> None:
        """Listen at an endpoint as another program's socket until the adapter has connected and disconnected.

        Args:
            kind: Type of socket that the adapter must reject, such as ``PUB``.
            endpoint: Unused endpoint.
        """
        with closing(OtherSocket(endpoint, kind)) as other:
            self.require(other.has_disconnected, "connection", 10.0)

    def create_publisher(
        self, topic: str, msg_type: str = "json", *, should_echo: bool = True, is_listed: bool = True
    ) -> ScriptedPublisher:
        """Create a publisher of the tester.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            should_echo: True to reply to hellos with echoes.
            is_listed: True to register the publisher at the master.
        """
        publisher = ScriptedPublisher(self._context, topic, msg_type, should_echo=should_echo)
        self.publishers.append(publisher)
        if is_listed:
            self.register_publisher(publisher)
        return publisher

    def register_publisher(self, publisher: ScriptedPublisher) -> None:
        """Register a publisher of the tester at the master."""
        self.master.submit(AddPublisher(publisher.node, publisher.record))

    def send_byes(self, publisher: ScriptedPublisher) -> None:
        """Send byes until the adapter has disconnected, as a closing publisher does.

        The master still lists the publisher, so a renewal may make the adapter connect again; the next bye
        then ends that connection too.

        Raises:
            BrokenRuleError: The adapter is still connected after 5 s.
        """
        next_byes = 0.0

        def has_disconnected() -> bool:
            nonlocal next_byes
            now = time.monotonic()
            if publisher.hellos and now >= next_byes:
                next_byes = now + _BYE_INTERVAL_S
                publisher.send_byes()
            return not publisher.hellos

        self.require(has_disconnected, "disconnect")

    def create_subscriber(
        self, topic: str, msg_type: str = "json", *, level: int | None = 3, endpoint: str | None = None
    ) -> ScriptedSubscriber:
        """Create a subscriber of the tester.

        Args:
            topic: Name of the topic.
            msg_type: Message type.
            level: Hello level; None to send no hello.
            endpoint: Endpoint to connect to; None to register at the master instead.
        """
        subscriber = ScriptedSubscriber(self._context, topic, msg_type, level)
        self.subscribers.append(subscriber)
        if endpoint is None:
            self.master.submit(AddSubscriber(subscriber.node, subscriber.record))
        else:
            subscriber.connect(endpoint)
        return subscriber

    def create_subscribed_publisher(
        self, topic: str, msg_type: str = "json"
    ) -> tuple[ScriptedPublisher, int]:
        """Create a publisher of the tester and a subscriber of the adapter, and wait for the hello.

        Returns:
            The publisher, and the adapter's id of the subscriber.
        """
        publisher = self.create_publisher(topic, msg_type)
        sub = self.new_sub(topic, msg_type)
        self.require(lambda: bool(publisher.hellos), "hello")
        return publisher, sub

    def _on_push(self, message: OutgoingMessage) -> None:
        if isinstance(message.body, PublisherAdded) and self.connect_delay_s is not None:
            record = message.body.publisher.publisher
            due = time.monotonic() + self.connect_delay_s  # not scaled, like the 0.5 s that `new_pub` waits
            for subscriber in self.subscribers:
                if subscriber.topic == record.topic and subscriber.node.id == message.to:
                    self._pending_connections.append((due, subscriber, record.endpoints[0]))

    # ---- between rules and at the end

    def discard_close_requests(self) -> None:
        """Exclude the adapter's current publishers and subscribers from `clear`; the rule closes them."""
        self._close_requests.clear()

    def clear(self) -> None:
        """Close all publishers and subscribers that a rule opened; the adapter keeps running."""
        self.master.reply_filter = lambda _request, reply: reply
        self.connect_delay_s = 0.0
        self._pending_connections.clear()
        for peer in self._peers():
            if peer.node.id in self.master.graph.members:
                self.master.submit(Leave(peer.node.id))
        for publisher in self.publishers:
            publisher.pump()
            publisher.send_byes()
        for subscriber in self.subscribers:
            subscriber.socket.close(0)
        self.subscribers.clear()
        while self._close_requests:
            do, members = self._close_requests.pop()
            self.call(do, **members)
        for publisher in self.publishers:
            publisher.socket.close(0)
        self.publishers.clear()
        self.adapter.events.clear()

    def _peers(self) -> Iterator[ScriptedPublisher | ScriptedSubscriber]:
        yield from self.publishers
        yield from self.subscribers

    def close(self) -> None:
        """Stop the adapter and close all sockets."""
        try:
            self.adapter.stop()
        finally:
            self._release()

    def _release(self) -> None:
        for peer in self._peers():
            peer.socket.close(0)
        self.master.stop()
        self._context.term()
