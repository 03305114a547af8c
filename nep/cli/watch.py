"""`nep watch`: alarms of a file, in a terminal, with no window."""

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
from nep.cli.ring import KEEP_S, KEEP_SERVICE, has_ring
from nep.cli.screen import console, say, show_json, write
from nep.cli.values import cleaned
from nep.errors import NepError, nearest
from nep.i18n import _
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.subscriber import Subscriber
from nep.patterns.services.client import Client
from nep.programs.alarms.alarms import Alarms, Done
from nep.programs.alarms.commands import AlarmCommands
from nep.programs.alarms.evaluator import AlarmEvent
from nep.programs.alarms.rule import AlarmAction, AlarmRule
from nep.programs.alarms.rule_file import EXAMPLE, read_alarms
from nep.programs.alarms.sentences import action_words, rule_words, what_words
from nep.programs.robots.guard import MotionGuard
from nep.protocol.graph_view import GraphView
from nep.text import escaped

_AGAIN_S = 1.0
_PATIENCE_S = 0.5
_SLICE_S = 0.05
_SETTLE_S = 1.0
_OF_STUDIO = frozenset({"run", "stop"})
"""What only Studio can do."""
_STYLES = {"on": "bold red", "off": "green", "still": "bold red"}

FileArgument = Annotated[
    str | None,
    typer.Argument(
        metavar=_("FILE"), help=_("The alarms: JSON, as Studio keeps them, too."), show_default=False
    ),
]
CheckOption = Annotated[bool, typer.Option("--check", help=_("Say whether the file is right, and end."))]
ExampleOption = Annotated[bool, typer.Option("--example", help=_("Print a file to begin with, and end."))]
CountOption = Annotated[
    int, typer.Option("--count", "-n", min=0, metavar="N", help=_("End after N alarms; 0 goes on."))
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
    """Watch over topics, values and nodes, as a file of alarms says. Ctrl+C ends it.

    Each alarm is a line when it comes on and when it goes off, with what it saw. It may call a service, send
    a message, ring the terminal's bell, and keep the last seconds where 'nep recording ring' is on; what only
    Studio can do is said at the start. A message that moves a robot is sent only with --allow-moving. A
    master that is away is waited for: messages that still come are watched meanwhile.
    """
    if example:
        write(EXAMPLE)
        return
    if file is None:
        raise NepError(_("give a file of alarms; --example prints one"))
    rules = read_alarms(Path(file)).rules
    if check:
        for rule in rules:
            write(escaped(rule_words(rule)) + "\n")
        say(_("the file is right"))
        return
    if not any(rule.is_on for rule in rules):
        raise NepError(_("no alarm of '{file}' is switched on").format(file=file))
    interrupts.leave_when_told()
    with ExitStack() as opened:
        node = opened.enter_context(Node(f"nep-watch-{os.getpid()}", master=master))
        guard = MotionGuard(node, allow_moving or ())
        watching = _Watching(node, rules, _JsonLines() if as_json else _Lines(), guard)
        opened.callback(watching.close)
        watching.check_sends()
        if not as_json:
            watching.say_begin()
        watching.run(count)


# ---- what is shown


class _Lines:
    """Alarms for people: a line each, coloured on a terminal."""

    def __init__(self) -> None:
        self._console = console()

    def event(self, event: AlarmEvent) -> None:
        """An alarm came on or went off."""
        what = escaped(what_words(event.rule.condition, event.seen))
        if event.kind == "off":
            said = _("well again after {seconds:.1f} s: {what}")
            what = said.format(seconds=event.lasted_s, what=what)
            if event.count > 1:
                what += " " + _("(came {count} times)").format(count=event.count)
        elif event.is_snoozed:
            what = _("{what} (snoozed)").format(what=what)
        self._show(event.kind, event.at_s, what)

    def deed(self, _rule: AlarmRule, words: str, at_s: float) -> None:
        """Something was done."""
        self._show("", at_s, f"  {cleaned(words)}")

    def _show(self, kind: str, at_s: float, words: str) -> None:
        stamp = datetime.fromtimestamp(at_s, tz=timezone.utc).astimezone().strftime("%H:%M:%S.%f")[:-3]
        if not self._console.is_terminal:
            write(f"{stamp}  {words}\n")
            return
        from rich.text import Text  # noqa: PLC0415 - see `nep.cli.screen.console`

        self._console.print(Text.assemble((stamp, "dim"), "  ", (words, _STYLES.get(kind, ""))))


class _JsonLines:
    """Alarms for programs: a JSON text each."""

    def event(self, event: AlarmEvent) -> None:
        """An alarm came on or went off."""
        show_json(
            {
                "alarm": event.rule.id,
                "event": event.kind,
                "at_s": event.at_s,
                "what": what_words(event.rule.condition, event.seen),
                "seen": event.seen,
                "lasted_s": event.lasted_s if event.kind == "off" else None,
                "count": event.count,
                "snoozed": event.is_snoozed,
            }
        )

    def deed(self, rule: AlarmRule, words: str, at_s: float) -> None:
        """Something was done."""
        show_json({"alarm": rule.id, "event": "did", "at_s": at_s, "what": words})


# ---- the work


class _Watching:
    """Alarms over one node: its subscriptions, the graph each second, and what is carried out."""

    def __init__(
        self, node: Node, rules: tuple[AlarmRule, ...], out: _Lines | _JsonLines, guard: MotionGuard
    ) -> None:
        self._node, self._out, self._guard = node, out, guard
        self._commands = AlarmCommands(self._refusal)
        self._keeper: Client | None = None
        carriers: Mapping[str, Callable[[AlarmEvent, AlarmAction, Done], None]] = {
            "banner": _nothing,  # each alarm is a line anyway
            "console": _nothing,
            "sound": self._ring,
            "call": self._command,
            "send": self._command,
            "keep": self._keep,
            **dict.fromkeys(_OF_STUDIO, self._not_here),
        }
        self.alarms = Alarms(rules, carriers=carriers)
        self._subscribers: dict[str, tuple[str, Subscriber]] = {}
        self._view: GraphView | None = None
        self._look_at = 0.0
        self._was_away = False
        self._told = 0

    def check_sends(self) -> None:
        """Raises `typer.BadParameter` for an alarm that would move a robot nobody has allowed to move."""
        sends = [
            action
            for rule in self.alarms.rules
            if rule.is_on
            for action in rule.actions
            if action.kind == "send"
        ]
        if sends:
            self._guard.settle(_SETTLE_S)
        for action in sends:
            refusal = self._guard.refusal(action.name, action.msg_type)
            if refusal:
                raise typer.BadParameter(refusal)

    def say_begin(self) -> None:
        """Say what is watched, and what can't be done here."""
        rules = [rule for rule in self.alarms.rules if rule.is_on]
        for rule in rules:
            say(rule_words(rule))
        studios = dict.fromkeys(
            action_words(action) for rule in rules for action in rule.actions if action.kind in _OF_STUDIO
        )
        if studios:
            said = _("only Studio can do this, so it is not done here: {actions}")
            say(said.format(actions=", ".join(studios)))
        say(_("watching; Ctrl+C ends it"))

    def run(self, count: int) -> None:
        """Watch until Ctrl+C, or until so many alarms have come on."""
        came = 0
        while True:
            self._look()
            for event in self.alarms.tick():
                self._out.event(event)
                came += event.kind == "on"
            self._tell_deeds()
            if count and came >= count and not self.alarms.is_busy:
                return
            # in slices: Windows does not interrupt a wait for Ctrl+C
            self.alarms.evaluator.came.wait(_SLICE_S)

    def close(self) -> None:
        """End the subscriptions; the node ends the rest."""
        self._commands.close()
        self._guard.close()
        for _type, subscriber in self._subscribers.values():
            subscriber.close()
        self._subscribers.clear()

    # ---- the network

    def _look(self) -> None:
        """Ask who is there, once a second; a master that is away is waited for."""
        now = time.monotonic()
        if now < self._look_at:
            return
        try:
            self._view = self._node.graph(_PATIENCE_S)
            self._subscribe(self._view)
            self._guard.see(self._view)
        except NepError as error:
            if not self._was_away:
                say(_("{problem}; waiting").format(problem=error))
            self._was_away, self._view = True, None
        else:
            if self._was_away:
                say(_("a master is there"))
            self._was_away = False
            self._say_unknown(self._view)
        self.alarms.evaluator.see(self._view)
        self._look_at = time.monotonic() + _AGAIN_S

    def _subscribe(self, view: GraphView) -> None:
        """Hear what the rules are about, as the type that it has. Raises `NepError`."""
        for topic in self.alarms.evaluator.topics:
            info = view.topics.get(topic)
            if info is None or not info.publishers:
                continue  # nobody publishes it yet: its type is not known
            held = self._subscribers.get(topic)
            if held is not None and held[0] != info.msg_type:
                held[1].close()
                held = None
            if held is None:
                subscriber = self._node.new_sub(topic, info.msg_type, sink=self._sink(topic), wildcards=False)
                self._subscribers[topic] = (info.msg_type, subscriber)

    def _sink(self, topic: str) -> Callable[[Sequence[Message]], None]:
        return lambda messages: self.alarms.evaluator.take(topic, messages)

    def _say_unknown(self, view: GraphView) -> None:
        """Say once which topics and nodes are not there."""
        if self._told:
            return
        self._told = 1
        topics = [name for name, info in view.topics.items() if info.publishers]
        nodes = [info.name for info in view.nodes.values()]
        for condition in (rule.condition for rule in self.alarms.rules if rule.is_on):
            known = nodes if condition.is_about_node else topics
            if condition.name in known or condition.kind in {"appears", "comes"}:
                continue
            near = nearest(condition.name, known)
            meant = "" if near is None else " " + _("did you mean '{near}'?").format(near=near)
            say(_("'{name}' is not there yet; waiting.{meant}").format(name=condition.name, meant=meant))

    # ---- what is done

    def _refusal(self, _node: Node, topic: str, msg_type: str) -> str:
        self._guard.look()  # an alarm is rare, and a robot may have come just now
        return self._guard.refusal(topic, msg_type)

    def _command(self, _event: AlarmEvent, action: AlarmAction, done: Done) -> None:
        self._commands.carry(self._node, action, done)

    def _keep(self, event: AlarmEvent, action: AlarmAction, done: Done) -> None:
        """By the flight recorder of `nep recording ring`, which may be on another computer."""
        if self._view is None or not has_ring(self._view):
            done(False, _("nothing was kept: no 'nep recording ring' is on"))
            return
        asked = {"seconds": action.seconds, "note": what_words(event.rule.condition, event.seen)}
        try:
            if self._keeper is None:
                self._keeper = self._node.new_client(KEEP_SERVICE, timeout_s=KEEP_S)
            self._keeper.call_async(asked).add_done_callback(lambda ended: _tell_kept(ended, done))
        except NepError as error:
            done(False, _("nothing saved: {reason}").format(reason=error))

    def _ring(self, _event: AlarmEvent, _action: AlarmAction, done: Done) -> None:
        if sys.stderr.isatty():
            sys.stderr.write("\a")
            sys.stderr.flush()
        done(True, "")

    def _not_here(self, _event: AlarmEvent, action: AlarmAction, done: Done) -> None:
        said = _("only Studio can do this: {action}")
        done(False, said.format(action=action_words(action)))

    def _tell_deeds(self) -> None:
        for rule, words, at_s in self.alarms.take_deeds():
            if words:
                self._out.deed(rule, words, at_s)


def _tell_kept(ended: Future[object], done: Done) -> None:
    error = None if ended.cancelled() else ended.exception()
    if error is not None or ended.cancelled():
        done(False, _("nothing saved: {reason}").format(reason=error or ""))
    else:
        told = ended.result()
        path = told.get("path") if isinstance(told, dict) else ""
        done(True, _("saved {file}").format(file=path))


def _nothing(_event: AlarmEvent, _action: AlarmAction, done: Done) -> None:
    done(True, "")
