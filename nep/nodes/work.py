"""Work of a spinning node: its callbacks, timers and servers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from itertools import chain
from typing import Any, NamedTuple

from nep.backends.base import SubscriberTransport, Transport, Wakeable
from nep.errors import ClosedError, DecodeError, NepError
from nep.i18n import _
from nep.nodes.subscriber import WAIT_SLICE_S, Subscriber
from nep.nodes.timer import Timer, next_due
from nep.patterns.services.registry import ServiceRegistry
from nep.system.arguments import is_coroutine_function
from nep.system.forks import current_generation

NO_MESSAGE = object()
"""Sentinel that `Work.next_item` returns if there is no message."""


class Callback(NamedTuple):
    """Callback of a subscriber.

    Attributes:
        subscriber: The subscriber.
        transport: Transport of the subscriber.
        call: Function to call.
        with_message: True to call the function with messages, False with payloads.
    """

    subscriber: Subscriber
    transport: SubscriberTransport
    call: Callable[[Any], object]
    with_message: bool


class Work:
    """Callbacks, timers and servers of one node, and their scheduling. Thread-safe.

    Args:
        node_name: Name of the node.
        transport: Transport of the node.
        clock: Monotonic clock in seconds.
        services: Servers and clients of the node.
    """

    def __init__(
        self, node_name: str, transport: Transport, clock: Callable[[], float], services: ServiceRegistry
    ) -> None:
        self.clock = clock
        self.transport = transport
        self.services = services
        self.callbacks: tuple[Callback, ...] = ()
        self.timers: tuple[Timer, ...] = ()
        self._is_closed = False
        self._generation = current_generation()
        self._node_name = node_name
        self._lock = threading.Lock()
        self._is_stopped = threading.Event()
        self._watchers: tuple[Wakeable, ...] = ()
        self._coroutine_owner = ""
        """Topic or timer whose callback is a coroutine function, or ""."""

    # ---- callbacks and timers

    def add_callback(self, callback: Callback) -> None:
        """Add a callback, unless its subscriber or the node is closed."""
        with self._lock:
            if not callback.transport.is_closed and not self._is_closed:
                self.callbacks = (*self.callbacks, callback)
                if is_coroutine_function(callback.call):
                    self._coroutine_owner = self._coroutine_owner or callback.subscriber.topic
        self.wake()

    def remove_callback(self, subscriber: Subscriber) -> None:
        """Remove the callback of a closed subscriber."""
        with self._lock:
            self.callbacks = tuple(each for each in self.callbacks if each.subscriber is not subscriber)
            self._update_coroutine_locked()

    def new_timer(self, period_s: float, callback: Callable[[], object]) -> Timer:
        """Create and start a timer. See `Timer`."""
        timer = Timer(period_s, callback, self.clock, self._remove_timer)
        with self._lock:
            if self._is_closed:
                timer.on_node_close()
            else:
                self.timers = (*self.timers, timer)
                if is_coroutine_function(callback):
                    self._coroutine_owner = self._coroutine_owner or repr(timer)
        self.wake()  # a spinning thread may have to wake earlier now
        return timer

    def _remove_timer(self, timer: Timer) -> None:
        with self._lock:
            self.timers = tuple(each for each in self.timers if each is not timer)
            self._update_coroutine_locked()

    def _update_coroutine_locked(self) -> None:
        # Call with the lock held.
        if self._coroutine_owner:
            topics = (each.subscriber.topic for each in self.callbacks if is_coroutine_function(each.call))
            timers = (repr(each) for each in self.timers if is_coroutine_function(each.callback))
            self._coroutine_owner = next(chain(topics, timers), "")

    # ---- state

    @property
    def is_closed(self) -> bool:
        """True if the node was closed, or if this is a forked child process."""
        return self._is_closed or self._generation.is_inherited

    @property
    def is_running(self) -> bool:
        """True until the node is stopped or closed."""
        return not self._is_stopped.is_set() and not self.is_closed

    def stop(self) -> None:
        """Stop the running spin; if none is running, the next one returns immediately."""
        self._is_stopped.set()
        self.wake()

    def reset_stop(self) -> None:
        """Clear a stop request at the end of a spin."""
        if not self._generation.is_inherited:
            self._is_stopped.clear()

    def wake(self) -> None:
        """Wake the spinning thread so that it re-evaluates its work."""
        self.transport.wake()
        for watcher in self._watchers:
            watcher.wake()

    def watch(self, watcher: Wakeable) -> None:
        """Register an object that `wake` also wakes."""
        with self._lock:
            self._watchers = (*self._watchers, watcher)

    def unwatch(self, watcher: Wakeable) -> None:
        """Unregister an object that `watch` registered."""
        if self._generation.is_inherited:
            return
        with self._lock:
            self._watchers = tuple(each for each in self._watchers if each is not watcher)

    def close(self) -> None:
        """Remove all callbacks and timers because the node is closed."""
        with self._lock:
            self._is_closed = True
            self.callbacks = ()
            timers, self.timers = self.timers, ()
        self._is_stopped.set()
        for timer in timers:
            timer.on_node_close()
        for watcher in self._watchers:
            watcher.wake()

    def check_not_forked(self) -> None:
        """Raise `ClosedError` in a forked child process."""
        if self._generation.is_inherited:
            raise ClosedError(f"node '{self._node_name}'", is_forked=True)

    # ---- running

    def run(self) -> bool:
        """Run one round: due timers, one call per server, and one message per callback.

        Returns True if there may be more work.

        Exceptions of callbacks propagate.

        Raises:
            NepError: A callback is a coroutine function.
        """
        if self._coroutine_owner:
            raise NepError(
                _(
                    "the callback of '{what}' is a coroutine function, which 'spin' can't run; use 'await "
                    "node.spin_async()'"
                ).format(what=self._coroutine_owner)
            )
        has_run = self._run_timers() if self.timers else False
        if self.services.has_servers:
            has_run = self.run_servers() or has_run
        return self._run_callbacks() or has_run

    def _run_until(self, until: float) -> bool:
        # A single callback gets messages until the time `until`; several callbacks get one message each.
        callbacks = self.callbacks
        if len(callbacks) != 1 or self.services.has_servers or self._coroutine_owner:
            return self.run()
        has_run = self._run_timers() if self.timers else False
        if self.timers:
            until = min(until, next_due(self.timers))
        if callbacks[0].with_message:
            return self._run_callbacks() or has_run
        return self._run_single_callback(callbacks, until) or has_run

    def _run_single_callback(self, callbacks: tuple[Callback, ...], until: float) -> bool:
        # Returns True if there may be more.
        subscriber, transport, call, _with_message = callbacks[0]
        ready, clock, is_stopped = transport.ready, self.clock, self._is_stopped.is_set
        decoded_unshared, is_burst = subscriber.decoded_unshared, False
        while not is_stopped() and callbacks is self.callbacks:
            message = subscriber.take()
            if message is None:
                return is_burst
            try:
                payload = decoded_unshared(message)
            except DecodeError:
                continue  # already logged and reported
            call(payload)
            if not ready:
                return is_burst
            is_burst = True  # several were received together: there may be more
            if clock() >= until:
                break
        return True

    def run_servers(self) -> bool:
        """Run one call per server; return True if any server had a call."""
        return self.services.run(self._is_stopped)

    def _run_timers(self) -> bool:
        has_fired = False
        for timer in self.timers:
            has_fired = timer.run_if_due() or has_fired
            if not self.is_running:
                break
        return has_fired

    def _run_callbacks(self) -> bool:
        # Returns True if another message was read together with one of these.
        has_more, is_stopped = False, self._is_stopped.is_set
        for subscriber, transport, call, with_message in self.callbacks:
            if is_stopped() or self._is_closed:
                break
            item = self.next_item(subscriber, with_message=with_message)
            if transport.ready:
                has_more = True
            if item is not NO_MESSAGE:
                call(item)
        return has_more

    @staticmethod
    def next_item(subscriber: Subscriber, *, with_message: bool) -> object:
        """Return the next message or payload of a subscriber.

        Returns `NO_MESSAGE` if there is none, or if the next message can't be decoded.
        """
        message = subscriber.take()
        if message is None:
            return NO_MESSAGE
        if subscriber.is_typed:
            message = subscriber.typed(message)
        try:
            payload = subscriber.decoded(message)
        except DecodeError:
            return NO_MESSAGE  # already logged and reported
        return message if with_message else payload

    # ---- waiting

    @property
    def waiting_subscribers(self) -> list[SubscriberTransport]:
        """Transports of the open subscribers that have a callback."""
        return [each[1] for each in self.callbacks if not each[1].is_closed]

    @property
    def next_timer_delay_s(self) -> float:
        """Seconds until the first timer is due; infinite without timers."""
        return next_due(self.timers) - self.clock()

    def _wait(self, timeout_s: float) -> None:
        waiting = [each[1] for each in self.callbacks if not each[1].is_closed]
        if self.services.has_servers:  # has_servers implies that the transport has services
            self.transport.wait(waiting, timeout_s, self.services.queues)  # type: ignore[call-arg]
        else:
            self.transport.wait(waiting, timeout_s)

    def spin(self, timeout_s: float | None) -> None:
        """Run the work in this thread until the node is stopped or closed, or for `timeout_s` seconds.

        See `Node.spin`.
        """
        deadline = None if timeout_s is None else self.clock() + timeout_s
        is_stopped = self._is_stopped.is_set
        try:
            while not is_stopped() and not self.is_closed:
                remaining_s = WAIT_SLICE_S if deadline is None else min(WAIT_SLICE_S, deadline - self.clock())
                if remaining_s <= 0.0:
                    return
                if self._run_until(self.clock() + remaining_s) or self.is_closed:
                    continue
                if self.timers:
                    remaining_s = min(remaining_s, self.next_timer_delay_s)
                if remaining_s > 0.0:
                    self._wait(remaining_s)
            self.check_not_forked()
        finally:
            self.reset_stop()
