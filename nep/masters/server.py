"""The master's thread, which reads requests and sends replies and pushes."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence

import zmq
from msgspec.structs import replace

from nep.errors import ClosedError, NepError, WaitTimeoutError, WireError
from nep.i18n import _
from nep.masters.bad_requests import BadRequestCounter, describe_sender
from nep.masters.graph import Graph, OutgoingMessage, with_hosts, without_nodes
from nep.masters.listen_addresses import ListenAddresses
from nep.masters.process import Owner
from nep.masters.router import MasterRouter
from nep.protocol.encoding import ReceivedRequest, decode_request, encode_reply
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    DoneReply,
    Listen,
    RejectedReply,
    Renew,
    RenewedReply,
    Reply,
    ReportAlerts,
    Request,
)
from nep.system.addresses import endpoint_of
from nep.system.forks import call_in_child, close_in_child, current_generation
from nep.system.log_rarely import is_logged
from nep.system.wakeup import Waker

_logger = logging.getLogger("nep.master")
_TICK_INTERVAL_S = 0.25
_MIN_SUSPENSION_S = 1.0
"""Pause in seconds (suspended computer, large request) after which the next tick expires no node."""
_MAX_COLLECT_MS = 10
_NODES_PER_MS = 50
"""Number of nodes for each millisecond in which renewals are collected, up to `_MAX_COLLECT_MS`."""
_ADDRESS_CHECK_INTERVAL_S = 2.0
"""Interval in seconds for checking this computer's addresses while other computers are served."""


class Submission:
    """Request that the master's own process submits.

    Attributes:
        request: The request.
        done: Set when the reply is available, or when the master stops without a reply.
        reply: The reply, or None.
    """

    def __init__(self, request: Request) -> None:
        self.request = request
        self.done = threading.Event()
        self.reply: Reply | None = None


class MasterServer:
    """Server thread of a master.

    Args:
        address: Address to bind.
        graph: State of the master.
        listeners: Functions called with every new snapshot of the graph, in the server thread.
        owner: Process with which the master stops, or None.

    Raises:
        AddressInUseError: The address can't be bound.
    """

    def __init__(
        self,
        address: str,
        graph: Graph,
        listeners: Sequence[Callable[[GraphView], None]],
        owner: Owner | None,
    ) -> None:
        self._graph = graph
        self._listeners = listeners
        self._owner = owner
        self._router = MasterRouter(address)
        self.address = self._router.address
        self._waker = Waker()
        self._submissions: deque[Submission] = deque()
        self._pending_submissions: dict[int, Submission] = {}
        self._last_call = 0
        self._bad_requests = BadRequestCounter()
        self._renewals: list[tuple[str, ReceivedRequest, int]] = []
        """Renewals without a reply yet: sender, request, and time of receipt (ns since 1970)."""
        self._notify_at = 0.0
        self._is_open = False
        self._is_closing = False
        self._generation = current_generation()
        self._notified_revision = graph.revision
        self.ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="nep-master", daemon=True)
        self._listen_addresses = ListenAddresses(self._router.socket, int(self.address.rpartition(":")[2]))
        self._address_check_at = 0.0
        self._failure_count = 0
        self._ticked_at = time.monotonic()
        call_in_child(self._give_up_in_child)

    # ---- other threads

    def start(self) -> None:
        """Start the thread. Only submissions are served until `open` is called."""
        self._thread.start()

    def open(self) -> None:
        """Start serving requests of other programs."""
        self._is_open = True
        self._waker.wake()

    def close(self) -> None:
        """Stop the thread and release the address."""
        self._is_closing = True
        self._waker.wake()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(5.0)

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Bound endpoints."""
        return (endpoint_of(self.address), *self._listen_addresses.endpoints)

    def _give_up_in_child(self) -> None:
        close_in_child(*self.endpoints)

    def submit(self, request: Request, timeout_s: float) -> Reply:
        """Execute a request of this process. See `Master.submit`."""
        submission = Submission(request)
        self._submissions.append(submission)
        self._waker.wake()
        if not submission.done.wait(timeout_s):
            raise WaitTimeoutError(_("a reply from the master"), timeout_s)
        if submission.reply is None:
            raise ClosedError(f"the master at '{self.address}'")
        return submission.reply

    # ---- master's thread

    def _run(self) -> None:
        waker = (self._waker.fd, int(zmq.POLLIN))
        polled: list[tuple[int | zmq.Socket[bytes], int]] = [waker]
        tick_at = time.monotonic()
        try:
            while not (self._is_closing or self._generation.is_inherited):
                if self._is_open and len(polled) == 1:
                    polled.append((self._router.socket, int(zmq.POLLIN)))
                zmq.zmq_poll(polled, self._poll_timeout_ms(tick_at))
                self._waker.clear()
                now = time.monotonic()
                due = self._graph.learning_end
                is_due = now >= tick_at or (due is not None and now >= due)
                if is_due:
                    tick_at = now + _TICK_INTERVAL_S
                try:
                    self._run_once(waker, is_due=is_due)
                except Exception as error:  # noqa: BLE001 - logged; one program must not stop the master
                    self._log_failure(error, "do its work")
        finally:
            if not self._generation.is_inherited:
                self.ended.set()
                self._release()
                for submission in (*self._submissions, *self._pending_submissions.values()):
                    submission.done.set()

    def _run_once(self, waker: tuple[int, int], *, is_due: bool) -> None:
        # Requests first, then periodic work.
        self._serve_submissions()
        if self._is_open:
            self._serve_router()
            if self._renewals and self._wait_for_more_renewals(waker):
                self._serve_router()
            self._reply_to_renewals()
        now = time.monotonic()
        if is_due:
            self._tick(now)
        self._notify_listeners(now)

    def _log_failure(self, error: Exception, operation: str) -> None:
        # Logged at increasing intervals.
        self._failure_count += 1
        if is_logged(self._failure_count):
            template = "the master failed to %s (%d so far)"
            _logger.error(template, operation, self._failure_count, exc_info=error)

    def _wait_for_more_renewals(self, waker: tuple[int, int]) -> bool:
        # With hundreds of nodes a wake-up costs more than a reply, so renewals are collected for some ms.
        collect_ms = min(_MAX_COLLECT_MS, len(self._graph.members) // _NODES_PER_MS)
        if collect_ms:
            zmq.zmq_poll([waker], collect_ms)
        return bool(collect_ms)

    def _poll_timeout_ms(self, tick_at: float) -> int:
        due = self._graph.learning_end
        wake_at = tick_at if due is None else min(tick_at, due)
        if self._listeners and self._graph.revision != self._notified_revision:
            wake_at = min(wake_at, self._notify_at)
        return max(0, int((wake_at - time.monotonic()) * 1000) + 1)

    def _tick(self, now: float) -> None:
        was_suspended, self._ticked_at = now - self._ticked_at > _MIN_SUSPENSION_S, now
        if not was_suspended:  # otherwise this thread was late itself: renewals may still be queued
            self._send(self._graph.tick(now))
            self._send(self._graph.probes_for_overdue(now))
        ended = (self._graph.node_at(_route_of(sender)) for sender in self._router.take_ended_senders(now))
        self._send(self._graph.probes_for([each.node.id for each in ended if each is not None]))
        self._graph.apply(ReportAlerts("requests", self._bad_requests.alerts(now)), 0, now, "")
        if self._owner is not None and self._owner.is_gone() and not self._is_needed():
            self._is_closing = True
        if self._listen_addresses.hosts and now >= self._address_check_at:
            self._address_check_at = now + _ADDRESS_CHECK_INTERVAL_S
            self._report_lost_addresses()

    def _report_lost_addresses(self) -> None:
        self._graph.apply(
            ReportAlerts("listening", self._listen_addresses.refresh()), 0, time.monotonic(), ""
        )

    def _is_needed(self) -> bool:
        # True if a node is registered that belongs neither to the owner's process nor to this one.
        own_pids = {os.getpid(), None if self._owner is None else self._owner.pid}
        return any(node.pid not in own_pids for node in self._graph.nodes)

    def _serve_submissions(self) -> None:
        while self._submissions:
            submission = self._submissions.popleft()
            self._last_call -= 1  # negative numbers are distinct from calls of nodes
            self._pending_submissions[self._last_call] = submission
            self._send(self._execute("", ReceivedRequest(self._last_call, submission.request), 0))

    def _serve_router(self) -> None:
        deadline = time.monotonic() + _TICK_INTERVAL_S
        for _round in range(1000):  # then other work
            if time.monotonic() > deadline:
                return
            try:
                sender, *body = self._router.receive()
            except zmq.Again:
                return
            except zmq.ZMQError:
                _logger.exception("the master failed to receive a request")
                return
            received = decode_request(body[0] if len(body) == 1 else b"")
            if isinstance(received.request, Renew):
                self._renewals.append((_route_of(sender), received, time.time_ns()))
            else:
                self._reply_to_renewals()  # in order of arrival
                self._serve_request(_route_of(sender), received, self._router.peer_address())

    def _reply_to_renewals(self) -> None:
        # All replies are sent together, so that libzmq's thread wakes once.
        renewals, self._renewals = self._renewals, []
        self._send([each for renewal in renewals for each in self._execute(*renewal)])

    def _serve_request(self, sender: str, received: ReceivedRequest, peer: str) -> None:
        if isinstance(received.request, Listen) and self._listen_addresses.hosts and peer != "127.0.0.1":
            reason = _("this setting can be changed only on the master's own computer")
            received = ReceivedRequest(received.call, WireError(reason, code="listen"))
        outgoing = self._execute(sender, received, time.time_ns())
        self._send(outgoing)
        reason = _rejection_reason(outgoing)
        if reason:
            member = self._graph.node_at(sender)
            node_id, node_name = ("", "") if member is None else (member.node.id, member.node.name)
            self._bad_requests.add(*describe_sender(node_id, node_name, peer), reason, time.monotonic())

    def _execute(
        self, sender: str, received: ReceivedRequest, received_ns: int
    ) -> tuple[OutgoingMessage, ...]:
        # An empty sender means this process.
        request = received.request
        reply: Reply
        try:
            if isinstance(request, WireError):
                reply = self._create_rejection(request)
            elif isinstance(request, Listen):
                reply = self._listen(request)
            else:
                outgoing = self._graph.apply(
                    request, received.call, time.monotonic(), sender, is_foreign=bool(sender)
                )
                if isinstance(request, Renew) and request.clock is not None:
                    outgoing = self._with_times(outgoing, received_ns)
                return outgoing
        except Exception as error:  # noqa: BLE001 - logged; one request must not stop the master
            self._log_failure(error, "execute a request")
            reply = self._create_rejection()
        return (OutgoingMessage(sender, reply, received.call),)

    def _with_times(
        self, outgoing: Sequence[OutgoingMessage], received_ns: int
    ) -> tuple[OutgoingMessage, ...]:
        # Adds receipt and reply time to replies of a renewal.
        return tuple(
            each._replace(
                body=replace(each.body, times=self._graph.clocks.renewal_timestamps(member, received_ns))
            )
            if isinstance(each.body, RenewedReply) and (member := self._graph.node_at(each.to)) is not None
            else each
            for each in outgoing
        )

    def _listen(self, request: Listen) -> Reply:
        try:
            self._listen_addresses.serve(request.hosts)
        except NepError as error:
            return RejectedReply(self._graph.epoch, self._graph.revision, str(error), "listen")
        self._report_lost_addresses()
        return DoneReply(self._graph.epoch, self._graph.revision)

    def _send(self, outgoing: Sequence[OutgoingMessage]) -> None:
        # Nodes found dead on the way are dropped.
        dead: set[str] = set()
        for message in outgoing:
            if message.call is not None and message.call < 0:
                self._reply_to_submission(message)
            elif not self._deliver(message, frozenset(dead)):
                dead.update([message.to] if message.call is None else self._node_ids_at(message.to))
        if dead:
            self._send(self._graph.unregister_nodes(dead))

    def _reply_to_submission(self, message: OutgoingMessage) -> None:
        submission = self._pending_submissions.pop(message.call or 0, None)
        if submission is not None:
            submission.reply = with_hosts(message.body, self._listen_addresses.hosts)  # type: ignore[assignment]
            submission.done.set()

    def _deliver(self, message: OutgoingMessage, dead: frozenset[str]) -> bool:
        # False if the connection is gone.
        route = message.to
        if message.call is None:
            member = None if message.to in dead else self._graph.members.get(message.to)
            if member is None:
                return True
            route = member.route
        reply = with_hosts(without_nodes(message.body, dead), self._listen_addresses.hosts)
        try:
            body = encode_reply(reply, message.call or 0)
        except Exception as error:  # noqa: BLE001 - logged; the caller gets an error reply
            self._log_failure(error, "encode a message")
            if message.call is None:
                return True
            body = encode_reply(self._create_rejection(), message.call)
        return self._router.send(route.encode("utf-8", "surrogateescape"), body)

    def _node_ids_at(self, route: str) -> tuple[str, ...]:
        member = self._graph.node_at(route)
        return () if member is None else (member.node.id,)

    def _create_rejection(self, error: WireError | None = None) -> RejectedReply:
        error = error or WireError(
            _("the master failed to execute the request; see its log"), code="internal"
        )
        return RejectedReply(self._graph.epoch, self._graph.revision, error.reason, error.code)

    def _notify_listeners(self, now: float) -> None:
        # Rate-limited, so that notifying takes at most a quarter of the time when many nodes join.
        if self._listeners and self._graph.revision != self._notified_revision and now >= self._notify_at:
            self._notified_revision = self._graph.revision
            view = replace(self._graph.view(), listens=self._listen_addresses.hosts)
            for listener in self._listeners:
                try:
                    listener(view)
                except Exception:  # an attachment must not stop the master
                    _logger.exception("an attachment of the master failed")
            self._notify_at = 4.0 * time.monotonic() - 3.0 * now  # pause for three times the duration

    def _release(self) -> None:
        self._router.close()
        self._waker.close()


def _rejection_reason(outgoing: Sequence[OutgoingMessage]) -> str:
    return next((each.body.reason for each in outgoing if isinstance(each.body, RejectedReply)), "")


def _route_of(sender: bytes) -> str:
    return sender.decode("utf-8", "surrogateescape")
