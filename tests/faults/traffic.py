"""Programs that run on the hosts of a fault test: publisher, subscriber, server and client with counters.

Each is started with `code_of` and gets its options as JSON. It writes `ready`, then replies to each
command line on standard input with a line of JSON. It ends when standard input is closed.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import nep
from nep.errors import NepError

_BURST = 5
"""Number of messages published without a pause, so that batches are lost, too."""
Answer = dict[str, Any]


def code_of(part: Callable[[], None]) -> str:
    """Return the Python code that runs one of these programs."""
    return f"from tests.faults import traffic; traffic.{part.__name__}()"


def _talk(answers: dict[str, Callable[[], Answer]]) -> None:
    sys.stdout.write("ready\n")
    for line in sys.stdin:
        sys.stdout.write(json.dumps(answers[line.strip()]()) + "\n")
        sys.stdout.flush()


class _Worker:
    """Thread that repeats a function until it is paused. An exception pauses it and is stored in `error`."""

    def __init__(self, turn: Callable[[], None], every_s: float = 0.0) -> None:
        self._turn, self._every_s = turn, every_s
        self._goes, self._rests = threading.Event(), threading.Event()
        self._is_over = False
        self.error = ""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def go(self) -> Answer:
        self._rests.clear()
        self._goes.set()
        return {}

    def pause(self) -> None:
        """Pause the thread; return when the current turn has finished."""
        self._goes.clear()
        self._rests.wait()

    def end(self) -> None:
        self._is_over = True
        self._goes.set()
        self._thread.join()

    def _run(self) -> None:
        never = threading.Event()
        while not self._is_over:
            if not self._goes.is_set():
                self._rests.set()
                self._goes.wait()
                continue
            try:
                self._turn()
            except Exception as error:  # noqa: BLE001 - told
                self.error = repr(error)
                self._goes.clear()
            never.wait(self._every_s)


# ---- topics


def publisher() -> None:
    """Publish ascending numbers that start after the option `after`.

    Commands: go, pause, look, told (the sequence number that the master knows), end (closes the node).
    """
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"], options["backend"])
    pub = node.new_pub(options["topic"], latched=options.get("latched", False))
    filling = "x" * options.get("size", 0)
    sent = options.get("after", 0)

    def burst() -> None:
        nonlocal sent
        for _ in range(_BURST):
            sent += 1
            pub.publish([sent, filling])

    worker = _Worker(burst, _BURST / options.get("rate", 500))

    def look() -> Answer:
        return {"sent": pub.count, "subscribers": pub.subscribers, "error": worker.error}

    def pause() -> Answer:
        worker.pause()
        return look()

    def told() -> Answer:
        """Return the newest sequence number of this publisher that the master knows."""
        (known,) = node.graph().topics[options["topic"]].publishers
        return {"sent": known.last_seq}

    def end() -> Answer:
        worker.end()
        said = look()
        node.close()
        return said

    _talk({"go": worker.go, "pause": pause, "look": look, "told": told, "end": end})


class _Heard:
    """Counters of received messages: repeated, reordered and skipped ones, and the longest silence."""

    def __init__(self) -> None:
        self.read = self.last = self.twice = self.backwards = self.skipped = 0
        self.silent_s, self.back_at = 0.0, 0.0
        """The longest time without a message, and when it ended."""
        self._at = 0.0

    def take(self, number: int) -> None:
        now = time.monotonic()
        if self._at and now - self._at > self.silent_s:
            self.silent_s, self.back_at = now - self._at, now
        self._at = now
        self.read += 1
        if number == self.last:
            self.twice += 1
        elif number < self.last:
            self.backwards += 1
        else:
            self.skipped += number - self.last - 1
            self.last = number


def subscriber() -> None:
    """Receive messages and spend `work_s` seconds on each. Commands: look, again, end."""
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"], options["backend"])
    sub = node.new_sub(
        options["topic"], keep=options.get("keep", "all"), max_messages=options.get("max_messages", 10_000)
    )
    heard, work_s, never = _Heard(), options.get("work_s", 0.0), threading.Event()

    def read() -> None:
        message = sub.receive(0.1)
        if message is not None:
            heard.take(message.payload[0])
            if work_s:
                never.wait(work_s)

    worker = _Worker(read)
    worker.go()

    def look() -> Answer:
        # Counters first: while reading is paused, a message that arrives now is in neither.
        counted = {"received": sub.received, "lost": sub.lost, "refused": sub.refused}
        told = {name: value for name, value in vars(heard).items() if not name.startswith("_")}
        return {**counted, **told, "error": worker.error}

    def again() -> Answer:
        """Reset the longest measured silence."""
        heard.silent_s = 0.0
        return {}

    def end() -> Answer:
        worker.end()
        node.close()
        return look()

    _talk({"look": look, "again": again, "end": end})


# ---- services


def server() -> None:
    """Reply to each call with its number, and count executed and repeated requests. Commands: look."""
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"], options["backend"])
    done: Counter[str] = Counter()

    def carry_out(request: dict[str, Any]) -> dict[str, Any]:
        done[request["number"]] += 1
        return request

    node.new_server(options["topic"], carry_out, threads=1)
    _talk({"look": lambda: {"done": len(done), "twice": sum(done.values()) - len(done)}})


def client() -> None:
    """Call the service repeatedly. Commands: go, pause, look.

    `answered_from` is the start time of the newest call that got a reply. The time of the reply is not
    suitable: a call can wait for a new connection and succeed, and then no call fails after a change of
    address.
    """
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"], options["backend"])
    asking = node.new_client(options["topic"], timeout_s=options.get("timeout_s", 1.0))
    ends: Counter[str] = Counter()
    calls = wrong = 0
    answered_from = 0.0

    def call() -> None:
        nonlocal calls, wrong, answered_from
        calls += 1
        start = time.monotonic()
        try:
            wrong += asking.call({"number": f"{options['node']}/{calls}"})["number"] != (
                f"{options['node']}/{calls}"
            )
        except NepError as error:
            ends[type(error).__name__] += 1
        else:
            ends["answered"] += 1
            answered_from = start

    worker = _Worker(call, 0.01)

    def look() -> Answer:
        return {
            "calls": calls,
            "wrong": wrong,
            "ends": ends,
            "answered_from": answered_from,
            "error": worker.error,
        }

    def pause() -> Answer:
        worker.pause()
        return look()

    _talk({"go": worker.go, "pause": pause, "look": look})
