"""Tests of drivers whose actions, stop function and close function are coroutines."""

from __future__ import annotations

import asyncio
import contextlib
import threading

import pytest

import nep
from app.clock import VirtualClock
from app.robots.driver.driver import Driver, EventLoop
from app.robots.driver.tasks import STOP_REPLY_TIMEOUT_S
from app.robots.kit import Call, Failed, Kind, Link, action, safe_stop
from tests.robots.conftest import Ears, eventually


async def pause(seconds: float) -> None:
    """Suspend the coroutine for `seconds` with `asyncio.wait_for`, as libraries of robots do."""
    with contextlib.suppress(asyncio.TimeoutError):
        await asyncio.wait_for(asyncio.Event().wait(), seconds)


class Drone:
    """Fake drone whose actions are coroutines."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self.loops: set[object] = set()
        self.events: list[str] = []
        self.let_go = threading.Event()
        self.raises: BaseException | None = None
        self.connected = link.run(self._connect())

    async def _connect(self) -> str:
        self.loops.add(asyncio.get_running_loop())
        return "connected"

    @action("fly", "Movement", "move", uses=("wings",), timeout_s=5)
    async def fly(self, call: Call, times: int = 1000) -> int:
        """Flap `times` times; clean up with an await also after a cancellation."""
        self.loops.add(asyncio.get_running_loop())
        self.events.append("flies")
        call.feedback(flapped=0)
        try:
            for _ in range(times):
                await pause(0.005)
        finally:
            await pause(0.0)  # cleanup also awaits
            self.events.append("put away")
        return times

    @action("break", "Movement", "move")
    async def crash(self, call: Call) -> None:
        """Raise the exception in `raises`, if there is one."""
        await pause(0.0)
        if self.raises is not None:
            raise self.raises

    @action("wait wrongly", "Movement", "move")
    async def wait_wrongly(self, call: Call) -> None:
        """Call the blocking `Call.wait` inside the event loop."""
        call.wait(0.01)

    @action("stubborn", "Movement", "move")
    async def stubborn(self, call: Call) -> None:
        """Ignore cancellation until the test sets `let_go`."""
        self.events.append("begun")
        while not self.let_go.is_set():
            try:
                await pause(0.005)
            except asyncio.CancelledError:
                self.events.append("told")

    @action("plain", "Movement", "move")
    def plain(self, call: Call) -> str:
        """Return from an action that is an ordinary function."""
        return "as ever"

    @safe_stop()
    async def stop(self) -> None:
        await pause(0.0)
        self.events.append("stopped")

    async def close(self) -> None:
        self.events.append("closed")


DRONE = Kind(model="drone", title="Drone", body=Drone)


@pytest.fixture
def drone(node, clock):
    with nep.node("listener", "memory") as other:
        ears = Ears(other, "Drone")
        driver = Driver(DRONE, "Drone", node, clock=clock)
        driver.start()
        body = driver.body
        yield body, ears, clock
        body.let_go.set()
        driver.close()
        assert body.events[-1] == "closed"
    assert [t.name for t in threading.enumerate() if t.name.startswith("Drone")] == []


def test_async_action_runs_to_completion_and_returns_its_output(drone):
    body, ears, _ = drone
    ears.invoke("1", "fly", times=2)
    answer = ears.final("1")
    assert (answer["state"], answer["output"]) == ("succeeded", {"value": 2})
    assert body.events == ["flies", "put away"]
    assert {"flapped": 0} in [a["feedback"] for a in ears.answers("1")]
    ears.invoke("2", "plain")
    assert ears.final("2")["output"] == {"value": "as ever"}


def test_all_coroutines_run_in_one_event_loop(drone):
    body, ears, _ = drone
    assert body.connected == "connected"
    for wanted in ("1", "2"):
        ears.invoke(wanted, "fly", times=1)
        ears.final(wanted)
    assert len(body.loops) == 1


def test_cancel_timeout_and_stop_end_an_async_action(drone):
    body, ears, clock = drone
    ears.invoke("1", "fly")
    eventually(lambda: body.events == ["flies"])
    ears.command(id="1", op="cancel")
    assert ears.final("1")["state"] == "canceled"
    assert body.events == ["flies", "put away"]  # the reply waits for the cleanup

    ears.invoke("2", "fly")
    eventually(lambda: body.events[2:] == ["flies"])
    clock.advance(5.1)
    assert ears.final("2")["error"] == "fly took longer than 5 s"

    ears.invoke("3", "fly")
    eventually(lambda: body.events[4:] == ["flies"])
    ears.command(id="s", op="stop")
    assert ears.final("s", "stop")["state"] == "succeeded"
    assert ears.final("3")["state"] == "canceled"
    assert set(body.events[5:]) == {"put away", "stopped"}
    assert body.events[-1] == "stopped"  # stop runs again if an action ended after it


@pytest.mark.parametrize(
    ("raised", "state", "error"),
    [
        (Failed("no wind"), "failed", "no wind"),
        (ValueError("odd"), "failed", "crash failed: odd"),
        (SystemExit(3), "failed", "crash failed: 3"),
        (KeyboardInterrupt(), "failed", "crash failed: KeyboardInterrupt"),
        (asyncio.CancelledError(), "canceled", None),
        (None, "succeeded", None),
    ],
    ids=repr,
)
def test_exception_in_a_coroutine_is_reported_and_the_next_action_runs(drone, raised, state, error):
    body, ears, _ = drone
    body.raises = raised
    ears.invoke("1", "crash")
    answer = ears.final("1")
    assert (answer["state"], answer["error"]) == (state, error)
    ears.invoke("2", "fly", times=1)
    assert ears.final("2")["state"] == "succeeded"
    ears.command(id="s", op="stop")
    assert ears.final("s", "stop")["state"] == "succeeded"


def test_blocking_wait_in_a_coroutine_fails_with_a_hint(drone):
    _, ears, _ = drone
    ears.invoke("1", "wait_wrongly")
    assert "use `await asyncio.sleep` there" in str(ears.final("1")["error"])


def test_coroutine_that_ignores_cancellation_is_reported_until_finished(drone):
    body, ears, clock = drone
    ears.invoke("1", "stubborn")
    eventually(lambda: "begun" in body.events)  # "running" is published before the function begins
    ears.command(id="s", op="stop")
    eventually(lambda: "told" in body.events and "stopped" in body.events)
    clock.advance(STOP_REPLY_TIMEOUT_S + 0.01)
    error = str(ears.final("s", "stop")["error"])  # the stop function itself may just be ending
    assert error.startswith("Drone may still move: stubborn")
    assert error.endswith("still running")
    body.let_go.set()
    eventually(lambda: [a["not_ended"] for a in ears.heard["answer"] if a["op"] == "alive"][-1] == [])


def test_function_that_returns_an_awaitable_is_awaited(node):
    class Wrapped:
        ran: list[str] = []  # noqa: RUF012 - read after the robot has ended

        @action("go", "Movement", "move")
        def go(self, call: Call):  # as a driver's own decorator may produce
            async def later() -> None:
                self.ran.append("ran")

            return later()

        def __init__(self, link: Link) -> None:
            self.link = link

        @safe_stop()
        def stop(self) -> None:
            """Do nothing; the description requires a stop function."""

    with nep.node("listener", "memory") as other:
        ears = Ears(other, "Wrapped")
        with Driver(
            Kind(model="wrapped", title="W", body=Wrapped),
            "Wrapped",
            node,
            clock=VirtualClock(advances_alone=False),
        ):
            ears.invoke("1", "go")
            assert ears.final("1")["state"] == "succeeded"
    assert Wrapped.ran == ["ran"]


def test_closed_event_loop_rejects_coroutines_without_warning():
    async def never() -> None:
        raise AssertionError

    loop = EventLoop("test")
    loop.close()
    with pytest.raises(RuntimeError, match="the robot's driver is closed"):
        loop.run(never())


def test_coroutine_that_exceeds_its_timeout_is_canceled():
    ended = threading.Event()

    async def long() -> None:
        try:
            await pause(60.0)
        finally:
            ended.set()

    loop = EventLoop("test")
    with pytest.raises(TimeoutError):
        loop.run(long(), within_s=0.01)
    assert ended.wait(30)
    loop.close()


def test_blocking_run_inside_the_event_loop_raises():
    loop = EventLoop("test")

    async def inner() -> None:
        loop.run(pause(0.0))

    with pytest.raises(RuntimeError, match="use await"):
        loop.run(inner())
    loop.close()
