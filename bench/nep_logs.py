"""Benchmark of logging: a published record, a record dropped by the rate limit, and Studio's Console.

python bench/nep_logs.py
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from app.core.world.console import Console
from nep.messages.message import Message
from nep.nodes.log_handler import LOG_TOPIC, LOG_TYPE, LogHandler

ROUNDS = 60
COUNT = 500
BUSY = 0.05


class Nowhere:
    """Publisher that discards every payload."""

    def publish(self, payload: object) -> None:
        """Discard the payload."""


def plain() -> float:
    """Return the seconds per record with a null handler: the cost of Python's logging itself."""
    logger = logging.getLogger("plain")
    logger.setLevel(logging.INFO)
    logger.propagate = False
    logger.addHandler(logging.NullHandler())
    return timed(lambda: logger.info("record %d", 7))


def published() -> float:
    """Return the seconds per published record, without the publishing itself, which another thread does."""
    handler = LogHandler("bench", Nowhere, rate_hz=1e9, burst=COUNT * ROUNDS)
    handler.logger.propagate = False
    taken = timed(lambda: handler.logger.info("record %d", 7))
    handler.close()
    return taken


def left_out() -> float:
    """Return the seconds per record above the rate limit, which is counted and dropped."""
    handler = LogHandler("bench", Nowhere, rate_hz=0.0, burst=0)
    handler.logger.propagate = False
    taken = timed(lambda: handler.logger.info("record %d", 7))
    handler.close()
    return taken


def unread() -> float:
    """Return the seconds per record that Studio receives while the Console is not displayed."""
    console, messages = Console(), records()
    return timed(lambda: console.add_messages(messages), 50) / len(messages)


def read() -> float:
    """Return the seconds per record that Studio receives and decodes for the Console."""
    console = Console()

    def take() -> None:
        console.add_messages(records())
        assert console.records

    return timed(take, 5) / 100


def records() -> list[Message]:
    """Return a hundred encoded log messages, as received from the log topic."""
    data = (
        b'{"level":"info","text":"record 7","name":"driver","node":"Pepper","stamp_ns":1795164093412000000}'
    )
    return [Message(LOG_TOPIC, data, "json", LOG_TYPE) for _ in range(100)]


def timed(work: Callable[[], object], count: int = COUNT) -> float:
    """Return the seconds per call in the fastest round, which was disturbed least."""
    rounds = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        for _ in range(count):
            work()
        rounds.append((time.perf_counter() - began) / count)
    return min(rounds)


def main() -> int:
    """Print a table; return 1 if two plain series differ by more than 5 %, because the run does not count."""
    base, again = plain(), plain()
    print(f"{'what':<44}{'us a record':>12}{'/ plain':>9}")
    for name, taken in (
        ("plain: Python's logging into nothing", base),
        ("plain again", again),
        ("logged and published", published()),
        ("logged in a flood, counted and left out", left_out()),
        ("into Studio's console, nobody looks", unread()),
        ("into Studio's console, decoded", read()),
    ):
        print(f"{name:<44}{taken * 1e6:>12.2f}{taken / base:>9.2f}")
    if abs(again / base - 1) <= BUSY:
        return 0
    print("this run does not count: the computer was busy")
    return 1


if __name__ == "__main__":
    sys.exit(main())
