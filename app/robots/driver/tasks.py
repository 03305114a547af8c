"""Running what a robot is asked to do: who goes first, who waits, who is ended, when the robot is still.

All decisions are taken in one thread, ``<name> commands``; each running task has a thread of its own. The
deciding thread never waits for a driver's function, so a stop is acted on at once.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial

from app.robots.driver.call import Call, Canceled, Clock, Failed
from app.robots.driver.task import Answer, ProgramId, Task
from app.robots.identity import MAY_MOVE
from nep.i18n import _, lazy, ngettext, number

BEAT_S = 0.5
"""While something runs or waits, the robot says at least so often that it lives."""
STOP_ANSWER_S = 0.5
"""A stop is answered after so long at the latest (or the robot's own `within_s`, when that is longer), also
when something goes on: well before Studio gives up (`app.core.run.control.STOP_TIMEOUT_S`) and calls it
silent."""
_GRACE_S = 1.0
"""So long a function may take to put things away after a cancel, a time-out or one that takes its place."""
_LONGEST_QUEUE = 50
_MOST_RUNNING = 50
"""What uses nothing runs side by side, each in a thread of its own."""
THE_STOP = lazy("the stop itself")
NOTHING_RUNS = lazy("nothing with this id runs")
_JOIN_S = 2.0
_log = logging.getLogger(__name__)


class Watchdog:
    """Hears programs and bites when one falls silent for which the robot acts. It has no thread."""

    def __init__(self, patience_s: float | None) -> None:
        """`patience_s` may pass without a sign of life; None never bites."""
        self.patience_s = patience_s
        self._heard: dict[ProgramId, float] = {}
        self._going_on: dict[str, ProgramId] = {}  # resource -> the program that left it in motion

    def hear(self, program: ProgramId, now: float, *, watch: bool) -> None:
        """A program said something; `watch` begins to expect more (it asked the robot to act)."""
        if self.patience_s is not None and (watch or program in self._heard):
            self._heard[program] = now

    def begins(self, task: Task) -> None:
        """What it uses is not left in motion any more: the task has it now."""
        for used in task.uses:
            self._going_on.pop(used, None)

    def ends_well(self, task: Task) -> None:
        """One that goes on (a speed) leaves what it uses in motion."""
        if task.goes_on and task.program is not None:
            self._going_on |= dict.fromkeys(task.uses, task.program)

    def reset(self) -> None:
        """The robot was stopped: nobody need be heard."""
        self._heard.clear()
        self._going_on.clear()

    def due(self) -> list[float]:
        """When to look again."""
        return [] if self.patience_s is None else [seen + self.patience_s for seen in self._heard.values()]

    def bites(self, now: float, acting: Collection[ProgramId | None]) -> bool:
        """Whether the robot is to stop; `acting` are the programs of what runs or waits now.

        A silent program for which nothing is done is forgotten: it may have ended long ago.
        """
        if self.patience_s is None:
            return False
        silent = [name for name, seen in self._heard.items() if now - seen >= self.patience_s]
        for name in silent:
            del self._heard[name]
        return any(name in acting or name in self._going_on.values() for name in silent)


class Tasks:
    """The tasks of one robot. Methods without another word are for the deciding thread only."""

    def __init__(
        self,
        name: str,
        stop: Callable[[], object],
        clock: Clock,
        *,
        within_s: float,
        watchdog_s: float | None,
        beat: Callable[[tuple[str, ...], str | None], None] | None = None,
    ) -> None:
        """`beat` is called in the deciding thread twice a second while anything runs, waits or did not stop.

        It is given the actions whose functions were told to end and go on, with the sentence for it, and is
        called once more with none of them as soon as the last one has ended. A stop that nobody asked for (of
        the watchdog) and that failed is among them until a stop succeeds: there is no other answer to it.
        """
        self._name, self._stop_body, self._clock, self._beat = name, stop, clock, beat
        self._next_beat_s = 0.0
        self._told_not_ended: tuple[tuple[str, ...], str | None] = ((), None)
        self._stop_is_late = False
        self._not_stopped: str | None = (
            None  # what the last stop said that failed and had nobody to answer to
        )
        self._patience_s = max(STOP_ANSWER_S, within_s)
        self._watchdog = Watchdog(watchdog_s)
        self._inbox: deque[Callable[[], None]] = deque()
        self._wake = threading.Event()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._decide, name=f"{name} commands", daemon=True)
        self._running: list[Task] = []
        self._queue: list[Task] = []
        self._stopper: threading.Thread | None = None
        self._stop_answers: list[tuple[float, Callable[[Answer], None]]] = []

    # ---- for every thread -------------------------------------------------------------------------

    def start(self) -> None:
        """Begin to decide."""
        self._thread.start()

    def call_soon(self, what: Callable[[], None]) -> None:
        """Let the deciding thread do something next."""
        self._inbox.append(what)
        self._wake.set()

    @property
    def backlog(self) -> int:
        """How many things the deciding thread has still to do."""
        return len(self._inbox)

    def close(self) -> None:
        """Stop the robot, end everything and join the threads; a function that never ends is left behind."""
        stopped = threading.Event()

        def take(answer: Answer) -> None:
            self._take_unasked(answer)
            stopped.set()

        self.call_soon(lambda: self.stop(take, _("the driver ends")))
        stopped.wait(self._patience_s + _GRACE_S)
        self._closing.set()
        self._wake.set()
        self._thread.join(_JOIN_S)

    # ---- what is asked ----------------------------------------------------------------------------

    def submit(self, task: Task) -> None:
        """Run a task as soon as what it uses is free; refuse it, or end others, by its busy policy."""
        refused = self._refusal()
        if refused is not None:
            task.finish(Answer("failed", error=f"{task.action}: {refused}"))
            return
        clashing = [other for other in (*self._running, *self._queue) if set(other.uses) & set(task.uses)]
        if clashing and task.on_busy == "reject":
            busy = _("{action}: {robot} is busy with {other}").format(
                action=task.action, robot=self._name, other=clashing[0].title or clashing[0].action
            )
            task.finish(Answer("failed", error=busy))
            return
        if len(self._running) >= _MOST_RUNNING:
            full = _("{action}: {count} other actions run already").format(
                action=task.action, count=_MOST_RUNNING
            )
            task.finish(Answer("failed", error=full))
            return
        if len(self._queue) >= _LONGEST_QUEUE:
            full = _("{action}: {count} other actions are waiting already").format(
                action=task.action, count=_LONGEST_QUEUE
            )
            task.finish(Answer("failed", error=full))
            return
        ended = []
        if task.on_busy == "replace":
            ended = [other for other in clashing if other.cancellable or other in self._queue]
        waits_for = tuple(dict.fromkeys(other.action for other in clashing if other not in ended))
        replaces = tuple(dict.fromkeys(other.action for other in ended))
        task.answer(Answer("accepted", waits_for=waits_for, replaces=replaces))
        replaced = Answer(
            "canceled", error=_("{action} took its place").format(action=task.title or task.action)
        )
        self._drop([other for other in ended if other in self._queue], replaced)
        for other in ended:
            self._end(other, replaced)
        self._queue.append(task)
        self._start_ready()

    def cancel(self, wanted: Callable[[Task], bool]) -> str | None:
        """End the tasks that are wanted; None when there was one, else a sentence."""
        found = [task for task in (*self._running, *self._queue) if wanted(task)]
        if not found:
            return NOTHING_RUNS
        stubborn = [task for task in found if task in self._running and not task.cancellable]
        if stubborn:
            return _("{action} can't be cancelled; it ends by itself").format(action=stubborn[0].action)
        self._drop([task for task in found if task in self._queue], Answer("canceled"))
        for task in found:
            self._end(task, Answer("canceled"))
        return None

    def sign_of_life(self, program: ProgramId, *, watch: bool) -> None:
        """A program said something; `watch` begins to expect more (it asked the robot to act)."""
        self._watchdog.hear(program, self._clock.now(), watch=watch)

    def stop(self, answer: Callable[[Answer], None] | None, why: str = "stopped") -> None:
        """End everything; `answer` is called when the robot stands still and every function has ended.

        What does not end within STOP_ANSWER_S is named in the answers, and nothing is accepted until it has.
        """
        limit = self._clock.now() + self._patience_s
        if answer is not None:
            self._stop_answers.append((limit, answer))
        self._watchdog.reset()
        ended = Answer("canceled", error=why)
        self._drop(list(self._queue), ended)
        for task in self._running:
            if task.ending is None:
                task.end(ended)
                task.due_s = limit
            elif task.due_s is not None:
                task.due_s = min(task.due_s, limit)
            task.stopped = True
        self._start_stop()

    # ---- the deciding thread ----------------------------------------------------------------------

    def _decide(self) -> None:
        while not self._closing.is_set():
            self._clock.wait(self._wake, self._next_due())
            self._wake.clear()
            while self._inbox:
                self._inbox.popleft()()
            self._look_at_clock(self._clock.now())

    def _next_due(self) -> float | None:
        due = [task.due_s for task in self._running if task.due_s is not None]
        due += [limit for limit, _ in self._stop_answers]
        due += self._watchdog.due()
        if self._beat is not None and self._has_to_tell:
            due.append(self._next_beat_s)
        return max(0.0, min(due) - self._clock.now()) if due else None

    @property
    def _is_busy(self) -> bool:
        return bool(self._running or self._queue or self._stopper is not None)

    @property
    def _has_to_tell(self) -> bool:
        return self._is_busy or self._not_stopped is not None

    def _refusal(self) -> str | None:
        """Why nothing is accepted now; None when it is."""
        stopped = [task for task in self._running if task.stopped]
        if self._stop_is_late or any(task.answered for task in stopped):
            return still_moving(self._name, self._not_ended())
        return (
            _("{robot} is stopping").format(robot=self._name)
            if self._stopper is not None or stopped
            else None
        )

    def _not_ended(self) -> tuple[str, ...]:
        """What goes on although it should have ended, and was answered so."""
        names = [task.action for task in self._running if task.answered]
        return tuple(names + [THE_STOP] * self._stop_is_late)

    def _still_moving(self) -> tuple[tuple[str, ...], str | None]:
        """What a sign of life tells: what has not ended, and the sentence for it."""
        not_ended = self._not_ended()
        if not_ended:
            return not_ended, still_moving(self._name, not_ended)
        return ((THE_STOP,) if self._not_stopped is not None else ()), self._not_stopped

    def _tell_beat(self, now: float) -> None:
        """Say in time that the robot lives, and at once when a function that would not end has ended."""
        if self._beat is None:
            return
        told = self._still_moving()
        if (self._has_to_tell and now >= self._next_beat_s) or told != self._told_not_ended:
            self._next_beat_s, self._told_not_ended = now + BEAT_S, told
            self._beat(*told)

    def _look_at_clock(self, now: float) -> None:
        for task in self._running:
            if task.due_s is not None and now >= task.due_s:
                self._overdue(task)
        late = [answer for limit, answer in self._stop_answers if now >= limit]
        self._stop_answers = [pair for pair in self._stop_answers if now < pair[0]]
        if late and self._stopper is not None:
            self._stop_is_late = True
        for answer in late:
            answer(Answer("failed", error=still_moving(self._name, self._not_ended())))
        acting = [task.program for task in (*self._running, *self._queue)]
        if self._watchdog.bites(now, acting):
            self.stop(
                self._take_unasked,
                _("no sign of life from its program for {seconds} s").format(
                    seconds=number(self._watchdog.patience_s or 0.0)
                ),
            )
        self._tell_beat(now)

    def _take_unasked(self, answer: Answer) -> None:
        """The answer to a stop that nobody asked for: a failure is logged, and told by each sign of life."""
        if answer.state == "failed":
            _log.error("%s", answer.error)
            self._not_stopped = answer.error

    def _end(self, task: Task, how: Answer) -> None:
        """Ask for the end; of a function that goes on all the same it is said after a second."""
        if task.ending is None:
            task.end(how)
            task.due_s = self._clock.now() + _GRACE_S

    def _overdue(self, task: Task) -> None:
        if task.ending is None:
            self._end(
                task,
                Answer(
                    "failed",
                    error=_("{action} took longer than {seconds} s").format(
                        action=task.action, seconds=number(task.timeout_s or 0.0)
                    ),
                ),
            )
            return
        task.due_s = None
        why = "" if task.stopped or task.ending.error is None else f" ({task.ending.error})"
        goes_on = still_moving(self._name, [task.action])
        task.finish(Answer("failed", error=f"{goes_on}{why}"))

    def _drop(self, tasks: list[Task], how: Answer) -> None:
        self._queue = [task for task in self._queue if task not in tasks]
        for task in tasks:
            task.finish(how)

    def _start_ready(self) -> None:
        taken = {used for task in self._running for used in task.uses}
        for task in list(self._queue):
            if not taken & set(task.uses):
                self._queue.remove(task)
                self._start(task)
            taken |= set(task.uses)  # also for one that waits: nobody overtakes it

    def _start(self, task: Task) -> None:
        def report(values: Mapping[str, object]) -> None:
            self.call_soon(partial(self._progress, task, dict(values)))

        task.call = Call(task.action, self._clock, report)
        task.due_s = None if task.timeout_s is None else self._clock.now() + task.timeout_s
        self._running.append(task)
        self._watchdog.begins(task)
        task.answer(Answer("running"))
        name = f"{self._name} {task.action}"
        task.thread = threading.Thread(target=self._work, args=(task, task.call), name=name, daemon=True)
        task.thread.start()

    def _progress(self, task: Task, values: dict[str, object]) -> None:
        if not task.answered:
            task.answer(Answer("running", feedback=values))

    def _work(self, task: Task, call: Call) -> None:
        try:
            output = task.run(call)
            done = Answer("succeeded", output=output if isinstance(output, Mapping) else {})
        except Canceled:
            done = Answer("canceled")
        except Failed as failed:
            done = Answer("failed", error=_said(failed))
        except BaseException as error:  # noqa: BLE001 - also SystemExit: whatever it is, it is answered
            _log.warning("%s: %s broke off", self._name, task.action, exc_info=True)
            done = Answer(
                "failed",
                error=_("{action} broke off: {error}").format(action=task.action, error=_said(error)),
            )
        self.call_soon(partial(self._ended, task, done))

    def _ended(self, task: Task, done: Answer) -> None:
        if task.thread is not None:
            task.thread.join(_JOIN_S)
        self._running.remove(task)
        if done.state == "succeeded" and task.ending is None:
            self._watchdog.ends_well(task)
        if task.stopped and task.answered and self._stopper is None:
            # It may have moved the robot after the stop: it is stopped once more, and only then stands still.
            self._stop_is_late = True
            self._start_stop()
        # A function that was told to end may return as if it had finished: what was asked counts.
        task.finish(done if task.ending is None or done.state == "failed" else task.ending)
        self._start_ready()
        self._settle()

    def _start_stop(self) -> None:
        if self._stopper is None:
            self._stopper = threading.Thread(target=self._run_stop, name=f"{self._name} stop", daemon=True)
            self._stopper.start()

    def _run_stop(self) -> None:
        error = None
        try:
            self._stop_body()
        except Failed as failed:
            error = _(MAY_MOVE).format(robot=self._name, why=_said(failed))
        except BaseException as failed:  # noqa: BLE001 - also SystemExit: whatever it is, it is answered
            _log.warning("%s: its stop broke off", self._name, exc_info=True)
            error = _(MAY_MOVE).format(
                robot=self._name, why=_("its stop broke off: {error}").format(error=_said(failed))
            )
        self.call_soon(partial(self._stop_ended, error))

    def _stop_ended(self, error: str | None) -> None:
        if self._stopper is not None:
            self._stopper.join(_JOIN_S)
        self._stopper, self._stop_is_late = None, False
        if error is not None:
            failed = Answer("failed", error=error)
            if not self._stop_answers:
                self._take_unasked(failed)  # who asked was answered already that it had not ended
            elif self._not_stopped is not None:
                self._not_stopped = error
            answers, self._stop_answers = self._stop_answers, []
            for _program, answer in answers:
                answer(failed)
        else:
            self._not_stopped = None
        self._settle()

    def _settle(self) -> None:
        """Answer the stops once its function is through and nothing runs any more."""
        if self._stopper is None and not self._running:
            answers, self._stop_answers = self._stop_answers, []
            for _program, answer in answers:
                answer(Answer("succeeded"))


def still_moving(name: str, actions: Sequence[str]) -> str:
    """The sentence about functions that go on although they were told to end."""
    why = ngettext("{actions} has not ended", "{actions} have not ended", len(actions))
    told = ", ".join(_(THE_STOP) if each == THE_STOP else each for each in actions)
    return _(MAY_MOVE).format(robot=name, why=why.format(actions=told))


def _said(error: BaseException) -> str:
    """What an error says, or its type; one that can't even be told must not keep its action from ending."""
    try:
        return str(error) or type(error).__name__
    except BaseException:  # noqa: BLE001 - a driver's own words are a driver's code
        return type(error).__name__
