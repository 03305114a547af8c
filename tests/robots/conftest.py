"""Shared fixtures of the robot tests: a fake clock, a robot, and a client that records its topics."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Annotated, Literal

import pytest

import nep
from app.clock import VirtualClock
from app.robots.kit import (
    Call,
    Canceled,
    Colour,
    Driver,
    Failed,
    Kind,
    Link,
    Range,
    Suggested,
    Text,
    action,
    event,
    safe_stop,
    sensor,
)

_MIN_POLL_INTERVAL_S, _MAX_POLL_INTERVAL_S = 0.002, 0.01


def eventually(true: Callable[[], object], timeout_s: float = 60.0) -> None:
    """Wait until `true()` is true; fail after `timeout_s` seconds."""
    never = threading.Event()
    end, interval_s = time.monotonic() + timeout_s, _MIN_POLL_INTERVAL_S
    while not true():
        assert time.monotonic() < end, "it never came true"
        never.wait(interval_s)
        interval_s = min(1.2 * interval_s, _MAX_POLL_INTERVAL_S)


class Turtle:
    """Small robot whose actions finish when the test sets `go_on`."""

    battery = sensor(Annotated[int, Range(0, 100, unit="%")], title="battery", text="battery", icon="battery")
    bumped = event(
        "when %robot bumps into something on the %side",
        title="bumped",
        icon="zap",
        fields={"side": Literal["left", "right"]},
        choose=("side",),
        rize=lambda data: ("bumpers", {str(data["side"]): 1}),
    )

    def __init__(self, link: Link) -> None:
        self.link = link
        self.done: list[object] = []
        self.go_on = threading.Event()
        self.moving = False
        self.stop_calls = self.stops = 0  # calls of `stop` that have begun, and those that have ended
        self.may_stop = threading.Event()
        self.may_stop.set()
        self.is_closed = False
        self.breaks: BaseException = ZeroDivisionError()
        self.stop_fails: BaseException | None = None

    def close(self) -> None:
        self.is_closed = True

    @action("move %distance m", category="Movement", icon="move", uses=("base",), on_busy="replace",
            timeout_s=5, risk="locomotes", feedback={"moved": float})  # fmt: skip
    def move(
        self, call: Call, distance: Annotated[float, Range(-2, 2, 0.05, "m")] = 0.5
    ) -> dict[str, object]:
        """Move until the test lets it arrive."""
        self.moving = True
        call.feedback(moved=0.0)
        try:
            self._let(call)
        finally:
            self.moving = False
        self.done.append(("move", distance))
        return {"moved": distance}

    @action("say %text", category="Speech", icon="mic", uses=("speech",), on_busy="queue", rize="say")
    def say(self, call: Call, text: Annotated[str, Text(1, 40), Suggested("hi")]) -> None:
        """Say a text; finished by the test."""
        self._let(call)
        self.done.append(("say", text))

    @action("light %colour", category="Looks", icon="lightbulb", cancellable=False, rize="leds")
    def light(self, call: Call, colour: Colour = "#ffffff", bright: bool = True) -> None:
        """Set the colour at once."""
        self.done.append(("light", colour, bright))

    @action("dig %times times", category="Movement", icon="move", uses=("base",), on_busy="reject")
    def dig(self, call: Call, times: Annotated[int, Range(1, 9)] = 1) -> None:
        """Dig; rejected while the robot moves."""
        self.done.append(("dig", times))

    @action("fail", category="Movement", icon="x")
    def fail(self, call: Call, how: Literal["told", "broken"] = "told") -> None:
        """Fail always."""
        if how == "told":
            raise Failed("no fuel")
        raise self.breaks

    @action("ignore", category="Movement", icon="x", uses=("base",), timeout_s=5)
    def ignore(self, call: Call) -> None:
        """Ignore cancellation."""
        self.go_on.wait(60)

    def _let(self, call: Call) -> None:
        # Not the call's clock, which only tests advance; real drivers use call.until(...).
        while not self.go_on.wait(0.005):
            if call.canceled:
                raise Canceled

    @safe_stop(watchdog_s=1.0, within_s=0.2)
    def stop(self) -> None:
        """Stop the motion once the test sets `may_stop`."""
        self.stop_calls += 1
        self.may_stop.wait(60)
        if self.stop_fails is not None:
            raise self.stop_fails
        self.stops += 1
        self.moving = False


TURTLE = Kind(model="turtle", title="Turtle", body=Turtle)


class Ears:
    """Client that records topics of a robot and sends commands to it."""

    def __init__(self, node: nep.Node, name: str) -> None:
        self.name = name
        self.heard: dict[str, list[object]] = {}
        self._node = node
        self._command = node.new_pub(f"/{name}/command", "robot/command")
        self._rize = node.new_pub("robot_action", "json")
        self.listen("answer", "robot/answer")
        self.listen("action_state", topic="action_state")

    def listen(self, leaf: str, msg_type: str = "json", topic: str | None = None) -> list[object]:
        kept: list[object] = self.heard.setdefault(leaf, [])
        self._node.new_sub(
            topic or f"/{self.name}/{leaf}",
            msg_type,
            sink=lambda batch: kept.extend(m.payload for m in batch),
        )
        return kept

    def command(self, **command: object) -> None:
        self._command.publish(command)

    def invoke(self, wanted: str, action: str, program: str | None = None, **given: object) -> None:
        self.command(
            id=wanted, op="invoke", action=action, input=given, **({"from": program} if program else {})
        )

    def rize(self, message: dict[str, object]) -> None:
        self._rize.publish(message)

    def answers(self, wanted: str) -> list[dict[str, object]]:
        return [a for a in list(self.heard["answer"]) if a["id"] == wanted]

    def states(self, wanted: str) -> list[object]:
        return [a["state"] for a in self.answers(wanted)]

    def final(self, wanted: str, op: str = "invoke", timeout_s: float = 60.0) -> dict[str, object]:
        """Wait for the final reply to a command and return it."""

        def ends() -> list[dict[str, object]]:
            final = {"succeeded", "failed", "canceled"}
            return [a for a in self.answers(wanted) if a["state"] in final and a["op"] == op]

        eventually(ends, timeout_s)
        return ends()[0]


@pytest.fixture
def clock() -> VirtualClock:
    """Clock that advances only when the test calls `advance`."""
    return VirtualClock(advances_alone=False)


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("robots", "memory") as made:
        yield made


@pytest.fixture
def turtle(node: nep.Node, clock: VirtualClock) -> Iterator[tuple[Turtle, Ears, VirtualClock]]:
    """Running turtle, a client of it, and the fake clock of its driver."""
    with nep.node("listener", "memory") as other:
        ears = Ears(other, "Turtle")
        driver = Driver(TURTLE, "Turtle", node, clock=clock)
        driver.start()
        body = driver.body
        assert isinstance(body, Turtle)
        try:
            yield body, ears, clock
        finally:
            body.go_on.set()
            body.may_stop.set()
            driver.close()
    assert [t.name for t in threading.enumerate() if t.name.startswith("Turtle")] == []
