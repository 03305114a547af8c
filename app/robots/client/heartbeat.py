"""Heartbeats to robots, which stop when they no longer receive any."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping

from app.clock import MonotonicClock, ThreadClock
from app.robots.client.dialects import heartbeat
from app.robots.client.limits import HEARTBEAT_INTERVAL_S
from nep.errors import NepError
from nep.system.log_rarely import SuppressedErrors

_log = logging.getLogger(__name__)

Publish = Callable[[Mapping[str, object]], object]


class Heartbeat:
    """Thread that sends heartbeats (``alive``) five times a second to each robot in motion.

    Args:
        sender: Id of this program in the messages.
        thread_name: Name of the thread.
        clock: Clock of the thread (default: that of the computer).
    """

    def __init__(self, sender: str, thread_name: str, clock: ThreadClock | None = None) -> None:
        self._sender, self._thread_name = sender, thread_name
        self._clock: ThreadClock = clock or MonotonicClock()
        self._lock = threading.Lock()
        self._robots: dict[str, Publish] = {}
        self._changed = self._clock.event()
        self._is_closing = False
        self._thread: threading.Thread | None = None
        self._errors = SuppressedErrors(_log, thread_name)

    def start(self, robot: str, publish: Publish) -> None:
        """Send heartbeats to a robot until `stop`.

        Args:
            robot: Name of the robot.
            publish: Function that publishes on the robot's command topic.
        """
        with self._lock:
            self._robots[robot] = publish
            if self._thread is None and not self._is_closing:
                self._thread = self._clock.start_thread(self._run, self._thread_name)
        self._changed.set()

    def stop(self, robot: str) -> None:
        """Stop sending heartbeats to a robot."""
        with self._lock:
            self._robots.pop(robot, None)

    def close(self) -> None:
        """Stop the thread."""
        self._is_closing = True
        self._changed.set()
        if self._thread is not None:
            self._thread.join(timeout=2)

    def _run(self) -> None:
        while True:
            self._changed.clear()
            if self._is_closing:
                return
            with self._lock:
                robots = list(self._robots.values())
            for publish in robots:
                with self._errors:  # an error for one robot must not stop the heartbeats to the others
                    self._publish(publish)
            self._clock.wait(self._changed, HEARTBEAT_INTERVAL_S if robots else None)

    def _publish(self, publish: Publish) -> None:
        try:
            publish(heartbeat(self._sender))
        except NepError:
            return  # the robot or this node is gone; the robot's watchdog stops it
