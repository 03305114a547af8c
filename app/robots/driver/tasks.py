"""Execution of a robot's tasks: order, policies for resources in use, cancel, stop, watchdog.

All decisions are made in one supervised thread, ``<name> commands`` (`Dispatcher`); each running task has a
separate thread. A stop waits for none of these threads: `Tasks.stop` cancels the running calls in the
caller's thread and wakes the thread of the stop function (`StopThread`). Commands received before a stop are
not executed after it.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from app.clock import ThreadClock
from app.robots.driver.call import Call, Canceled, Failed
from app.robots.driver.dispatcher import Dispatcher
from app.robots.driver.stop_thread import StopThread
from app.robots.driver.task import ProgramId, Task, TaskReply
from app.robots.identity import MAX_ERROR_LENGTH, MAY_MOVE_MESSAGE
from nep.i18n import _, lazy, ngettext, number
from nep.text import bounded_str

HEARTBEAT_INTERVAL_S = 0.5
"""Interval of heartbeats in seconds while a task is running or queued."""
STOP_REPLY_TIMEOUT_S = 0.5
"""Maximum time in seconds until the reply to a stop, even if a function is still running.

A longer ``within_s`` of the robot takes precedence. This is well below the time after which Studio treats a
robot as silent (`app.core.run.control.STOP_TIMEOUT_S`).
"""
_GRACE_S = 1.0
"""Time in seconds for a function to clean up after it was cancelled, replaced or timed out."""
_MAX_QUEUED = 50
_MAX_RUNNING = 50
"""Maximum number of running actions. Actions without resources run in parallel, each in a separate thread."""
STOP_LABEL = lazy("the stop function")
NO_SUCH_TASK_MESSAGE = lazy("no running task has this id")
_MAX_PENDING_STOPS = 2_000
_JOIN_TIMEOUT_S = 2.0
_log = logging.getLogger(__name__)


class Watchdog:
    """Detector of programs that no longer send heartbeats while the robot executes their actions.

    The watchdog has no thread: the caller polls it with `check_expired`.

    Args:
        timeout_s: Maximum time between heartbeats in seconds; None disables the watchdog.
    """

    def __init__(self, timeout_s: float | None) -> None:
        self.timeout_s = timeout_s
        self._heartbeat_times_s: dict[ProgramId, float] = {}
        self._programs_in_motion: dict[str, ProgramId] = {}  # resource -> the program that left it in motion

    def record_heartbeat(self, program: ProgramId, now: float, *, watch: bool) -> None:
        """Record a heartbeat.

        Args:
            program: Sender of the heartbeat.
            now: Time on the clock.
            watch: True to monitor the program from now on, because it has requested an action.
        """
        if self.timeout_s is not None and (watch or program in self._heartbeat_times_s):
            self._heartbeat_times_s[program] = now

    def record_start(self, task: Task) -> None:
        """Record that a task has started, which ends earlier motions that use the same resources."""
        for resource in task.uses:
            self._programs_in_motion.pop(resource, None)

    def record_success(self, task: Task) -> None:
        """Record that a task has succeeded, after which its motion may continue.

        See `Task.continues_after_success`.
        """
        if task.continues_after_success and task.program is not None:
            self._programs_in_motion |= dict.fromkeys(task.uses, task.program)

    def reset(self) -> None:
        """Remove all programs after a stop of the robot."""
        self._heartbeat_times_s.clear()
        self._programs_in_motion.clear()

    def deadlines(self) -> list[float]:
        """Return the times on the clock at which the monitored programs count as silent."""
        return (
            []
            if self.timeout_s is None
            else [heartbeat_s + self.timeout_s for heartbeat_s in self._heartbeat_times_s.values()]
        )

    def check_expired(self, now: float, active_programs: Collection[ProgramId | None]) -> bool:
        """Return True if a silent program has a task or a continuing motion, so that the robot must stop.

        All silent programs are removed; those without a task may have ended long ago.

        Args:
            now: Time on the clock.
            active_programs: Programs of running and queued tasks.
        """
        if self.timeout_s is None:
            return False
        silent_programs = [
            program
            for program, heartbeat_s in self._heartbeat_times_s.items()
            if now - heartbeat_s >= self.timeout_s
        ]
        for program in silent_programs:
            del self._heartbeat_times_s[program]
        return any(
            program in active_programs or program in self._programs_in_motion.values()
            for program in silent_programs
        )


class _PendingStop(NamedTuple):
    """Stop whose requester waits for the reply."""

    run: int
    """Number of the run of the stop function that serves this stop."""
    deadline_s: float
    reply: Callable[[TaskReply], None]


class Tasks:
    """Tasks of one robot. Unless stated otherwise, call methods in the thread of the tasks (`call_soon`).

    Args:
        name: Name of the robot.
        stop: Stop function of the robot.
        clock: Clock of the tasks and their threads.
        within_s: Time in seconds within which the robot stops.
        watchdog_s: Maximum time between heartbeats of a program in seconds; None disables the watchdog.
        send_heartbeat: Sends a heartbeat. Called every `HEARTBEAT_INTERVAL_S` while a task is running or
            queued or a stop has not succeeded. Arguments: names of cancelled actions whose functions are
            still running, and a message about them or about a failed stop of the watchdog, to which there is
            no other reply. Called once more when the last of these functions has ended.
    """

    def __init__(
        self,
        name: str,
        stop: Callable[[], object],
        clock: ThreadClock,
        *,
        within_s: float,
        watchdog_s: float | None,
        send_heartbeat: Callable[[tuple[str, ...], str | None], None] | None = None,
    ) -> None:
        self._name, self._clock, self._publish_heartbeat = name, clock, send_heartbeat
        self._next_heartbeat_s = 0.0
        self._reported_not_ended: tuple[tuple[str, ...], str | None] = ((), None)
        self._is_stop_late = False
        self._unrequested_stop_error: str | None = (
            None  # error of the last failed stop that was not requested
        )
        self._stop_reply_timeout_s = max(STOP_REPLY_TIMEOUT_S, within_s)
        self._watchdog = Watchdog(watchdog_s)
        self._dispatcher = Dispatcher(
            f"{name} commands",
            clock,
            tick=self._tick,
            next_due_s=self._next_due,
            on_restart=self._on_restart,
        )
        self._stop_thread = StopThread(name, stop, self._post_stop_end, clock)
        self._ended_run = 0
        self._ended_error: str | None = None
        self._lock = threading.Lock()
        self._epoch = 0
        self._running: list[Task] = []
        self._queue: list[Task] = []
        self._pending_stops: list[_PendingStop] = []

    # ---- thread-safe methods -------------------------------------------------------------------------

    def start(self) -> None:
        """Start the threads."""
        self._stop_thread.start()
        self._dispatcher.start()

    def call_soon(self, callback: Callable[[], object]) -> None:
        """Run a callback in the thread of the tasks. Thread-safe."""
        self._dispatcher.post(callback)

    @property
    def backlog(self) -> int:
        """Number of pending callbacks in the thread of the tasks."""
        return self._dispatcher.backlog

    @property
    def failures(self) -> int:
        """Number of exceptions that were caught in the thread of the tasks."""
        return self._dispatcher.errors.count

    @property
    def epoch(self) -> int:
        """Number of stops so far. Commands received before the last stop are not executed."""
        return self._epoch

    def stop(self, on_reply: Callable[[TaskReply], None] | None, reason: str = "stopped") -> None:
        """Stop the robot immediately, end all tasks and increment `epoch`. Thread-safe; does not block.

        Args:
            on_reply: Called in the thread of the tasks when the robot stands still and every function
                has ended. Functions that don't end within `STOP_REPLY_TIMEOUT_S` (or the robot's
                ``within_s``, if longer) are named in the reply, and no task is accepted until they have
                ended. Not called if too many stops are pending. None for no reply.
            reason: Reason in the replies to the tasks.
        """
        deadline_s = self._clock.now() + self._stop_reply_timeout_s
        with self._lock:
            self._epoch += 1
            calls = [task.call for task in self._running if task.call is not None]
        for call in calls:
            with self._dispatcher.errors:
                call.cancel()
        run = self._stop_thread.reserve()
        try:
            if self._dispatcher.is_current:
                self._start_stop(run, deadline_s, on_reply, reason)
            elif self._dispatcher.urgent_backlog < _MAX_PENDING_STOPS:
                self._dispatcher.post_urgent(partial(self._start_stop, run, deadline_s, on_reply, reason))
        finally:
            self._stop_thread.wake()

    def close(self) -> None:
        """Stop the robot, end all tasks and join the threads; a function that doesn't end is abandoned."""
        stopped = threading.Event()

        def finish_stop(reply: TaskReply) -> None:
            self._record_unrequested_stop(reply)
            stopped.set()

        self.stop(finish_stop, _("the driver is shutting down"))
        stopped.wait(self._stop_reply_timeout_s + _GRACE_S)
        self._stop_thread.close()
        self._dispatcher.close()

    # ---- requests ----------------------------------------------------------------------------

    def submit(self, task: Task) -> None:
        """Run a task as soon as its resources are free.

        If resources are in use, the task waits, is rejected, or replaces other tasks, according to its
        `on_busy`. It isn't run if the robot is stopping or was stopped after the command was received,
        or if too many tasks are running or waiting.
        """
        if task.epoch is not None and task.epoch < self._epoch:
            self._send_reply(task.finish, _stopped_reply())
            return
        rejection = self._rejection_reason()
        if rejection is not None:
            self._send_reply(task.finish, TaskReply("failed", error=f"{task.action}: {rejection}"))
            return
        conflicting = [other for other in (*self._running, *self._queue) if set(other.uses) & set(task.uses)]
        if conflicting and task.on_busy == "reject":
            error = _("{action}: {robot} is busy with {other}").format(
                action=task.action, robot=self._name, other=conflicting[0].title or conflicting[0].action
            )
            self._send_reply(task.finish, TaskReply("failed", error=error))
            return
        if len(self._running) >= _MAX_RUNNING:
            error = _("{action}: {count} other actions are already running").format(
                action=task.action, count=_MAX_RUNNING
            )
            self._send_reply(task.finish, TaskReply("failed", error=error))
            return
        if len(self._queue) >= _MAX_QUEUED:
            error = _("{action}: {count} other actions are already waiting").format(
                action=task.action, count=_MAX_QUEUED
            )
            self._send_reply(task.finish, TaskReply("failed", error=error))
            return
        to_replace = []
        if task.on_busy == "replace":
            to_replace = [other for other in conflicting if other.cancellable or other in self._queue]
        waits_for = tuple(dict.fromkeys(other.action for other in conflicting if other not in to_replace))
        replaces = tuple(dict.fromkeys(other.action for other in to_replace))
        self._send_reply(task.reply, TaskReply("accepted", waits_for=waits_for, replaces=replaces))
        replaced = TaskReply(
            "canceled", error=_("replaced by {action}").format(action=task.title or task.action)
        )
        self._drop_queued([other for other in to_replace if other in self._queue], replaced)
        for other in to_replace:
            self._end_task(other, replaced)
        self._queue.append(task)
        self._start_ready()

    def cancel(self, is_selected: Callable[[Task], bool]) -> str | None:
        """Cancel tasks; return None on success, else an error message.

        If no task matches, or if a running one can't be cancelled, nothing is cancelled.

        Args:
            is_selected: Returns True for a task to cancel.
        """
        matching = [task for task in (*self._running, *self._queue) if is_selected(task)]
        if not matching:
            return NO_SUCH_TASK_MESSAGE
        uncancellable = [task for task in matching if task in self._running and not task.cancellable]
        if uncancellable:
            return _("{action} can't be cancelled; it ends on its own").format(action=uncancellable[0].action)
        self._drop_queued([task for task in matching if task in self._queue], TaskReply("canceled"))
        for task in matching:
            self._end_task(task, TaskReply("canceled"))
        return None

    def record_heartbeat(self, program: ProgramId, *, watch: bool) -> None:
        """Record a heartbeat of a program.

        Args:
            program: Sender of the heartbeat.
            watch: True to monitor the program from now on, because it has requested an action.
        """
        self._watchdog.record_heartbeat(program, self._clock.now(), watch=watch)

    # ---- thread of the tasks ------------------------------------------------------------------------

    def _start_stop(
        self, run: int, deadline_s: float, on_reply: Callable[[TaskReply], None] | None, reason: str
    ) -> None:
        if on_reply is not None:
            self._pending_stops.append(_PendingStop(run, deadline_s, on_reply))
        self._watchdog.reset()
        ended = TaskReply("canceled", error=reason)
        self._drop_queued(list(self._queue), ended)
        for task in self._running:
            if task.final_reply is None:
                task.request_end(ended)
                task.deadline_s = deadline_s
            elif task.deadline_s is not None:
                task.deadline_s = min(task.deadline_s, deadline_s)
            task.is_stopped = True
        if run <= self._ended_run:  # a concurrent stop's run has already ended
            self._handle_stop_end(self._ended_run, self._ended_error)

    def _on_restart(self) -> None:
        self.stop(self._record_unrequested_stop, _("its driver had an internal error"))

    def _send_reply(self, on_reply: Callable[[TaskReply], None], reply: TaskReply) -> None:
        self._dispatcher.call(partial(on_reply, reply))

    def _next_due(self) -> float | None:
        deadlines_s = [task.deadline_s for task in self._running if task.deadline_s is not None]
        deadlines_s += [pending.deadline_s for pending in self._pending_stops]
        deadlines_s += self._watchdog.deadlines()
        if self._publish_heartbeat is not None and self._needs_heartbeat:
            deadlines_s.append(self._next_heartbeat_s)
        return max(0.0, min(deadlines_s) - self._clock.now()) if deadlines_s else None

    @property
    def _is_busy(self) -> bool:
        return bool(self._running or self._queue or self._is_stopping)

    @property
    def _is_stopping(self) -> bool:
        return self._stop_thread.requested_run > self._ended_run

    @property
    def _needs_heartbeat(self) -> bool:
        return self._is_busy or self._unrequested_stop_error is not None

    def _rejection_reason(self) -> str | None:
        stopped_tasks = [task for task in self._running if task.is_stopped]
        if self._is_stop_late or any(task.has_replied for task in stopped_tasks):
            return still_moving_message(self._name, self._unfinished_actions())
        return (
            _("{robot} is stopping").format(robot=self._name) if self._is_stopping or stopped_tasks else None
        )

    def _unfinished_actions(self) -> tuple[str, ...]:
        names = [task.action for task in self._running if task.has_replied]
        return tuple(names + [STOP_LABEL] * self._is_stop_late)

    def _unfinished_report(self) -> tuple[tuple[str, ...], str | None]:
        not_ended = self._unfinished_actions()
        if not_ended:
            return not_ended, still_moving_message(self._name, not_ended)
        return (
            (STOP_LABEL,) if self._unrequested_stop_error is not None else ()
        ), self._unrequested_stop_error

    def _send_heartbeat(self) -> None:
        if self._publish_heartbeat is None:
            return
        now = self._clock.now()
        report = self._unfinished_report()
        if (self._needs_heartbeat and now >= self._next_heartbeat_s) or report != self._reported_not_ended:
            self._next_heartbeat_s, self._reported_not_ended = now + HEARTBEAT_INTERVAL_S, report
            self._publish_heartbeat(*report)

    def _tick(self) -> None:
        for step in (
            self._end_overdue,
            self._reply_to_late_stops,
            self._watch_programs,
            self._send_heartbeat,
        ):
            self._dispatcher.call(step)

    def _end_overdue(self) -> None:
        now = self._clock.now()
        for task in list(self._running):
            if task.deadline_s is not None and now >= task.deadline_s:
                self._handle_timeout(task)

    def _reply_to_late_stops(self) -> None:
        now = self._clock.now()
        late_stops = [pending for pending in self._pending_stops if now >= pending.deadline_s]
        self._pending_stops = [pending for pending in self._pending_stops if now < pending.deadline_s]
        if any(pending.run > self._ended_run for pending in late_stops):
            self._is_stop_late = True
        for pending in late_stops:
            self._send_reply(
                pending.reply,
                TaskReply("failed", error=still_moving_message(self._name, self._unfinished_actions())),
            )

    def _watch_programs(self) -> None:
        active_programs = [task.program for task in (*self._running, *self._queue)]
        if self._watchdog.check_expired(self._clock.now(), active_programs):
            self.stop(
                self._record_unrequested_stop,
                _("its program hasn't responded for {seconds} s").format(
                    seconds=number(self._watchdog.timeout_s or 0.0)
                ),
            )

    def _record_unrequested_stop(self, reply: TaskReply) -> None:
        if reply.state == "failed":
            if reply.error != self._unrequested_stop_error:  # log repeated failures once
                _log.error("%s", reply.error)
            self._unrequested_stop_error = reply.error

    def _end_task(self, task: Task, final_reply: TaskReply) -> None:
        # A function that keeps running is reported after `_GRACE_S`.
        if task.final_reply is None:
            task.request_end(final_reply)
            task.deadline_s = self._clock.now() + _GRACE_S

    def _handle_timeout(self, task: Task) -> None:
        if task.final_reply is None:
            self._end_task(
                task,
                TaskReply(
                    "failed",
                    error=_("{action} took longer than {seconds} s").format(
                        action=task.action, seconds=number(task.timeout_s or 0.0)
                    ),
                ),
            )
            return
        task.deadline_s = None
        details = "" if task.is_stopped or task.final_reply.error is None else f" ({task.final_reply.error})"
        still_moving = still_moving_message(self._name, [task.action])
        self._send_reply(task.finish, TaskReply("failed", error=f"{still_moving}{details}"))

    def _drop_queued(self, tasks: list[Task], reply: TaskReply) -> None:
        self._queue = [task for task in self._queue if task not in tasks]
        for task in tasks:
            self._send_reply(task.finish, reply)

    def _start_ready(self) -> None:
        busy_resources = {resource for task in self._running for resource in task.uses}
        for task in list(self._queue):
            if not busy_resources & set(task.uses):
                self._queue.remove(task)
                self._start(task)
            busy_resources |= set(task.uses)  # waiting tasks keep their place in the queue

    def _start(self, task: Task) -> None:
        def report(values: Mapping[str, object]) -> None:
            self.call_soon(partial(self._report_progress, task, dict(values)))

        call = Call(task.action, self._clock, report)
        with self._lock:  # either a concurrent stop sees the call, or the task sees the new epoch
            is_stopped = task.epoch is not None and task.epoch < self._epoch
            if not is_stopped:
                task.call = call
                self._running.append(task)
        if is_stopped:
            self._send_reply(task.finish, _stopped_reply())
            return
        task.deadline_s = None if task.timeout_s is None else self._clock.now() + task.timeout_s
        self._watchdog.record_start(task)
        self._send_reply(task.reply, TaskReply("running"))
        try:
            task.thread = self._clock.start_thread(
                partial(self._run_task, task, call), f"{self._name} {task.action}"
            )
        except (RuntimeError, MemoryError) as error:  # out of threads
            self._finish_task(task, TaskReply("failed", error=self._failure_message(task, error)))

    def _report_progress(self, task: Task, values: dict[str, object]) -> None:
        if not task.has_replied:
            self._send_reply(task.reply, TaskReply("running", feedback=values))

    def _run_task(self, task: Task, call: Call) -> None:
        reply = TaskReply("failed", error=task.action)
        try:
            reply = self._outcome(task, call)
            call.close()
        finally:
            self.call_soon(partial(self._finish_task, task, reply))

    def _outcome(self, task: Task, call: Call) -> TaskReply:
        try:
            if call.canceled:  # by a stop before this thread started
                raise Canceled
            output = task.run(call)
        except Canceled:
            return TaskReply("canceled")
        except Failed as failed:
            return TaskReply("failed", error=bounded_str(failed, MAX_ERROR_LENGTH))
        except BaseException as error:  # noqa: BLE001 - also SystemExit: a task must always get a reply
            _log.warning("%s: %s raised an exception", self._name, task.action, exc_info=True)
            return TaskReply("failed", error=self._failure_message(task, error))
        return TaskReply("succeeded", output=output if isinstance(output, Mapping) else {})

    def _failure_message(self, task: Task, error: BaseException) -> str:
        return _("{action} failed: {error}").format(
            action=task.action, error=bounded_str(error, MAX_ERROR_LENGTH)
        )

    def _finish_task(self, task: Task, reply: TaskReply) -> None:
        if task.thread is not None:
            task.thread.join(_JOIN_TIMEOUT_S)
        with self._lock:
            self._running.remove(task)
        if reply.state == "succeeded" and task.final_reply is None:
            self._watchdog.record_success(task)
        if task.is_stopped:
            # It may have moved the robot after the stop function began, so the robot is stopped again.
            self._is_stop_late = self._is_stop_late or task.has_replied
            run = self._stop_thread.reserve_next()
            self._stop_thread.wake()
            self._pending_stops = [pending._replace(run=run) for pending in self._pending_stops]
        # A function that was asked to end may return normally; the requested ending counts.
        self._send_reply(
            task.finish, reply if task.final_reply is None or reply.state == "failed" else task.final_reply
        )
        self._start_ready()
        self._complete_stops()

    def _post_stop_end(self, run: int, error: str | None) -> None:
        # Runs in the thread of the stop function.
        self._dispatcher.post_urgent(partial(self._handle_stop_end, run, error))

    def _handle_stop_end(self, run: int, error: str | None) -> None:
        self._ended_run, self._ended_error = run, error
        self._is_stop_late = self._is_stop_late and self._is_stopping
        if error is None:
            self._unrequested_stop_error = None
            self._complete_stops()
            return
        failed = TaskReply("failed", error=error)
        answered = [pending for pending in self._pending_stops if pending.run <= run]
        self._pending_stops = [pending for pending in self._pending_stops if pending.run > run]
        if not answered and self._is_stopping:
            return  # the next run decides
        if not answered:
            self._record_unrequested_stop(failed)  # the requesters have already received a failure reply
        elif self._unrequested_stop_error is not None:
            self._unrequested_stop_error = error
        for pending in answered:
            self._send_reply(pending.reply, failed)

    def _complete_stops(self) -> None:
        # Replies to the stops whose run of the stop function has ended, once no task runs.
        if self._running:
            return
        completed = [pending for pending in self._pending_stops if pending.run <= self._ended_run]
        self._pending_stops = [pending for pending in self._pending_stops if pending.run > self._ended_run]
        for pending in completed:
            self._send_reply(pending.reply, TaskReply("succeeded"))


def _stopped_reply() -> TaskReply:
    return TaskReply("canceled", error=_("the robot was stopped before this action started"))


def still_moving_message(name: str, actions: Sequence[str]) -> str:
    """Return the error message about cancelled functions that are still running.

    Args:
        name: Name of the robot.
        actions: Names of the functions' actions.
    """
    reason = ngettext("{actions} is still running", "{actions} are still running", len(actions))
    action_names = ", ".join(_(STOP_LABEL) if each == STOP_LABEL else each for each in actions)
    return _(MAY_MOVE_MESSAGE).format(robot=name, why=reason.format(actions=action_names))
