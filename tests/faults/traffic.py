"""The programs on the hosts: a publisher, a subscriber, a server and a client that say what they counted.

Each is started by `code_of` with its options as JSON, says a line when it is ready, and answers each line
that it is given by one of JSON. It ends with its standard input.
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
"""So many messages follow each other at once, so that batches are lost, too."""
Answer = dict[str, Any]


def code_of(part: Callable[[], None]) -> str:
    """The program that is this part."""
    return f"from tests.faults import traffic; traffic.{part.__name__}()"


def _talk(answers: dict[str, Callable[[], Answer]]) -> None:
    sys.stdout.write("ready\n")
    for line in sys.stdin:
        sys.stdout.write(json.dumps(answers[line.strip()]()) + "\n")
        sys.stdout.flush()


class _Worker:
    """A thread that does one thing again and again while it is told to. An error in it is told."""

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
        """When this returns it rests."""
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
    """Publishes numbers, those after `after`. Commands: go, pause, look, told, end (closes the node)."""
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"])
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
        """How far the master knows that it came."""
        (known,) = node.graph().topics[options["topic"]].publishers
        return {"sent": known.last_seq}

    def end() -> Answer:
        worker.end()
        said = look()
        node.close()
        return said

    _talk({"go": worker.go, "pause": pause, "look": look, "told": told, "end": end})


class _Heard:
    """What a subscriber's program was given, in which order."""

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
    """Reads what is published; needs `work_s` seconds for each message. Commands: look, again, end."""
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"])
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
        # The counters first while nothing is read: what comes meanwhile is in neither.
        counted = {"received": sub.received, "lost": sub.lost, "refused": sub.refused}
        told = {name: value for name, value in vars(heard).items() if not name.startswith("_")}
        return {**counted, **told, "error": worker.error}

    def again() -> Answer:
        """Measure the longest silence anew."""
        heard.silent_s = 0.0
        return {}

    def end() -> Answer:
        worker.end()
        node.close()
        return look()

    _talk({"look": look, "again": again, "end": end})


# ---- services


def server() -> None:
    """Answers each call with its number, and counts which it carried out. Commands: look."""
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"])
    done: Counter[str] = Counter()

    def carry_out(request: dict[str, Any]) -> dict[str, Any]:
        done[request["number"]] += 1
        return request

    node.new_server(options["topic"], carry_out, threads=1)
    _talk({"look": lambda: {"done": len(done), "twice": sum(done.values()) - len(done)}})


def client() -> None:
    """Calls repeatedly. Commands: go, pause, look.

    `answered_from` is when the newest answered call started. The time of its answer would not do: a
    call can wait for a new connection and be answered, and then no call fails after a change of address.
    """
    options = json.loads(sys.argv[1])
    node = nep.node(options["node"])
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
