"""`nep watch`: evaluate alarm rules in a terminal."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import ExitStack
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated

import typer

from nep.cli import interrupts
from nep.cli.options import AllowMovingOption, JsonOption, MasterOption
from nep.cli.recordings.ring import KEEP_SERVICE, SAVE_TIMEOUT_S, has_flight_recorder
from nep.cli.screen import console, print_status, show_json, write
from nep.cli.topics.topic_wait import suggestion
from nep.cli.values import escape_for_terminal
from nep.errors import NepError
from nep.i18n import _
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.patterns.services.client import Client
from nep.programs.alarms.alarms import Alarms, DoneCallback
from nep.programs.alarms.commands import AlarmCommands
from nep.programs.alarms.evaluator import AlarmEvent
from nep.programs.alarms.rule import AlarmAction, AlarmRule
from nep.programs.alarms.rule_file import EXAMPLE, read_alarms
from nep.programs.alarms.sentences import action_text, event_text, rule_text
from nep.programs.robots.guard import MotionGuard
from nep.protocol.graph_view import GraphView
from nep.text import escaped

_GRAPH_POLL_INTERVAL_S = 1.0
_GRAPH_TIMEOUT_S = 0.5
_EVENT_WAIT_S = 0.05
_ROBOT_DISCOVERY_S = 1.0
_STUDIO_ACTIONS = frozenset({"run", "stop"})
"""Kinds of actions that require Studio."""
_STYLES = {"on": "bold red", "off": "green", "still": "bold red"}

FileArgument = Annotated[
    str | None,
    typer.Argument(
        metavar=_("FILE"), help=_("Alarm file (JSON), such as one saved by Studio."), show_default=False
    ),
]
CheckOption = Annotated[bool, typer.Option("--check", help=_("Validate the file and exit."))]
ExampleOption = Annotated[bool, typer.Option("--example", help=_("Print an example file and exit."))]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=0, metavar="N", help=_("Exit after N alarms (0: never)."))
]


def watch(
    file: FileArgument = None,
    check: CheckOption = False,
    example: ExampleOption = False,
    count: CountOption = 0,
    allow_moving: AllowMovingOption = None,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Evaluate the alarms of a file until Ctrl+C.

    A line is printed when an alarm turns on and when it turns off, with the value that caused it. Alarms can
    call a service, publish a message, ring the terminal's bell, and save the last seconds of 'nep recording
    ring'; actions that need Studio are listed at the start. Messages that move a robot are published only
    with --allow-moving. If the master is down, messages that still arrive are evaluated.
    """
    if example:
        write(EXAMPLE)
        return
    if file is None:
        raise NepError(_("specify an alarm file; --example prints one"))
    rules = read_alarms(Path(file)).rules
    if check:
        for rule in rules:
            write(escaped(rule_text(rule)) + "\n")
        print_status(_("the file is valid"))
        return
    if not any(rule.is_enabled for rule in rules):
        raise NepError(_("all alarms of '{file}' are switched off").format(file=file))
    interrupts.exit_on_termination()
    with ExitStack() as stack:
        node = stack.enter_context(Node(f"nep-watch-{os.getpid()}", master=master))
        guard = MotionGuard(node, allow_moving or ())
        runner = _AlarmRunner(node, rules, _JsonEventPrinter() if as_json else _EventPrinter(), guard)
        stack.callback(runner.close)
        runner.check_send_actions()
        if not as_json:
            runner.show_rules()
        runner.run(count)


# ---- output


class _EventPrinter:
    """Printer of alarm events for people, coloured on a terminal."""

    def __init__(self) -> None:
        self._console = console()

    def print_event(self, event: AlarmEvent) -> None:
        text = escaped(event_text(event.rule.condition, event.value))
        if event.kind == "off":
            template = _("resolved after {seconds:.1f} s: {what}")
            text = template.format(seconds=event.duration_s, what=text)
            if event.count > 1:
                text += " " + _("(occurred {count} times)").format(count=event.count)
        elif event.is_snoozed:
            text = _("{what} (snoozed)").format(what=text)
        self._show(event.kind, event.at_s, text)

    def print_action(self, _rule: AlarmRule, text: str, at_s: float) -> None:
        self._show("", at_s, f"  {escape_for_terminal(text)}")

    def _show(self, kind: str, at_s: float, text: str) -> None:
        stamp = datetime.fromtimestamp(at_s, tz=timezone.utc).astimezone().strftime("%H:%M:%S.%f")[:-3]
        if not self._console.is_terminal:
            write(f"{stamp}  {text}\n")
            return
        from rich.text import Text  # noqa: PLC0415 - see `nep.cli.screen.console`

        self._console.print(Text.assemble((stamp, "dim"), "  ", (text, _STYLES.get(kind, ""))))


class _JsonEventPrinter:
    """Printer of alarm events as JSON lines."""

    def print_event(self, event: AlarmEvent) -> None:
        show_json(
            {
                "alarm": event.rule.id,
                "event": event.kind,
                "at_s": event.at_s,
                "what": event_text(event.rule.condition, event.value),
                "seen": event.value,
                "lasted_s": event.duration_s if event.kind == "off" else None,
                "count": event.count,
                "snoozed": event.is_snoozed,
            }
        )

    def print_action(self, rule: AlarmRule, text: str, at_s: float) -> None:
        show_json({"alarm": rule.id, "event": "did", "at_s": at_s, "what": text})


# ---- evaluation


class _AlarmRunner:
    """Runner of alarms that subscribes to topics, polls the graph and executes actions with one node."""

    def __init__(
        self,
        node: Node,
        rules: tuple[AlarmRule, ...],
        out: _EventPrinter | _JsonEventPrinter,
        guard: MotionGuard,
    ) -> None:
        self._node, self._out, self._guard = node, out, guard
        self._commands = AlarmCommands(self._denial_reason)
        self._save_client: Client | None = None
        action_starters: Mapping[str, Callable[[AlarmEvent, AlarmAction, DoneCallback], None]] = {
            "banner": _do_nothing,  # every alarm is printed anyway
            "console": _do_nothing,
            "sound": self._ring_bell,
            "call": self._run_command,
            "send": self._run_command,
            "keep": self._save_flight_recorder,
            **dict.fromkeys(_STUDIO_ACTIONS, self._skip_studio_action),
        }
        self.alarms = Alarms(rules, action_starters=action_starters)
        self._subscribers: dict[str, tuple[str, Subscriber]] = {}
        self._view: GraphView | None = None
        self._poll_at = 0.0
        self._is_master_down = False
        self._has_reported_unknown = False

    def check_send_actions(self) -> None:
        # Raises `typer.BadParameter` if an alarm would move a robot without permission.
        send_actions = [
            action
            for rule in self.alarms.rules
            if rule.is_enabled
            for action in rule.actions
            if action.kind == "send"
        ]
        if send_actions:
            self._guard.wait_for_descriptions(_ROBOT_DISCOVERY_S)
        for action in send_actions:
            reason = self._guard.denial_reason(action.name, action.msg_type)
            if reason:
                raise typer.BadParameter(reason)

    def show_rules(self) -> None:
        rules = [rule for rule in self.alarms.rules if rule.is_enabled]
        for rule in rules:
            print_status(rule_text(rule))
        studio_actions = dict.fromkeys(
            action_text(action) for rule in rules for action in rule.actions if action.kind in _STUDIO_ACTIONS
        )
        if studio_actions:
            template = _("these actions need Studio and are skipped: {actions}")
            print_status(template.format(actions=", ".join(studio_actions)))
        print_status(_("watching; press Ctrl+C to stop"))

    def run(self, count: int) -> None:
        alarm_count = 0
        while True:
            self._poll_graph()
            for event in self.alarms.tick():
                self._out.print_event(event)
                alarm_count += event.kind == "on"
            self._show_actions()
            if count and alarm_count >= count and not self.alarms.is_busy:
                return
            # in slices: Ctrl+C does not interrupt a wait on Windows
            self.alarms.evaluator.has_events.wait(_EVENT_WAIT_S)

    def close(self) -> None:
        self._commands.close()
        self._guard.close()
        for _type, subscriber in self._subscribers.values():
            subscriber.close()
        self._subscribers.clear()

    # ---- the network

    def _poll_graph(self) -> None:
        now = time.monotonic()
        if now < self._poll_at:
            return
        try:
            self._view = self._node.graph(_GRAPH_TIMEOUT_S)
            self._subscribe(self._view)
            self._guard.update_graph(self._view)
        except NepError as error:
            if not self._is_master_down:
                print_status(_("{problem}; waiting").format(problem=error))
            self._is_master_down, self._view = True, None
        else:
            if self._is_master_down:
                print_status(_("connected to the master"))
            self._is_master_down = False
            self._report_unknown_once(self._view)
        self.alarms.evaluator.update_graph(self._view)
        self._poll_at = time.monotonic() + _GRAPH_POLL_INTERVAL_S

    def _subscribe(self, view: GraphView) -> None:
        for topic in self.alarms.evaluator.topics:
            info = view.topics.get(topic)
            if info is None or not info.publishers:
                continue  # its type is unknown until it is published
            existing = self._subscribers.get(topic)
            if existing is not None and existing[0] != info.msg_type:
                existing[1].close()
                existing = None
            if existing is None:
                subscriber = self._node.new_sub(
                    topic, info.msg_type, sink=self._create_sink(topic), wildcards=False
                )
                self._subscribers[topic] = (info.msg_type, subscriber)

    def _create_sink(self, topic: str) -> Callable[[Sequence[Message]], None]:
        return lambda messages: self.alarms.evaluator.evaluate(topic, messages)

    def _report_unknown_once(self, view: GraphView) -> None:
        if self._has_reported_unknown:
            return
        self._has_reported_unknown = True
        topics = [name for name, info in view.topics.items() if info.publishers]
        nodes = [info.name for info in view.nodes.values()]
        for condition in (rule.condition for rule in self.alarms.rules if rule.is_enabled):
            names = nodes if condition.is_about_node else topics
            if condition.name in names or condition.kind in {"appears", "comes"}:
                continue
            template = _("'{name}' doesn't exist yet; {meant}waiting (Ctrl+C to stop)")
            print_status(template.format(name=condition.name, meant=suggestion(condition.name, names)))

    # ---- actions

    def _denial_reason(self, _node: Node, topic: str, msg_type: str) -> str:
        self._guard.poll()  # alarms are rare, and a robot may just have connected
        return self._guard.denial_reason(topic, msg_type)

    def _run_command(self, _event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        self._commands.start_action(self._node, action, on_done)

    def _save_flight_recorder(self, event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        if self._view is None or not has_flight_recorder(self._view):
            on_done(False, _("nothing saved: 'nep recording ring' isn't running"))
            return
        request = {"seconds": action.recording_s, "note": event_text(event.rule.condition, event.value)}
        try:
            if self._save_client is None:
                self._save_client = self._node.new_client(KEEP_SERVICE, timeout_s=SAVE_TIMEOUT_S)
            self._save_client.call_async(request).add_done_callback(
                lambda future: _report_saved(future, on_done)
            )
        except NepError as error:
            on_done(False, _("nothing saved: {reason}").format(reason=error))

    def _ring_bell(self, _event: AlarmEvent, _action: AlarmAction, on_done: DoneCallback) -> None:
        if sys.stderr.isatty():
            sys.stderr.write("\a")
            sys.stderr.flush()
        on_done(True, "")

    def _skip_studio_action(self, _event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        template = _("this action needs Studio: {action}")
        on_done(False, template.format(action=action_text(action)))

    def _show_actions(self) -> None:
        for rule, text, at_s in self.alarms.take_action_results():
            if text:
                self._out.print_action(rule, text, at_s)


def _report_saved(future: Future[object], on_done: DoneCallback) -> None:
    error = None if future.cancelled() else future.exception()
    if error is not None or future.cancelled():
        on_done(False, _("nothing saved: {reason}").format(reason=error or ""))
    else:
        result = future.result()
        path = result.get("path") if isinstance(result, dict) else ""
        on_done(True, _("saved {file}").format(file=path))


def _do_nothing(_event: AlarmEvent, _action: AlarmAction, on_done: DoneCallback) -> None:
    on_done(True, "")
