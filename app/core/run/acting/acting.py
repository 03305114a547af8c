"""Manual publishing and service calls in a session: saved messages, arming, and repeated messages.

All messages go to the live network. While a recording is shown, manual messages and calls are disabled,
but recorded messages can be published (`app.core.recording.replay.sending`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

from app.core.alerts.alerts import Alerts
from app.core.robots.fleet import Fleet
from app.core.robots.stop.moved_robots import OnMoved, ignore_moved
from app.core.run.acting.arming import ARMED_S, Arming, Target
from app.core.run.acting.calling import CallRecord, ServiceCalls
from app.core.run.acting.json_text import parse_json_text
from app.core.run.acting.sending import Outbox, SendOrder, SendResult
from app.core.run.acting.sent_log import SendOrigin, SentLog, SentRecord
from app.core.run.acting.shelf import (
    MAX_BYTES,
    NewerSavedMessagesError,
    SavedMessage,
    SavedMessages,
    encode_saved_messages,
    new_message_id,
    parse_saved_messages,
)
from app.core.run.acting.templates import is_editable, is_plain_text
from app.core.storage.atomic_file import write_atomically
from app.core.storage.background_worker import BackgroundWorker
from app.core.storage.settings import Settings
from app.core.storage.user_file import read_stored
from app.core.world.console import Console
from app.core.world.live import LiveWorld
from app.core.world.part import SessionPart
from app.core.world.world import World
from nep.errors import NepError
from nep.i18n import _, format_list, lazy, ngettext

FILE_NAME = "messages.json"
_SENDERS_BY_ORIGIN: Mapping[SendOrigin, str] = {"publish": "shelf"}


class ActingSession(Protocol):
    """Parts of the session that `SessionActing` uses."""

    settings: Settings
    alerts: Alerts
    console: Console
    live: LiveWorld
    fleet: Fleet

    @property
    def shown(self) -> World:
        """World that the panels show."""

    @property
    def source_revision(self) -> int:
        """Counter that increases when another world is shown."""


@dataclass(frozen=True, slots=True)
class ArmQuestion:
    """Question to the user before messages are sent on a topic that moves robots.

    Attributes:
        topic: Name of the topic.
        robots: Names of the robots; empty if unknown.
        on_allow: Called if the user allows the motion.
    """

    topic: str
    robots: tuple[str, ...]
    on_allow: Callable[[], object]

    @property
    def message(self) -> str:
        """Warning that messages on the topic move robots; it names the robots if they are known."""
        template = _("{topic} moves {robots}. Make sure nobody is in the way. Press F12 to stop.")
        if not self.robots:
            template = _("{topic} commands robots. Make sure nobody is in the way. Press F12 to stop.")
            return template.format(topic=self.topic)
        return template.format(topic=self.topic, robots=format_list(list(self.robots)))


class SessionActing(SessionPart):
    """Manual publishing and calling. Not thread-safe, except `disarm`; use it from the main thread."""

    task = lazy("send messages by hand")

    def __init__(
        self,
        session: ActingSession,
        *,
        clock: Callable[[], float] = time.monotonic,
        clock_s: Callable[[], float] = time.time,
    ) -> None:
        self._session, self._clock = session, clock
        self.arming = Arming(clock)
        self.submit = session.live.source.submit
        """Runs a job with Studio's node on the live network."""
        self.gate = session.fleet.gate
        self.on_moved: OnMoved = ignore_moved
        """Called with the robots that a message moves, and the kind of sender: "shelf", "image" or "replay".
        """
        self.outbox = Outbox(self.arming, self.submit, self.gate)
        self.calls = ServiceCalls(self.arming, self.submit, clock, clock_s)
        self.recorded_commands: frozenset[str] = frozenset()
        """Command topics of the robots in a recording; cleared when switched off."""
        self.question: ArmQuestion | None = None
        """Open question about arming a robot's topic."""
        self.last_results: dict[str, SendResult] = {}
        """Result of the last sending of each saved message, by message id."""
        self.armed_s = ARMED_S
        self.revision = 0
        self._clock_s = clock_s
        self.sent_log = SentLog()
        """Log of messages sent and services called since the start."""
        self.last_sent_s: dict[str, float] = {}
        self._worker: BackgroundWorker[bool] = BackgroundWorker("studio-shelf")
        self._is_file_newer = False
        self._source_revision = session.source_revision
        self.path: Path | None = session.settings.path.with_name(FILE_NAME)
        self.saved_messages = self._read(self.path)
        self._saved_revision = self.saved_messages.revision

    # ---- switch

    def arm(self, *, for_replay: bool = False) -> str:
        """Switch sending on for `armed_s` seconds.

        Args:
            for_replay: True to arm the publishing of a recording; necessary while a recording is shown.

        Returns:
            Reason why this isn't possible, or "".
        """
        if not self._session.shown.is_live and not for_replay:
            return _("A recording is open. Return to live to send.")
        was_on = self.arming.is_on
        self.arming.arm(self.armed_s)
        self.revision += 1
        if not was_on:
            message = _("armed for {count} min").format(count=round(self.armed_s / 60))
            self._log_to_console("warn", message)
            self._add_record("switch", "", message)
        return ""

    def disarm(self) -> None:
        """Switch sending off and stop all messages in progress.

        Nothing is sent after this returns. Thread-safe.
        """
        was_on = self.arming.disarm()
        self.question, self.recorded_commands = None, frozenset()
        self.outbox.stop_all()
        if was_on:
            self.revision += 1
            self._log_to_console("info", message := _("no longer armed"))
            self._add_record("switch", "", message)

    def allow(
        self, target: Target, on_allowed: Callable[[], object] | None = None, *, is_confirmed: bool = False
    ) -> str:
        """Allow sending to a target.

        For a topic that moves robots, the user is asked first (`question`).

        Args:
            target: Topic or service.
            on_allowed: Called when the target has been allowed.
            is_confirmed: True to skip the question.

        Returns:
            Reason why this isn't possible; "" if the target is allowed or the user is being asked.
        """
        if not is_confirmed and self.needs_confirmation(target):
            names = tuple(name for name in self._moved_robots(target) if name != target.name)
            self.question = ArmQuestion(
                target.name, names, partial(self._allow_confirmed, target, self.arming.turn, on_allowed)
            )
            self.revision += 1
            return ""
        if not self.arming.allow(target, is_confirmed=is_confirmed):
            return _(
                "Sending isn't armed, or too many topics and services are allowed. Arm sending, or remove a "
                "topic or service."
            )
        self.revision += 1
        if on_allowed is not None:
            on_allowed()
        return ""

    def _allow_confirmed(self, target: Target, turn: int, on_allowed: Callable[[], object] | None) -> None:
        if turn == self.arming.turn:
            self.allow(target, on_allowed, is_confirmed=True)

    def answer(self, *, is_allowed: bool) -> None:
        """Apply the user's answer to `question`, and remove the question.

        Args:
            is_allowed: True to allow the motion.
        """
        question, self.question = self.question, None
        self.revision += 1
        if question is not None and is_allowed:
            question.on_allow()

    def deny(self, target: Target) -> None:
        """Deny sending to a target, and stop its repeated messages."""
        self.arming.deny(target)
        for repeated in self.outbox.repeated_messages:
            if repeated.order.target == target:
                self.outbox.stop(repeated.order.id)
        self.revision += 1

    def needs_confirmation(self, target: Target) -> bool:
        """Return True if the user must be asked before sending to a target, because that moves robots."""
        if target.kind != "topic" or self.arming.is_confirmed(target.name):
            return False
        return target.name in self.recorded_commands or bool(self._moved_robots(target))

    @property
    def is_asking(self) -> bool:
        """True while the user is asked: `question`, or the question before a real robot's first motion."""
        return self.question is not None or self._session.fleet.permission.question is not None

    def _moved_robots(self, target: Target) -> tuple[str, ...]:
        return self.gate.robots_moved_by(target.name) if target.kind == "topic" else ()

    def may_continue(self, target: Target) -> bool:
        """Return True if repeated sending to a target may continue.

        False if the topic now moves a robot that has connected in the meantime.
        """
        is_permitted = target.kind != "topic" or self.gate.is_permitted(target.name)
        return is_permitted and not self.needs_confirmation(target)

    def notify_moved(self, target: Target, origin: SendOrigin) -> None:
        """Call `on_moved` with the robots that a message to a target moves. Use this before sending.

        Args:
            target: Topic or service.
            origin: Origin of the message.
        """
        moved_robots = self._moved_robots(target)
        if moved_robots:
            self.on_moved(moved_robots, _SENDERS_BY_ORIGIN.get(origin, origin))

    # ---- messages

    def new_message(self, topic: str, msg_type: str, text: str) -> SavedMessage | None:
        """Add a saved message and return it; return None if there are `MAX_MESSAGES`."""
        name = self.saved_messages.free_name(topic.rpartition("/")[2] or _("Message"))
        message = SavedMessage(new_message_id(), name, topic, msg_type or "json", text)
        return message if self.saved_messages.set_message(message) else None

    def problem_of(self, message: SavedMessage) -> str:
        """Return the reason why a message can't be sent, or "" if it can be sent once armed."""
        if not is_editable(message.msg_type):
            template = _("Messages of type {type} can't be edited by hand.")
            return template.format(type=message.msg_type)
        json_text = None if is_plain_text(message.msg_type) else parse_json_text(message.text)
        if json_text is not None and json_text.fault is not None:
            return json_text.fault.message  # checked before the topic, so that the invalid line is shown
        if not message.topic.strip():
            return _("Choose a topic first.")
        if json_text is None:
            return ""
        filled_names = {name for name, value in message.values if value.strip()}
        missing = [name for name in json_text.manual_placeholders if name not in filled_names]
        return _("Fill in “{name}” first.").format(name=missing[0]) if missing else ""

    def send(self, message: SavedMessage, *, rate_hz: float = 0.0) -> str:
        """Send a message once or repeatedly.

        If sending is switched off, it is switched on for this topic only. For a topic that moves
        robots, the user is asked first.

        Args:
            message: Saved message.
            rate_hz: Messages per second; 0 to send once.

        Returns:
            Reason why this isn't possible, or "".
        """
        problem = self.problem_of(message)
        if problem:
            return problem
        order = SendOrder(
            message.id, message.name, message.topic, message.msg_type, message.payload, source=message.source
        )
        return self.send_order(order, rate_hz=rate_hz)

    def send_order(self, order: SendOrder, *, rate_hz: float = 0.0) -> str:
        """Send the message of an order in the same way as `send`.

        Args:
            order: Message to send.
            rate_hz: Messages per second; 0 to send once.

        Returns:
            Reason why this isn't possible; "" if it is sent, or will be if the user allows it.
        """
        problem = self._replay_problem()
        if problem:
            return problem
        reason = self.prepare(order.target, partial(self.send_order, order, rate_hz=rate_hz))
        if reason is not None:
            return reason
        self.notify_moved(order.target, order.origin)
        if not rate_hz:
            self.outbox.send(order)
        elif not self.outbox.start(order, rate_hz):
            return _("No more messages can be sent repeatedly. Stop a message first.")
        self.revision += 1
        return ""

    def _replay_problem(self) -> str:
        return "" if self._session.shown.is_live else _("A recording is open. Return to live to send.")

    def prepare(self, target: Target, on_allow: Callable[[], object]) -> str | None:
        """Prepare sending to a target, asking the user if necessary.

        Sending is armed if it isn't yet.

        Args:
            target: Topic or service.
            on_allow: Called if the user allows sending.

        Returns:
            None if sending is allowed now; otherwise the reason why not, which is "" if the user is
            being asked or ``on_allow`` was already called.
        """
        if not self.arming.is_on:
            problem = self.arm()
            if problem:
                return problem
        if not self.arming.allows(target) or self.needs_confirmation(target):
            return self.allow(target, on_allow)
        turn = self.arming.turn

        def resume_if_unchanged() -> None:
            if turn == self.arming.turn:
                on_allow()

        if target.kind != "topic":
            return None
        return None if self.gate.request_permission(target.name, resume_if_unchanged) else ""

    def resend(self, number: int) -> str:
        """Send the message or call of an entry of `sent_log` again, if its target is armed.

        Args:
            number: Id of the entry.

        Returns:
            Reason why this isn't possible, or "".
        """
        record = self.sent_log.get(number)
        if record is None or record.resend is None:
            return _("This can't be sent again.")
        if not self.arming.allows(record.target):
            return _("Sending to {name} isn't armed. Arm it first.").format(name=record.name)
        return record.resend()

    def stop_sending(self, message_id: str) -> None:
        """Stop sending a message repeatedly."""
        self.outbox.stop(message_id)
        self.revision += 1

    # ---- services

    def call(self, service: str, text: str, timeout_s: float) -> str:
        """Call a service. Sending is armed for this service if necessary.

        Args:
            service: Name of the service.
            text: Request as JSON text.
            timeout_s: Timeout in seconds.

        Returns:
            Reason why this isn't possible; "" if the call is sent, or will be if the user allows it.
        """
        try:
            request = parse_json_text(text).fill({})
        except NepError as error:
            return str(error)
        problem = self._replay_problem()
        if problem:
            return problem
        reason = self.prepare(Target("service", service), partial(self.call, service, text, timeout_s))
        if reason is not None:
            return reason
        try:
            self.calls.call(service, request, text, timeout_s)
        except NepError as error:
            return str(error)
        self.saved_messages.set_request(service, text)
        self.revision += 1
        return ""

    # ---- interface of the session

    def tick(self) -> None:
        """Process results. Switches sending off when the time has elapsed or another source is shown."""
        if self._session.source_revision != self._source_revision:
            self._source_revision = self._session.source_revision
            self.disarm()
        if self.arming.has_expired:
            self.disarm()
        for repeated in self.outbox.repeated_messages:  # a robot that this topic moves may have connected
            target = repeated.order.target
            if not self.may_continue(target):
                self.outbox.stop(repeated.order.id)
                self.prepare(target, _do_nothing)
        for result in self.outbox.pop_results():
            self._apply_result(result)
        for record in self.calls.tick():
            self.revision += 1
            level = "info" if record.state == "answered" else "warn"
            self._log_to_console(level, f"{record.service}: {call_text(record)}")
            self._log_call(record)

    def _apply_result(self, result: SendResult) -> None:
        order = result.order
        if self.saved_messages.get(order.id) is not None:
            self.last_results[order.id] = result
            self.last_sent_s[order.id] = self._clock_s()
        for values_by_id in (self.last_results, self.last_sent_s):
            for old_id in [id for id in values_by_id if self.saved_messages.get(id) is None]:
                del values_by_id[old_id]
        self.revision += 1
        is_error = result.kind == "failed"
        message = f"{order.name}, {result_text(result)}"
        self._log_to_console("warn" if is_error else "info", f"{order.topic}: {message}")
        was_sent_once = result.kind == "sent"
        resend = partial(self.send_order, order) if was_sent_once or (is_error and not result.count) else None
        self._add_record(
            order.origin, order.topic, message,
            sent_count=1 if was_sent_once else result.count, is_error=is_error, text=result.text,
            source=order.source, resend=resend,
        )  # fmt: skip
        if order.on_result is not None:
            order.on_result(result)

    def _log_call(self, record: CallRecord) -> None:
        self._add_record(
            "service", record.service, call_text(record),
            sent_count=1 if record.was_sent else 0, is_error=record.state != "answered",
            text=record.request, source=record.request,
            resend=partial(self.call, record.service, record.request, record.timeout_s),
        )  # fmt: skip

    def log(self, level: str, target: Target, text: str, sent_count: int = 0) -> None:
        """Log a result of publishing a recording, in the Console and in `sent_log`.

        Args:
            level: Log level; "warn" for an error.
            target: Topic.
            text: Result as text.
            sent_count: Number of messages that were sent.
        """
        self.revision += 1
        self._log_to_console(level, f"{target.name}: {text}")
        self._add_record("replay", target.name, text, sent_count=sent_count, is_error=level == "warn")

    def _add_record(
        self, origin: SendOrigin, name: str, message: str, *, sent_count: int = 0, is_error: bool = False,
        text: str = "",
        source: str = "", resend: Callable[[], str] | None = None,
    ) -> None:  # fmt: skip
        self.sent_log.add(
            SentRecord(self._clock_s(), origin, name, message, is_error, text, source, resend), sent_count
        )

    def _log_to_console(self, level: str, message: str) -> None:
        self._session.console.add(level, "studio", message)

    def check(self) -> None:
        """Write the saved messages to the file if they have changed. Called once a second."""
        self._write()
        try:
            if self._worker.pop_result(FILE_NAME):
                self._session.alerts.resolve("messages:kept")
        except OSError as error:
            self._saved_revision = -1  # retried at the next check
            detail = _("Reason: {reason}. The changes are kept until Studio closes.").format(
                reason=error.strerror or error
            )
            title = _("Changes to saved messages can't be saved.")
            self._session.alerts.raise_alert("messages:kept", "warn", title, detail, count=0)

    def close(self) -> None:
        """Stop all sending and write the saved messages to the file."""
        self.disarm()
        self.outbox.close()
        self.calls.close()
        self._write()
        self._worker.finish(FILE_NAME)
        self._worker.close()

    # ---- file

    def _write(self) -> None:
        path, revision = self.path, self.saved_messages.revision
        if path is None or self._is_file_newer or revision == self._saved_revision:
            return
        self._saved_revision = revision
        snapshot = SavedMessages(self.saved_messages.messages, self.saved_messages.requests)

        def write() -> bool:
            write_atomically(path, encode_saved_messages(snapshot), durable=False, private=True)
            return True

        self._worker.submit(FILE_NAME, write)

    def _read(self, path: Path) -> SavedMessages:
        def parse(data: bytes) -> tuple[SavedMessages, str]:
            saved_messages, unread_count = parse_saved_messages(data)
            template = ngettext(
                "{count} message can't be read", "{count} messages can't be read", unread_count
            )
            return saved_messages, template.format(count=unread_count) if unread_count else ""

        stored = read_stored(path, parse, NewerSavedMessagesError, MAX_BYTES)
        self._is_file_newer = stored.is_newer
        if stored.problem:
            title = _("Saved messages couldn't be read.")
            self._session.alerts.raise_alert("messages:file", "warn", title, stored.problem)
        return stored.value if stored.value is not None else SavedMessages()


def _do_nothing() -> None: ...


def result_text(result: SendResult) -> str:
    """Format the result of sending, such as "2 subscribers" or "412 sent, 3 late messages skipped".

    For a failure, the text is the reason, preceded by the number of messages sent before it if there
    were any.
    """
    if result.kind == "sent":
        return subscribers_text(result.subscriber_count)
    if result.kind == "began":
        return _("started")
    text = ngettext("{count} sent", "{count} sent", result.count).format(count=result.count)
    if result.dropped_count:
        template = ngettext(
            "{count} late message skipped", "{count} late messages skipped", result.dropped_count
        )
        text = f"{text}, {template.format(count=result.dropped_count)}"
    parts = (text if result.count else "", result.message)
    return ", ".join(filter(None, parts)) or text


def subscribers_text(count: int) -> str:
    """Format the number of subscribers, such as "2 subscribers" or "no subscribers"."""
    return (
        ngettext("{count} subscriber", "{count} subscribers", count).format(count=count)
        if count
        else _("no subscribers")
    )


def call_text(record: CallRecord) -> str:
    """Format the result of a call: the time until the reply, or the reason for the failure."""
    if record.state == "answered":
        return _("replied in {time}").format(time=duration_text(record.duration_s))
    return record.error


def duration_text(seconds: float) -> str:
    """Format a measured duration, such as "412 ms" or "1.42 s"."""
    if seconds < 1:
        return _("{count} ms").format(count=max(1, round(seconds * 1000)))
    return _("{count} s").format(count=f"{seconds:.2f}")
