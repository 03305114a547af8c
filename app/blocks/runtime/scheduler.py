"""Cooperative scheduler of scripts: each script is a thread, and the threads take turns.

Only one script runs at a time; it yields to other scripts at each `step` and while it waits. A block is
therefore never interrupted by another script, a pause suspends every script at the start of a block, and a
single step runs exactly one block (docs/adr/0004). Scripts belong to groups, which are held, resumed and
ended separately (docs/adr/0039).
"""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Literal

from app.blocks.runtime.trace import (
    MAX_TEXT_LENGTH,
    AnyRecord,
    BlockEnded,
    BlockInterrupted,
    BlockResumed,
    BlockSkipped,
    BlockWaiting,
    EndCause,
    InterruptionCause,
    SkipCause,
    Trace,
    WaitCause,
)
from app.clock import MonotonicClock, ThreadClock
from nep.i18n import _

POLL_INTERVAL_S = 0.02


class StopProgram(BaseException):
    """Raised in a script when the program ends. Programs must not catch it."""


@dataclass(frozen=True)
class Snapshot:
    """Current state of the scripts.

    Attributes:
        blocks: Ids of the current blocks.
        next_block: Id of the block that a single step runs: the block of a suspended script, else of a
            script that waits for time or a condition; None if there is neither.
        is_paused: True once every script is suspended by a pause.
    """

    blocks: tuple[str, ...]
    next_block: str | None
    is_paused: bool


class EndScript(StopProgram):
    """Raised in a script to end its current run while the program continues. An event can start it again."""


GroupState = Literal["running", "held", "ended", "failed"]


class ScriptGroup:
    """Scripts that are held, resumed and ended together, such as those of one page.

    Created by `Scheduler.new_group`. Thread-safe.

    Attributes:
        name: Name of the group.
        ends_program: True if an error in the group ends the program, False if it ends only the group.
        restarts_blocks: True if a resumed script runs its interrupted wait or action from the beginning,
            False if it continues.
        error: Error that ended the group, or None.
    """

    def __init__(self, scheduler: Scheduler, name: str, *, ends_program: bool) -> None:
        self.name, self.ends_program = name, ends_program
        self.error: Exception | None = None
        self.restarts_blocks = False
        self.is_held = False
        """True between `hold` and `resume`."""
        self.has_ended = False
        """True after `end` or `fail`."""
        self._scheduler = scheduler

    @property
    def state(self) -> GroupState:
        """State of the group: "running", "held", "ended", or "failed" if an error ended it."""
        if self.has_ended:
            return "ended" if self.error is None else "failed"
        return "held" if self.is_held else "running"

    def start(self, name: str, body: Callable[[], None], *, idle: bool = True) -> threading.Thread:
        """Start a script of this group; see `Scheduler.start`.

        Args:
            name: Name of the script.
            body: Body of the script.
            idle: True for a script that first waits for an event.
        """
        return self._scheduler.start(name, body, idle=idle, group=self)

    def hold(self, *, restarts_blocks: bool = False) -> None:
        """Suspend the scripts at their next block, and their waits and robot actions at once.

        Args:
            restarts_blocks: True to run an interrupted wait or action from its beginning after `resume`,
                False to continue it.
        """
        self._scheduler.hold_group(self, restarts_blocks=restarts_blocks)

    def resume(self) -> None:
        """Resume the scripts after `hold`."""
        self._scheduler.resume_group(self)

    def end(self) -> None:
        """End all scripts of the group, including those that wait for events, by raising EndScript."""
        self._scheduler.end_group(self, None)

    def fail(self, error: Exception) -> None:
        """End the group because of an error of one of its scripts; the first error is stored.

        Args:
            error: Error.
        """
        self._scheduler.end_group(self, error)


class Script:
    """State of a script in the scheduler. A running script is identified by this object.

    Attributes:
        number: Number of the script in the trace.
        name: Name of the script.
        group: Group that the script belongs to.
        wake: Event that is set when the script may continue.
        block: Id of the current block; None while the script is idle.
    """

    def __init__(self, number: int, name: str, group: ScriptGroup, wake: threading.Event) -> None:
        self.number, self.name, self.group, self.wake = number, name, group, wake
        self.block: str | None = None
        self.is_idle = True  # waits for its event
        self.is_ending = False  # EndScript is raised at its next call
        self.has_external_wait = False  # waits for something that a pause doesn't suspend, such as a reply
        self.has_pausable_wait = False  # waits for time or a condition, which a pause suspends
        self.must_restart = False  # its wait or action was interrupted and runs again from its beginning
        self.wait_cause: WaitCause | None = None  # recorded for its current block
        self.is_interrupted = False  # recorded as suspended


_current = threading.local()


def current_script() -> Script | None:
    """Return the script that the calling thread runs, or acts for; None in any other thread."""
    script = getattr(_current, "script", None)
    return script if isinstance(script, Script) else None


@contextmanager
def acting_for(script: Script | None) -> Iterator[None]:
    """Return a context manager in which `current_script` returns this script.

    Args:
        script: Script, or None.
    """
    previous = current_script()
    _current.script = script
    try:
        yield
    finally:
        _current.script = previous


class Scheduler:
    """Cooperative scheduler that lets one script run at a time.

    Attributes:
        clock: Clock of all waits.
        trace: Trace of the blocks; see `take_trace`.
        main_group: Group of scripts that are started without a group.

    Args:
        clock: Clock of all waits (default: that of the computer).
    """

    def __init__(self, clock: ThreadClock | None = None) -> None:
        self.clock: ThreadClock = clock if clock is not None else MonotonicClock()
        self.trace = Trace(self.clock.now)
        self._lock = threading.Lock()
        self._scripts: list[Script] = []
        self._numbers = itertools.count(1)
        self._owner: Script | None = None
        self._parked_scripts: deque[Script] = deque()  # waiting before a block
        self._resuming_scripts: deque[Script] = deque()  # continuing a block after a wait
        self._are_turns_deferred = False  # no script gets the turn while scripts are being started
        self._is_paused = False
        self._paused_since_s = 0.0
        self._paused_total_s = 0.0  # total duration of earlier pauses
        self.pace_s = 0.0  # see `set_pace`
        self._stepping_script: Script | None = None
        self._is_stopping = False
        self.main_group = self.new_group("")

    # ---- scripts

    def new_group(self, name: str, *, ends_program: bool = True) -> ScriptGroup:
        """Return a new group without scripts.

        Args:
            name: Name of the group.
            ends_program: True if an error in the group ends the program, False if it ends only the group.
        """
        return ScriptGroup(self, name, ends_program=ends_program)

    def start(
        self, name: str, body: Callable[[], None], *, idle: bool = True, group: ScriptGroup | None = None
    ) -> threading.Thread:
        """Start a script in a new thread, in which `body` is called, and return the thread.

        Args:
            name: Name of the script.
            body: Body of the script, which calls `start_run` before it runs blocks.
            idle: True for a script that first waits for an event; False for one that counts as running
                at once.
            group: Group of the script (default: `main_group`).
        """
        script = Script(next(self._numbers), name, group or self.main_group, self.clock.event())
        script.is_idle = idle
        with self._lock:
            self._scripts.append(script)

        def run() -> None:
            _current.script = script
            try:
                body()
            except StopProgram:
                pass
            finally:
                self._remove_script(script)

        return self.clock.start_thread(run, f"script {name}")

    @contextmanager
    def defer_turns(self) -> Iterator[None]:
        """Return a context manager for starting several scripts, in which no script runs yet."""
        with self.clock.hold():
            with self._lock:
                self._are_turns_deferred = True
            yield
            with self._lock:
                self._are_turns_deferred = False
                self._grant_turn_locked()

    def start_run(self) -> None:
        """Begin a run of the calling script: wait until it is its turn.

        Raises `StopProgram` when the program ends.
        """
        script = self._current_script()
        with self._lock:
            script.is_idle = False
            self._acquire_turn_locked(script)

    def acquire_turn(self) -> None:
        """Wait for the turn of an idle script, to evaluate its condition; call `finish_run` afterwards.

        Also waits while the program is paused or the script's group is held.
        """
        script = self._current_script()
        with self._lock:
            while (self._is_paused or script.group.is_held) and not self._has_ended(script):
                self._sleep_locked(script)
            self._acquire_turn_locked(script)

    def finish_run(self) -> None:
        """End the current run of the calling script, which is idle until the next `start_run`."""
        script = self._current_script()
        with self._lock:
            self._record_end_locked(script)
            script.is_idle, script.is_ending = True, False
            self._release_turn_locked(script)

    def step(self, block: str) -> None:
        """Record that the calling script has reached a block, and let other scripts run.

        The script waits here while the program is paused, and for the delay set by `set_pace`.

        Args:
            block: Id of the block.
        """
        script = self._current_script()
        with self._lock:
            if self._is_stopping or script.is_ending or script.group.has_ended:
                self._raise_if_ended(script)
            script.block, script.wait_cause, script.must_restart = block, None, False
            if self.trace.is_full:
                self.trace.lost_count += 1
            else:
                self.trace.began(script.number, block)
            if self._stepping_script is script:
                self._stepping_script = None
            if self.pace_s and not self._is_paused:
                self._record_wait_locked(script, "pace")
                self._wait_locked(script, lambda: self.pace_s, step_ends=True)
                script.must_restart = False
            if self._stepping_script is script:
                return  # a step was requested while the script waited here
            if not (
                self._parked_scripts or self._resuming_scripts or self._is_paused or script.group.is_held
            ):
                return
            self._release_turn_locked(script, is_parked=True)
            self._await_turn_locked(script)
            script.must_restart = False
            self._record_resumption_locked(script)

    def current_script(self) -> Script:
        """Return the calling script."""
        return self._current_script()

    def end_run(self, script: Script) -> None:
        """End the current run of a script by raising EndScript at its next call of the scheduler.

        Has no effect on an idle script.
        """
        with self._lock:
            self._end_run_locked(script)

    def end_other_runs(self) -> None:
        """End the current runs of all other scripts of the calling script's group."""
        current = self._current_script()
        with self._lock:
            for script in self._scripts:
                if script is not current and script.group is current.group:
                    self._end_run_locked(script)

    def _end_run_locked(self, script: Script) -> None:
        if not script.is_idle:
            script.is_ending = True
            script.wake.set()

    # ---- groups: called by `ScriptGroup`, from any thread

    def hold_group(self, group: ScriptGroup, *, restarts_blocks: bool) -> None:
        """Suspend the scripts of a group; see `ScriptGroup.hold`."""
        with self._lock:
            if group.is_held or group.has_ended:
                return
            group.is_held, group.restarts_blocks = True, restarts_blocks
            for script in self._scripts_of(group):
                script.must_restart = script.must_restart or (restarts_blocks and script.block is not None)
            self._wake_all_locked()

    def resume_group(self, group: ScriptGroup) -> None:
        """Resume the scripts of a group; see `ScriptGroup.resume`."""
        with self._lock:
            group.is_held = False
            self._grant_turn_locked()
            self._wake_all_locked()

    def end_group(self, group: ScriptGroup, error: Exception | None) -> None:
        """End the scripts of a group; see `ScriptGroup.end` and `ScriptGroup.fail`."""
        with self._lock:
            if not group.has_ended:
                group.has_ended, group.is_held, group.error = True, False, error
            self._wake_all_locked()

    def _scripts_of(self, group: ScriptGroup) -> list[Script]:
        return [script for script in self._scripts if script.group is group]

    # ---- trace

    def take_trace(self) -> tuple[AnyRecord, ...]:
        """Return the records of the trace since the last call. Thread-safe."""
        with self._lock:
            return self.trace.take({script.number: script.block for script in self._scripts if script.block})

    def record_failure(self, message: str, block: str | None = None) -> None:
        """Record that the current block of the calling script has failed.

        Args:
            message: Message for the user.
            block: Id of the value in the current block that failed, or None.
        """
        script = self._current_script()
        with self._lock:
            value_block = block if block is not None and block != script.block else ""
            self._record_end_locked(script, "failed", message, value_block)

    def record_stop(self) -> None:
        """Record that all scripts have ended, after `stop`. Thread-safe."""
        with self._lock:
            for script in self._scripts:
                self._record_end_locked(script)

    def record_interruption(self, cause: InterruptionCause) -> None:
        """Record that the current block of the calling script was interrupted.

        Args:
            cause: Why it was interrupted.
        """
        script = self._current_script()
        with self._lock:
            self._record_locked(script, partial(BlockInterrupted, cause=cause))

    def record_skip(self, cause: SkipCause) -> None:
        """Record that the current block of the calling script, or its remainder, was skipped.

        Args:
            cause: Why it was skipped.
        """
        script = self._current_script()
        with self._lock:
            self._record_locked(script, partial(BlockSkipped, cause=cause))

    def _record_locked(
        self, script: Script, create: Callable[[float, int, str], AnyRecord], text_length: int = 0
    ) -> None:
        # `create` gets the time, the number of the script and the id of its current block.
        if script.block is not None:
            record = create(self.trace.time_s(), script.number, script.block)
            self.trace.add(record, len(script.block) + text_length)

    def _record_end_locked(
        self, script: Script, cause: EndCause | None = None, message: str = "", value_block: str = ""
    ) -> None:
        if script.block is None:
            return
        if cause is None:
            is_canceled = script.is_ending or script.group.has_ended
            cause = "canceled" if is_canceled else "stopped" if self._is_stopping else ""
        message = message[:MAX_TEXT_LENGTH]
        create = partial(BlockEnded, cause=cause, text=message, value_block=value_block)
        self._record_locked(script, create, len(message) + len(value_block))
        script.block, script.is_interrupted, script.must_restart = None, False, False

    def _record_wait_locked(self, script: Script, cause: WaitCause) -> None:
        if script.block is not None and script.wait_cause != cause:
            script.wait_cause = cause
            self._record_locked(script, partial(BlockWaiting, cause=cause))

    def _record_suspension_locked(self, script: Script) -> None:
        if script.block is not None and not script.is_interrupted:
            script.is_interrupted = True
            cause: InterruptionCause = "hold" if script.group.is_held else "pause"
            self._record_locked(script, partial(BlockInterrupted, cause=cause))

    def _record_resumption_locked(self, script: Script) -> None:
        if script.block is not None and script.is_interrupted:
            script.is_interrupted = False
            self._record_locked(script, BlockResumed)

    # ---- waiting: other scripts run meanwhile

    def wait(self, seconds: float) -> None:
        """Wait for a number of seconds, not counting pauses, while other scripts run."""
        self.wait_until(None, seconds, cause="time")

    def wait_until(
        self,
        condition: Callable[[], bool] | None,
        at_most_s: float | None,
        *,
        cause: WaitCause = "condition",
    ) -> bool:
        """Wait until a condition is true, while other scripts run; return False on timeout.

        Args:
            condition: Evaluated 50 times a second; None to wait until the timeout.
            at_most_s: Timeout in seconds, not counting pauses; None for no limit.
            cause: What the block waits for, in the trace.
        """
        script = self._current_script()
        remaining_s = at_most_s
        while condition is None or not condition():
            if remaining_s is not None and remaining_s <= 0:
                return False
            slice_s = remaining_s if condition is None else POLL_INTERVAL_S
            if remaining_s is not None and slice_s is not None:
                slice_s = min(slice_s, remaining_s)
            elapsed_s = self._wait_slice(script, slice_s, cause)
            if script.must_restart:
                script.must_restart, remaining_s = False, at_most_s
            elif remaining_s is not None:
                remaining_s -= elapsed_s
        return True

    def _wait_slice(self, script: Script, seconds: float | None, cause: WaitCause) -> float:
        with self._lock:
            self._record_wait_locked(script, cause)
            return self._wait_locked(script, lambda: seconds)

    def wait_for(
        self,
        ready: Callable[[], bool],
        timeout_s: float | None = None,
        *,
        idle: bool = False,
        cause: WaitCause = "robot",
    ) -> bool:
        """Wait for a change by another thread, while other scripts run; return False on timeout.

        The other thread calls `wake_scripts` after a change. The wait continues while the program is paused.

        Args:
            ready: Condition, called with the lock held; it should only read a value.
            timeout_s: Timeout in seconds; None for no limit.
            idle: True for an idle script that waits for its next event.
            cause: What the block waits for, in the trace.
        """
        script = self._current_script()
        deadline = None if timeout_s is None else self.clock.now() + timeout_s
        with self._lock:
            script.has_external_wait = not idle
            if not idle and not ready():
                self._record_wait_locked(script, cause)
            self._release_turn_locked(script)
            while not self._has_ended(script) and not ready():
                remaining_s = None if deadline is None else deadline - self.clock.now()
                if remaining_s is not None and remaining_s <= 0:
                    break
                self._sleep_locked(script, remaining_s)
            script.has_external_wait = False
            self._raise_if_ended(script)
            if not idle:
                self._acquire_turn_locked(script)
            return ready()

    def is_script_paused(self) -> bool:
        """Return True if a pause, or a hold of its group, suspends the calling script.

        Can be called with the lock held.
        """
        return self._is_suspended(self._current_script())

    def must_restart_block(self) -> bool:
        """Return True if the suspended block of the calling script must run again from its beginning.

        False means that it continues where it was suspended; see `ScriptGroup.hold`.
        """
        return self._current_script().must_restart

    def wait_while_paused(self) -> None:
        """Wait within a block until the pause or hold ends, or a single step is requested."""
        with self._lock:
            script = self._current_script()
            self._wait_locked(script, lambda: None if self._is_suspended(script) else 0.0, step_ends=True)
            script.must_restart = False

    def wake_scripts(self) -> None:
        """Wake waiting scripts so that they check their conditions. Thread-safe."""
        with self._lock:
            self._wake_all_locked()

    # ---- pause, step, stop: called from other threads

    def pause(self) -> None:
        """Suspend every script at its next block. Thread-safe."""
        with self._lock:
            if not self._is_paused:
                self._paused_since_s = self.clock.now()
            self._is_paused = True
            self._wake_all_locked()

    @property
    def is_paused(self) -> bool:
        """True between `pause` and `resume`, even during a single step."""
        return self._is_paused

    def resume(self) -> None:
        """Resume all scripts after a pause. Thread-safe."""
        with self._lock:
            if self._is_paused:
                self._paused_total_s += self.clock.now() - self._paused_since_s
            self._is_paused, self._stepping_script = False, None
            self._grant_turn_locked()
            self._wake_all_locked()

    def running_time_s(self) -> float:
        """Return the time in seconds of a monotonic clock that stops while the program is paused."""
        with self._lock:
            return (self._paused_since_s if self._is_paused else self.clock.now()) - self._paused_total_s

    def set_pace(self, seconds: float) -> None:
        """Set the delay of each script at each block.

        Args:
            seconds: Delay in seconds; 0 for full speed.
        """
        self.pace_s = max(0.0, seconds)
        self.wake_scripts()

    def step_once(self) -> None:
        """Run one block of the script that has waited longest.

        Has no effect unless the program is paused, or while a script runs.
        """
        with self._lock:
            if not self._is_paused or self._stepping_script is not None or self._owner is not None:
                return
            parked = self._first_parked()
            if parked is not None:
                self._stepping_script = parked
                self._parked_scripts.remove(parked)
                self._resuming_scripts.append(parked)
                self._grant_turn_locked()
                return
            self._stepping_script = next(
                (each for each in self._scripts if each.has_pausable_wait and not each.group.is_held), None
            )
            self._wake_all_locked()

    def stop(self) -> None:
        """Stop the program: end waiting scripts at once, and other scripts at their next call of a method."""
        with self._lock:
            self._is_stopping = True
            self._wake_all_locked()

    @property
    def is_stopping(self) -> bool:
        """True after `stop` was called."""
        return self._is_stopping

    def restore_block(self, block: str | None) -> None:
        """Set the current block of the calling script after a function call."""
        self._current_script().block = block

    def block(self) -> str | None:
        """Return the id of the current block of the calling script."""
        return self._current_script().block

    def snapshot(self) -> Snapshot:
        """Return the current state of the scripts."""
        with self._lock:
            active = [script for script in self._scripts if not script.is_idle]
            steppable = [script for script in active if not script.group.is_held]
            blocks = tuple(dict.fromkeys(script.block for script in active if script.block))
            is_quiet = (
                self._owner is None
                and self._stepping_script is None
                and not any(s.has_external_wait for s in active)
            )
            first = self._first_parked()
            next_block = (first.block if first is not None else None) or next(
                (script.block for script in steppable if script.has_pausable_wait), None
            )
            return Snapshot(blocks, next_block, self._is_paused and is_quiet and not self._resuming_scripts)

    # ---- the turn; call with the lock held

    def _wait_locked(
        self, script: Script, limit_s: Callable[[], float | None], *, step_ends: bool = False
    ) -> float:
        elapsed_s = 0.0
        script.has_pausable_wait = True
        self._release_turn_locked(script)
        while not self._has_ended(script) and not (step_ends and self._stepping_script is script):
            max_wait_s = limit_s()
            if max_wait_s is not None and elapsed_s >= max_wait_s:
                break
            if self._is_suspended(script):
                self._record_suspension_locked(script)
                self._sleep_locked(script)
                continue
            if script.must_restart:
                break
            self._record_resumption_locked(script)
            started_s = self.clock.now()
            is_woken = self._sleep_locked(script, None if max_wait_s is None else max_wait_s - elapsed_s)
            elapsed_s += self.clock.now() - started_s
            if not is_woken and max_wait_s is not None:  # a rounded sum can be too small
                elapsed_s = max(elapsed_s, max_wait_s)
        script.has_pausable_wait = False
        self._acquire_turn_locked(script)
        self._record_resumption_locked(script)
        return elapsed_s

    def _is_suspended(self, script: Script) -> bool:
        return script.group.is_held or (self._is_paused and self._stepping_script is not script)

    def _sleep_locked(self, script: Script, timeout_s: float | None = None) -> bool:
        # Releases the lock while the script sleeps, until `wake` is set; returns False on timeout.
        script.wake.clear()
        self._lock.release()
        try:
            return self.clock.wait(script.wake, timeout_s)
        finally:
            self._lock.acquire()

    def _current_script(self) -> Script:
        script = getattr(_current, "script", None)
        if isinstance(script, Script):
            return script
        raise RuntimeError(_("this only works in a script; put it below “when started”"))

    def _release_turn_locked(self, script: Script, *, is_parked: bool = False) -> None:
        if self._owner is script:
            self._owner = None
        if is_parked:
            self._parked_scripts.append(script)
        self._grant_turn_locked()

    def _acquire_turn_locked(self, script: Script) -> None:
        self._resuming_scripts.append(script)
        self._grant_turn_locked()
        self._await_turn_locked(script)

    def _await_turn_locked(self, script: Script) -> None:
        while self._owner is not script and not self._has_ended(script):
            if self._is_suspended(script) and script not in self._resuming_scripts:
                self._record_suspension_locked(script)
            self._sleep_locked(script)
        if self._has_ended(script) and self._owner is not script:
            self._discard_turn_locked(script)
        self._raise_if_ended(script)

    def _grant_turn_locked(self) -> None:
        if self._owner is not None or self._are_turns_deferred:
            return
        if self._resuming_scripts:
            self._owner = self._resuming_scripts.popleft()
        elif self._parked_scripts and not self._is_paused:
            self._owner = self._first_parked()
            if self._owner is not None:
                self._parked_scripts.remove(self._owner)
        if self._owner is not None:
            self._owner.wake.set()

    def _first_parked(self) -> Script | None:
        return next((script for script in self._parked_scripts if not script.group.is_held), None)

    def _wake_all_locked(self) -> None:
        for script in self._scripts:
            script.wake.set()

    def _remove_script(self, script: Script) -> None:
        with self._lock:
            self._record_end_locked(script)
            self._scripts.remove(script)
            self._discard_turn_locked(script)
            self._release_turn_locked(script)

    def _discard_turn_locked(self, script: Script) -> None:
        if self._stepping_script is script:
            self._stepping_script = None
        for queue in (self._parked_scripts, self._resuming_scripts):
            if script in queue:
                queue.remove(script)

    def _has_ended(self, script: Script) -> bool:
        return self._is_stopping or script.is_ending or script.group.has_ended

    def _raise_if_ended(self, script: Script) -> None:
        if self._is_stopping:
            raise StopProgram
        if script.is_ending or script.group.has_ended:
            raise EndScript
