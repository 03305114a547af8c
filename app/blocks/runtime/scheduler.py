"""Cooperative scheduler of scripts: each script is a thread, and the threads take turns.

Only one script runs at a time; it yields to other scripts at each `step` and while it waits. A block is
therefore never interrupted by another script, a pause suspends every script at the start of a block, and a
single step runs exactly one block. See ``docs/adr`` on concurrent scripts.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

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


class Script:
    """State of a script in the scheduler.

    Attributes:
        name: Name of the script.
        wake: Condition that is notified when the script may continue.
        block: Id of the current block; None while the script is idle.
    """

    def __init__(self, name: str, lock: threading.Lock) -> None:
        self.name = name
        self.wake = threading.Condition(lock)
        self.block: str | None = None
        self.is_idle = True  # waits for its event
        self.is_ending = False  # EndScript is raised at its next call
        self.has_external_wait = False  # waits for something that a pause doesn't suspend, such as a reply
        self.has_pausable_wait = False  # waits for time or a condition, which a pause suspends


class Scheduler:
    """Cooperative scheduler that lets one script run at a time.

    Args:
        clock: Monotonic clock in seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._scripts: list[Script] = []
        self._local = threading.local()
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

    # ---- scripts

    def start(self, name: str, body: Callable[[], None], *, idle: bool = True) -> threading.Thread:
        """Start a script in a new thread, in which `body` is called, and return the thread.

        Args:
            name: Name of the script.
            body: Body of the script, which calls `start_run` before it runs blocks.
            idle: True for a script that first waits for an event; False for one that counts as running
                at once.
        """
        script = Script(name, self._lock)
        script.is_idle = idle
        with self._lock:
            self._scripts.append(script)

        def run() -> None:
            self._local.script = script
            try:
                body()
            except StopProgram:
                pass
            finally:
                self._remove_script(script)

        thread = threading.Thread(target=run, name=f"script {name}", daemon=True)
        thread.start()
        return thread

    @contextmanager
    def defer_turns(self) -> Iterator[None]:
        """Return a context manager for starting several scripts, in which no script runs yet."""
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

        Also waits while the program is paused.
        """
        script = self._current_script()
        with self._lock:
            while self._is_paused and not self._is_stopping:
                script.wake.wait()
            self._acquire_turn_locked(script)

    def finish_run(self) -> None:
        """End the current run of the calling script, which is idle until the next `start_run`."""
        script = self._current_script()
        with self._lock:
            script.is_idle, script.block, script.is_ending = True, None, False
            self._release_turn_locked(script)

    def step(self, block: str) -> None:
        """Record that the calling script has reached a block, and let other scripts run.

        The script waits here while the program is paused, and for the delay set by `set_pace`.

        Args:
            block: Id of the block.
        """
        script = self._current_script()
        with self._lock:
            self._raise_if_ended(script)
            script.block = block
            if self._stepping_script is script:
                self._stepping_script = None
            if self.pace_s and not self._is_paused:
                self._wait_locked(script, lambda: self.pace_s, step_ends=True)
            if self._stepping_script is script:
                return  # a step was requested while the script waited here
            if not self._parked_scripts and not self._resuming_scripts and not self._is_paused:
                return
            self._release_turn_locked(script, is_parked=True)
            self._await_turn_locked(script)

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
        """End the current runs of all scripts except the calling one."""
        current = self._current_script()
        with self._lock:
            for script in self._scripts:
                if script is not current:
                    self._end_run_locked(script)

    def _end_run_locked(self, script: Script) -> None:
        if not script.is_idle:
            script.is_ending = True
            script.wake.notify()

    # ---- waiting: other scripts run meanwhile

    def wait(self, seconds: float) -> None:
        """Wait for a number of seconds, not counting pauses, while other scripts run."""
        self.wait_until(None, seconds)

    def wait_until(self, condition: Callable[[], bool] | None, at_most_s: float | None) -> bool:
        """Wait until a condition is true, while other scripts run; return False on timeout.

        Args:
            condition: Evaluated 50 times a second; None to wait until the timeout.
            at_most_s: Timeout in seconds, not counting pauses; None for no limit.
        """
        script = self._current_script()
        remaining_s = at_most_s
        while condition is None or not condition():
            if remaining_s is not None and remaining_s <= 0:
                return False
            slice_s = remaining_s if condition is None else POLL_INTERVAL_S
            if remaining_s is not None and slice_s is not None:
                slice_s = min(slice_s, remaining_s)
            elapsed_s = self._wait_slice(script, slice_s)
            remaining_s = None if remaining_s is None else remaining_s - elapsed_s
        return True

    def _wait_slice(self, script: Script, seconds: float | None) -> float:
        with self._lock:
            return self._wait_locked(script, lambda: seconds)

    def wait_for(
        self, ready: Callable[[], bool], timeout_s: float | None = None, *, idle: bool = False
    ) -> bool:
        """Wait for a change by another thread, while other scripts run; return False on timeout.

        The other thread calls `wake_scripts` after a change. The wait continues while the program is paused.

        Args:
            ready: Condition, called with the lock held; it should only read a value.
            timeout_s: Timeout in seconds; None for no limit.
            idle: True for an idle script that waits for its next event.
        """
        script = self._current_script()
        deadline = None if timeout_s is None else self._clock() + timeout_s
        with self._lock:
            script.has_external_wait = not idle
            self._release_turn_locked(script)
            while not self._has_ended(script) and not ready():
                remaining_s = None if deadline is None else deadline - self._clock()
                if remaining_s is not None and remaining_s <= 0:
                    break
                script.wake.wait(remaining_s)
            script.has_external_wait = False
            self._raise_if_ended(script)
            if not idle:
                self._acquire_turn_locked(script)
            return ready()

    def is_script_paused(self) -> bool:
        """Return True if the calling script is suspended by a pause. Can be called with the lock held."""
        return self._is_paused and self._stepping_script is not self._current_script()

    def wait_while_paused(self) -> None:
        """Wait within a block until the pause ends or a single step is requested."""
        with self._lock:
            script = self._current_script()
            self._wait_locked(script, lambda: None if self._is_paused else 0.0, step_ends=True)

    def wake_scripts(self) -> None:
        """Wake waiting scripts so that they check their conditions. Thread-safe."""
        with self._lock:
            self._wake_all_locked()

    # ---- pause, step, stop: called from other threads

    def pause(self) -> None:
        """Suspend every script at its next block. Thread-safe."""
        with self._lock:
            if not self._is_paused:
                self._paused_since_s = self._clock()
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
                self._paused_total_s += self._clock() - self._paused_since_s
            self._is_paused, self._stepping_script = False, None
            self._grant_turn_locked()
            self._wake_all_locked()

    def running_time_s(self) -> float:
        """Return the time in seconds of a monotonic clock that stops while the program is paused."""
        with self._lock:
            return (self._paused_since_s if self._is_paused else self._clock()) - self._paused_total_s

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
            if self._parked_scripts:
                self._stepping_script = self._parked_scripts.popleft()
                self._resuming_scripts.append(self._stepping_script)
                self._grant_turn_locked()
                return
            self._stepping_script = next(
                (script for script in self._scripts if script.has_pausable_wait), None
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
            blocks = tuple(dict.fromkeys(script.block for script in active if script.block))
            is_quiet = (
                self._owner is None
                and self._stepping_script is None
                and not any(s.has_external_wait for s in active)
            )
            first = next((script.block for script in self._parked_scripts if script.block), None)
            next_block = first or next((script.block for script in active if script.has_pausable_wait), None)
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
            if self._is_paused and self._stepping_script is not script:
                script.wake.wait()
                continue
            started_s = self._clock()
            script.wake.wait(None if max_wait_s is None else max_wait_s - elapsed_s)
            elapsed_s += self._clock() - started_s
        script.has_pausable_wait = False
        self._acquire_turn_locked(script)
        return elapsed_s

    def _current_script(self) -> Script:
        script = getattr(self._local, "script", None)
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
            script.wake.wait()
        if self._has_ended(script) and self._owner is not script:
            self._discard_turn_locked(script)
        self._raise_if_ended(script)

    def _grant_turn_locked(self) -> None:
        if self._owner is not None or self._are_turns_deferred:
            return
        if self._resuming_scripts:
            self._owner = self._resuming_scripts.popleft()
        elif self._parked_scripts and not self._is_paused:
            self._owner = self._parked_scripts.popleft()
        if self._owner is not None:
            self._owner.wake.notify()

    def _wake_all_locked(self) -> None:
        for script in self._scripts:
            script.wake.notify()

    def _remove_script(self, script: Script) -> None:
        with self._lock:
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
        return self._is_stopping or script.is_ending

    def _raise_if_ended(self, script: Script) -> None:
        if self._is_stopping:
            raise StopProgram
        if script.is_ending:
            raise EndScript
