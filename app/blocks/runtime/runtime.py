"""What a program may call: robots, waiting, topics, its own functions, and how its scripts begin.

One `Runtime` runs one program. The compiler's names (`namespace`) are its methods and the functions of
`app.blocks.runtime.values`.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from types import ModuleType

from app.blocks.runtime import values
from app.blocks.runtime.broadcasts import Broadcasts, Receiver
from app.blocks.runtime.errors import BehaviourError, explain
from app.blocks.runtime.link import ProgramLink
from app.blocks.runtime.pure import calculation, clock, lists, texts
from app.blocks.runtime.questions import Asked, Questions
from app.blocks.runtime.robot_handle import Replacements, RobotHandle, StatusText
from app.blocks.runtime.scheduler import EndScript, Scheduler, Stopped
from app.blocks.runtime.triggers import Hat, PassGate, changes, event_matches
from app.blocks.runtime.variables import brief_words
from app.robots.description.description import Robot
from nep.i18n import _, lazy, translate

_OWN = (
    "answer", "ask", "ask_with_choices", "broadcast", "broadcast_and_wait", "called", "fail", "newest",
    "number", "on_broadcast", "on_message", "on_start", "on_true", "publish", "reset_timer", "robot", "step",
    "stop_others", "stop_program", "timer", "value", "wait", "wait_until", "write",
)  # fmt: skip
_PURE = (
    "is_known", "join", "length", "part", "random_number", "repeat", "rounded", "rounded_down", "rounded_up",
)  # fmt: skip
_PARTS: tuple[ModuleType, ...] = (calculation, clock, lists, texts)
"""Modules whose ``__all__`` are names of programs."""

Script = Callable[..., None]
Decorator = Callable[[Script], Script]

MESSAGES_WAITING = 16
EVENTS_WAITING = 1
MOST_DEEP = 200
"""How deep functions may call each other."""
_FRAMES = 6000  # Python's own limit: a call of ours with its values takes up to a dozen of its calls


def stop_script() -> None:
    """End the script from inside a function."""
    raise EndScript


class Calls:
    """Runs the functions of one program: how deep they are, and where the script is after one of them."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._mine = threading.local()

    def begin(self) -> None:
        """Let Python go as deep as functions may; for the whole process, which is the program's."""
        sys.setrecursionlimit(max(sys.getrecursionlimit(), _FRAMES))

    def run(self, block: str, name: str, call: Callable[[], object]) -> object:
        """Call; BehaviourError when functions call each other too deep."""
        depth = int(getattr(self._mine, "depth", 0))
        if depth >= MOST_DEEP:
            raise BehaviourError(
                _("“{name}” calls itself more than {count} times.").format(name=name, count=MOST_DEEP),
                block,
            )
        self._mine.depth = depth + 1
        before = self._scheduler.block()
        try:
            result = call()
        finally:
            self._mine.depth = depth
        self._scheduler.return_to(before)
        return result


class Runtime:
    """A program while it runs.

    `printed` gets each line that the program writes, `asked` the question that is to be shown; without it
    nobody can answer. After `start`, `finished` is set when no script is left or one of them failed; then
    ``error`` says why.
    """

    def __init__(
        self,
        printed: Callable[[str], None],
        *,
        labels: Mapping[str, str] | None = None,
        readings: Mapping[str, str] | None = None,
        asked: Asked | None = None,
    ) -> None:
        self._printed = printed
        self._labels = labels or {}
        self._link: ProgramLink | None = None
        self._robots: Mapping[str, Robot] = {}
        self._starts: list[Script] = []
        self._hats: list[tuple[Hat, Script]] = []
        self._subscriptions: list[Callable[[ProgramLink], None]] = []
        self._count_lock = threading.Lock()
        self._running = 0
        self._timer_from_s = 0.0
        self.scheduler = Scheduler()
        self.saying = StatusText(self.scheduler.block, readings or {})
        self.replaced = Replacements()
        self._calls = Calls(self.scheduler)
        self.questions = Questions(self.scheduler, asked)
        self._broadcasts = Broadcasts(self.scheduler, self._one_more, self._one_less)
        self.finished = threading.Event()
        self.error: BehaviourError | None = None

    def namespace(self) -> dict[str, object]:
        """The names that its program may use: methods of this runtime, and pure functions."""
        return (
            {name: getattr(self, name) for name in _OWN}
            | {name: getattr(values, name) for name in _PURE}
            | {name: getattr(part, name) for part in _PARTS for name in part.__all__}
            | {"stop_script": stop_script}
        )

    # ---- beginning and end

    def start(self, link: ProgramLink, robots: Sequence[Robot]) -> None:
        """Begin all scripts; the program's text has run, so its hats are known."""
        self._link = link
        self.reset_timer()
        self._robots = {robot.name: robot for robot in robots}
        self._calls.begin()
        link.listen(self.scheduler.poke, self._stopped_outside)
        for subscribe in self._subscriptions:
            subscribe(link)
        self._running = len(self._starts) + len(self._hats)
        if not self._running:
            self.finished.set()
        with self.scheduler.opening():
            self._start_scripts()

    def _start_scripts(self) -> None:
        for receiver in self._broadcasts.receivers:
            # Not counted: when nothing else runs any more, nobody can send it anything.
            self.scheduler.start(receiver.name, self._guarded(partial(receiver.serve, self.scheduler)))
        for script in self._starts:
            body = self._guarded(partial(self._once, script), over=self._one_less)
            self.scheduler.start(script.__name__, body, idle=False)
        for hat, script in self._hats:
            body = self._guarded(partial(self._each, hat, script), over=self._one_less)
            self.scheduler.start(script.__name__, body)

    def _once(self, script: Script) -> None:
        with suppress(EndScript):
            self.scheduler.begin()
            script()

    def _each(self, hat: Hat, script: Script) -> None:
        """Run a script for each of its events, one after the other."""
        while True:
            arguments = hat.next(self.scheduler)
            with suppress(EndScript):
                self.scheduler.begin()
                script(*arguments)
            self.scheduler.rest()
            if hat.dropped:
                self.write(
                    _("“{title}” could not keep up: {dropped} of its events were skipped").format(
                        title=hat.title, dropped=hat.dropped
                    )
                )
                hat.dropped = 0

    def _guarded(
        self, body: Callable[[], None], over: Callable[[], None] = lambda: None
    ) -> Callable[[], None]:
        def run() -> None:
            try:
                body()
            except Exception as error:  # noqa: BLE001 (whatever a program does wrong belongs to its block)
                block = self.scheduler.block()
                self._fail(explain(error, self._labels.get(block or "", ""), block))
            finally:
                over()

        return run

    def _one_more(self) -> None:
        with self._count_lock:
            self._running += 1

    def _one_less(self) -> None:
        """A script has ended, or has done what a message asked for; the last one ends the program."""
        with self._count_lock:
            self._running -= 1
            last = self._running == 0
        if last:
            self.scheduler.stop()  # those that only receive wait for nobody any more
            self.finished.set()

    def _fail(self, error: BehaviourError) -> None:
        if self.error is None and not self.scheduler.stopping:
            self.error = error
        self.scheduler.stop()
        self.finished.set()

    def _stopped_outside(self, robot: str) -> None:
        self._fail(
            BehaviourError(
                _("{robot} was stopped by another program, so the behaviour ended.").format(robot=robot)
            )
        )

    def stop_program(self) -> None:
        """End all scripts."""
        self.scheduler.stop()
        self.finished.set()
        raise Stopped

    def stop_others(self) -> None:
        """End what all other scripts do now; events start them again."""
        self.scheduler.end_others()

    # ---- blocks

    def step(self, block: str) -> None:
        """A block begins."""
        self.scheduler.step(block)

    def value(self, block: str, work_out: Callable[[], object]) -> object:
        """What a value block gives; its error knows the block."""
        try:
            return work_out()
        except Exception as error:
            raise explain(error, self._labels.get(block, ""), block) from error

    def number(self, block: str, work_out: Callable[[], object]) -> object:
        """The same for a block that gives a number: text put together by "+" is none."""
        result = self.value(block, work_out)
        if result is None or isinstance(result, (int, float)):
            return result
        name = f"“{self._labels.get(block, '')}”"
        if isinstance(result, complex):
            raise BehaviourError(_("{name} has no result for these numbers.").format(name=name), block)
        raise BehaviourError(_("{name} needs numbers, not a text.").format(name=name), block)

    def called(self, block: str, call: Callable[[], object]) -> object:
        """What a function gives back; afterwards the script is where it was before."""
        name = self._labels.get(block, "")
        return self.value(block, lambda: self._calls.run(block, name, call))

    def fail(self, sentence: str) -> object:
        """The block that can't run, says why."""
        raise BehaviourError(sentence)

    def wait(self, seconds: object) -> None:
        """Wait that many seconds."""
        self.scheduler.wait(float(values.number(seconds, lazy("“wait”"))))

    def wait_until(self, condition: Callable[[], object], at_most_s: object = None) -> None:
        """Wait until the condition is so; what is not known yet is not so."""
        limit = None if at_most_s is None else float(values.number(at_most_s, lazy("“wait until”")))
        self.scheduler.wait_until(lambda: _is_so(condition), limit)

    def write(self, value: object) -> None:
        """Write a line to the console."""
        self._printed(values.text(value))

    def show(self, value: object) -> None:
        """Write a value that a person tries: short, and as people say it; nothing while it is not known."""
        self._printed("" if value is None else brief_words(value))

    # ---- questions

    def ask(self, question: object) -> None:
        """Ask the person in front of Studio and wait for the answer."""
        self.questions.ask(question)

    def ask_with_choices(self, question: object, choices: object) -> None:
        """Ask the person in front of Studio which item of a list it shall be, and wait."""
        self.questions.ask_with_choices(question, choices)

    def answer(self) -> object:
        """What was answered last; a number when it reads as one, an empty text before the first answer."""
        return self.questions.answer

    # ---- time

    def timer(self) -> float:
        """Seconds since the beginning, or since the timer was reset; pauses do not count."""
        return round(self.scheduler.running_s() - self._timer_from_s, 3)

    def reset_timer(self) -> None:
        """Let the timer count from 0."""
        self._timer_from_s = self.scheduler.running_s()

    # ---- topics

    def publish(self, topic: str, payload: object) -> None:
        """Send a message."""
        self._linked().publish(topic, payload)

    def newest(self, topic: str, path: str) -> object:
        """A field of a topic's newest message; None while it is not known."""
        message = self._linked().newest(topic)
        return None if message is None else values.part(message, path)

    def broadcast(self, name: str) -> None:
        """Start the scripts that receive this name."""
        self._broadcasts.send(name)

    def broadcast_and_wait(self, name: str) -> None:
        """Start the scripts that receive this name, and wait until they have ended."""
        sent = self._broadcasts.send(name)
        self.scheduler.wait_until(lambda: all(each.done for each in sent), None)

    # ---- what starts a script

    def on_start(self, script: Script) -> Script:
        """The script runs when the program starts."""
        self._starts.append(script)
        return script

    def on_message(self, topic: str) -> Decorator:
        """The script runs for each message."""

        def prepare(hat: Hat, link: ProgramLink) -> None:
            link.on_message(topic, lambda payload: hat.happened((payload,)))

        return self._hat(
            _("when a message arrives on {topic}").format(topic=topic), prepare, MESSAGES_WAITING
        )

    def on_broadcast(self, name: str) -> Decorator:
        """The script runs each time this name is broadcast; from its beginning, if it still runs."""

        def decorate(script: Script) -> Script:
            self._broadcasts.receivers.append(Receiver(name, script))
            return script

        return decorate

    def on_true(self, condition: Callable[[], object]) -> Decorator:
        """The script runs each time the condition becomes so."""

        def decorate(script: Script) -> Script:
            self._hats.append((Hat(_("when … becomes true"), condition=lambda: _is_so(condition)), script))
            return script

        return decorate

    def on_event(self, robot: str, event: str, filters: Mapping[str, object]) -> Decorator:
        """The script runs each time this happens to the robot."""

        def prepare(hat: Hat, link: ProgramLink) -> None:
            description = self._robots[robot].event(event)
            source = self._robots[robot].source

            def told(data: object) -> None:
                if event_matches(data, filters, description, source):
                    hat.happened(())

            link.on_event(robot, event, told)

        return self._hat(_("when {robot} {event}").format(robot=robot, event=event), prepare, EVENTS_WAITING)

    def on_change(self, robot: str, sensor: str) -> Decorator:
        """The script runs each time the sensor tells another value."""

        def prepare(hat: Hat, link: ProgramLink) -> None:
            link.on_sensor(robot, sensor, changes(lambda: hat.happened(())))

        return self._hat(
            _("when {robot} {sensor} changes").format(robot=robot, sensor=sensor), prepare, EVENTS_WAITING
        )

    def on_pass(self, robot: str, sensor: str, side: str, limit: float) -> Decorator:
        """The script runs each time the sensor passes the limit to that side."""

        def prepare(hat: Hat, link: ProgramLink) -> None:
            link.on_sensor(robot, sensor, PassGate(side, limit, lambda: hat.happened(())))

        return self._hat(
            _("when {robot} {sensor} goes {side} {limit}").format(
                robot=robot, sensor=sensor, side=translate("choice", side), limit=f"{limit:g}"
            ),
            prepare,
            EVENTS_WAITING,
        )

    def _hat(self, title: str, prepare: Callable[[Hat, ProgramLink], None], waiting: int) -> Decorator:
        def decorate(script: Script) -> Script:
            hat = Hat(title, most=waiting)
            self._hats.append((hat, script))
            self._subscriptions.append(lambda link: prepare(hat, link))
            return script

        return decorate

    # ---- robots

    def robot(self, name: str) -> RobotHandle:
        """A robot by its name."""
        return RobotHandle(name, self)

    def described(self, name: str) -> Robot:
        """The description of a robot; BehaviourError if it is not there."""
        if name not in self._robots:
            raise BehaviourError(_("{name} is not connected.").format(name=name))
        return self._robots[name]

    @property
    def robot_count(self) -> int:
        """How many robots the program has."""
        return len(self._robots)

    def linked(self) -> ProgramLink:
        """The network."""
        return self._linked()

    def _linked(self) -> ProgramLink:
        if self._link is None:
            raise BehaviourError(_("the program has not started yet."))
        return self._link


def _is_so(condition: Callable[[], object]) -> bool:
    try:
        return bool(condition())
    except BehaviourError as error:
        if error.unknown:
            return False
        raise
