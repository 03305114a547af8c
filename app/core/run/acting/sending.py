"""Sending of messages, once or at a fixed rate. Late messages are dropped, not sent in a burst.

Publishers are opened in the network thread; one thread sends all repeated messages.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from app.clock import Clock, MonotonicClock, ThreadClock
from app.core.faults import error_text
from app.core.network.source import Job
from app.core.robots.motion.gate import MotionGate
from app.core.run.acting.arming import Arming, Target
from app.core.run.acting.json_text import format_json
from app.core.run.acting.sent_log import MAX_TEXT_BYTES, SendOrigin
from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import codec_for
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher

MIN_HZ, MAX_HZ = 0.1, 50.0
MAX_AGE_S = 10.0
"""Maximum age in seconds of a message that waits for a master; older messages are discarded."""
MAX_REPEATED_MESSAGES = 10
"""Maximum number of messages that are sent repeatedly at the same time."""
MAX_PUBLISHERS = 20
MAX_RESULTS = 200


@dataclass(frozen=True, slots=True)
class SendOrder:
    """Order to send a message, once or repeatedly.

    Attributes:
        create_payload: Returns a new payload for each message, or raises `NepError`.
        source: Text that the user wrote.
        origin: Origin of the order.
        on_result: Callback for the result, or None.
    """

    id: str
    name: str
    topic: str
    msg_type: str
    create_payload: Callable[[], object]
    source: str = ""
    origin: SendOrigin = "publish"
    on_result: Callable[[SendResult], object] | None = None

    @property
    def target(self) -> Target:
        """Topic to which the message is sent."""
        return Target("topic", self.topic)


@dataclass(frozen=True, slots=True)
class SendResult:
    """Result of sending a message.

    Attributes:
        kind: "sent", "began", "ended" or "failed".
        message: Reason for a failure, or "".
        subscriber_count: Number of subscribers.
        count: Number of repeated messages that were sent.
        dropped_count: Number of repeated messages that were dropped because they were late.
        text: Message that was sent once; "" if it is too large to be stored.
    """

    order: SendOrder
    kind: str
    message: str = ""
    subscriber_count: int = 0
    count: int = 0
    dropped_count: int = 0
    text: str = ""


@dataclass(slots=True, eq=False)
class RepeatedMessage:
    """Message that is sent repeatedly. Changed in the sending thread only."""

    order: SendOrder
    rate_hz: float
    turn: int
    node: Node
    publisher: Publisher
    clock: Clock
    due_s: float
    count: int = 0
    dropped_count: int = 0
    subscriber_count: int = 0
    since_s: float = 0.0
    end_event: threading.Event = field(default_factory=threading.Event)

    @property
    def measured_hz(self) -> float:
        """Measured rate in messages per second; 0 before the second message."""
        elapsed_s = self.clock.now() - self.since_s
        return (self.count - 1) / elapsed_s if self.count > 1 and elapsed_s > 0 else 0.0


class Outbox:
    """Sender of messages while sending is switched on. `pop_results` returns the results.

    Not thread-safe; use it from the main thread.
    """

    def __init__(
        self,
        arming: Arming,
        submit: Callable[[str, Job], None],
        gate: MotionGate | None = None,
        clock: ThreadClock | None = None,
    ) -> None:
        # `gate` knows which messages would move a robot without permission; without it all are sent.
        # `clock` is replaceable in tests.
        self._gate = gate
        self._last_subscriber_counts: dict[Publisher, int] = {}
        self._arming, self._submit = arming, submit
        self._clock: ThreadClock = clock or MonotonicClock()
        self._lock = threading.RLock()
        self._wake = self._clock.event()
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._repeated_messages: dict[str, RepeatedMessage] = {}
        self._starting_tokens: dict[str, object] = {}
        self._results: deque[SendResult] = deque(maxlen=MAX_RESULTS)
        self._thread: threading.Thread | None = None
        self._is_closed = False

    def pop_results(self) -> list[SendResult]:
        """Return and clear the results."""
        results = []
        while self._results:
            results.append(self._results.popleft())
        return results

    def repeated(self, order_id: str) -> RepeatedMessage | None:
        """Return the state of a message that is sent repeatedly; None if the message isn't being sent."""
        with self._lock:
            return self._repeated_messages.get(order_id)

    @property
    def repeated_messages(self) -> tuple[RepeatedMessage, ...]:
        """Messages that are being sent repeatedly."""
        with self._lock:
            return tuple(self._repeated_messages.values())

    def is_sending(self, order_id: str) -> bool:
        """Return True if a message is being sent repeatedly, or will be once its publisher is open."""
        with self._lock:
            return order_id in self._repeated_messages or order_id in self._starting_tokens

    # ---- requests

    def send(self, order: SendOrder) -> None:
        """Send a message once, in the background; `pop_results` returns the result or the error."""
        turn, requested_s = self._arming.turn, self._clock.now()

        def send_job(node: Node) -> None:
            publisher = self._open_publisher(node, order)
            value = order.create_payload()
            payload = codec_for(order.msg_type).encode(value)
            self._check(node, order, publisher)
            if self._arming.run_if_armed(turn, order.target, lambda: publisher.publish(payload)):
                text = _text_of(value) if len(payload.data) <= MAX_TEXT_BYTES else ""
                self._add_result(SendResult(order, "sent", subscriber_count=publisher.subscribers, text=text))
            else:
                self._add_result(SendResult(order, "failed", _("not sent: no longer armed")))

        self._submit("", self._guarded_job(order, requested_s, send_job))

    def start(self, order: SendOrder, rate_hz: float) -> bool:
        """Start sending a message repeatedly; return False if the limit is reached.

        The limit is `MAX_REPEATED_MESSAGES`. Sending runs in the background; `pop_results` returns its
        start, its end and errors.

        Args:
            order: Message to send.
            rate_hz: Messages per second, limited to `MIN_HZ` to `MAX_HZ`.
        """
        rate_hz = min(MAX_HZ, max(MIN_HZ, rate_hz))
        turn, requested_s, token = self._arming.turn, self._clock.now(), object()
        with self._lock:
            if (
                len(self._repeated_messages.keys() | self._starting_tokens.keys() | {order.id})
                > MAX_REPEATED_MESSAGES
            ):
                return False
            self._starting_tokens[order.id] = token

        def start_job(node: Node) -> None:
            codec_for(order.msg_type).encode(
                order.create_payload()
            )  # errors are reported before anything is sent
            publisher = self._open_publisher(node, order)
            now = self._clock.now()
            repeated = RepeatedMessage(order, rate_hz, turn, node, publisher, self._clock, now, since_s=now)
            with self._lock:
                if self._starting_tokens.get(order.id) is not token:
                    return  # ended meanwhile
                self._repeated_messages[order.id] = repeated
                if self._thread is None and not self._is_closed:
                    self._thread = self._clock.start_thread(self._run, "studio-sending")
            self._wake.set()
            self._add_result(SendResult(order, "began"))

        def run_start_job(node: Node) -> None:
            try:
                start_job(node)
            finally:
                with self._lock:
                    if self._starting_tokens.get(order.id) is token:
                        del self._starting_tokens[order.id]

        self._submit("", self._guarded_job(order, requested_s, run_start_job))
        return True

    def stop(self, order_id: str) -> None:
        """Stop sending a repeated message."""
        with self._lock:
            self._starting_tokens.pop(order_id, None)
            message = self._repeated_messages.pop(order_id, None)
        if message is not None:
            self._report_end(message)

    def stop_all(self) -> None:
        """Stop all sending and close the publishers."""
        with self._lock:
            self._starting_tokens.clear()
            ids = list(self._repeated_messages)
        for message_id in ids:
            self.stop(message_id)
        if self._publishers and not self._is_closed:
            self._submit("", lambda _node: self._close_unused())

    def close(self) -> None:
        """Stop all sending and wait for the thread."""
        self.stop_all()
        with self._lock:
            self._is_closed = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join(2.0)

    # ---- in the network thread

    def _guarded_job(self, order: SendOrder, requested_s: float, job: Job) -> Job:
        def run(node: Node) -> None:
            try:
                if self._clock.now() - requested_s > MAX_AGE_S:
                    raise NepError(_("not sent: no master was running"))
                job(node)
            except NepError as error:
                self._add_result(SendResult(order, "failed", str(error)))
            except Exception as error:  # noqa: BLE001 - reported as the result of this message
                self._add_result(SendResult(order, "failed", error_text(error)))

        return run

    def _check(self, node: Node, order: SendOrder, publisher: Publisher) -> None:
        # Raises `NepError` if it would move a robot without permission, which may have connected meanwhile.
        if self._gate is None:
            return
        subscriber_count = publisher.subscribers
        if subscriber_count == self._last_subscriber_counts.get(publisher):
            reason = self._gate.rejection_reason(order.topic)
        else:
            reason = self._gate.current_rejection_reason(node, order.topic)
        if reason:
            raise NepError(_("not sent: {reason}").format(reason=reason))
        self._last_subscriber_counts[publisher] = subscriber_count

    def _open_publisher(self, node: Node, order: SendOrder) -> Publisher:
        key = (order.topic, order.msg_type)
        with self._lock:
            used_keys = {(each.order.topic, each.order.msg_type) for each in self._repeated_messages.values()}
        publisher = self._publishers.get(key)
        if publisher is None or publisher.is_closed:
            unused = [each for each in self._publishers if each not in used_keys]
            if len(self._publishers) >= MAX_PUBLISHERS and unused:
                self._close_publisher(unused[0])
            publisher = self._publishers[key] = node.new_pub(order.topic, order.msg_type)
        return publisher

    def _close_unused(self) -> None:
        with self._lock:
            used_keys = {(each.order.topic, each.order.msg_type) for each in self._repeated_messages.values()}
        if self._arming.is_on:
            return  # armed again meanwhile
        for key in [each for each in self._publishers if each not in used_keys]:
            self._close_publisher(key)

    def _close_publisher(self, key: tuple[str, str]) -> None:
        publisher = self._publishers.pop(key)
        self._last_subscriber_counts.pop(publisher, None)
        publisher.close()

    def _add_result(self, result: SendResult) -> None:
        self._results.append(result)

    def _report_end(self, message: RepeatedMessage, problem: str = "") -> None:
        if not message.end_event.is_set():
            message.end_event.set()
            kind = "failed" if problem else "ended"
            self._add_result(
                SendResult(
                    message.order,
                    kind,
                    problem,
                    message.subscriber_count,
                    message.count,
                    message.dropped_count,
                )
            )

    # ---- thread of repeated messages

    def _run(self) -> None:
        while True:
            self._wake.clear()
            with self._lock:
                if self._is_closed:
                    return
                messages = list(self._repeated_messages.values())
            now = self._clock.now()
            due = [repeated for repeated in messages if repeated.due_s <= now]
            for repeated in due:
                self._send_repeated(repeated)
            if not due:
                next_s = min((repeated.due_s for repeated in messages), default=None)
                self._clock.wait(self._wake, None if next_s is None else max(0.0, next_s - now))

    def _send_repeated(self, repeated: RepeatedMessage) -> None:
        problem = ""
        try:
            payload = codec_for(repeated.order.msg_type).encode(repeated.order.create_payload())
            self._check(repeated.node, repeated.order, repeated.publisher)
            is_sent = self._arming.run_if_armed(
                repeated.turn, repeated.order.target, lambda: self._publish(repeated, payload)
            )
        except Exception as error:  # noqa: BLE001 - the other messages continue
            is_sent, problem = False, str(error) if isinstance(error, NepError) else error_text(error)
        if is_sent:
            repeated.subscriber_count = repeated.publisher.subscribers
            repeated.dropped_count += self._schedule_next(repeated)
            return
        with self._lock:
            if self._repeated_messages.get(repeated.order.id) is repeated:
                del self._repeated_messages[repeated.order.id]
        self._report_end(repeated, problem)

    def _publish(self, repeated: RepeatedMessage, payload: object) -> None:
        with self._lock:  # an ended message is not sent once more
            if self._repeated_messages.get(repeated.order.id) is repeated:
                repeated.publisher.publish(payload)
                repeated.count += 1

    def _schedule_next(self, repeated: RepeatedMessage) -> int:
        # Sets the next due time; returns the number of messages omitted because they are late.
        period_s = 1 / repeated.rate_hz
        late_count = max(0, int((self._clock.now() - repeated.due_s) / period_s))
        repeated.due_s += (1 + late_count) * period_s
        return late_count


def _text_of(value: object) -> str:
    return value if isinstance(value, str) else format_json(value)
