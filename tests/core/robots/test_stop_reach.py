"""Tests of the robots that a stop includes: also those that left during a run or while a master starts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from msgspec.structs import replace

import nep
from app.core.network.master import DISCOVERY_TIMEOUT_S
from app.core.network.source import GraphReceived
from app.core.session import Session
from app.robots.kit import Call, Driver, Kind, Link, action, safe_stop
from tests.blocks.wire_robot import usual_time_limits
from tests.core.waiting import stop_unanswered, tick_until


class Lamp:
    """Robot with one action."""

    def __init__(self, link: Link) -> None:
        """Ignore the link: there is no device."""

    @action("blink", category="Looks", icon="lightbulb")
    def blink(self, call: Call) -> None:
        """Blink at once."""

    @safe_stop(watchdog_s=5)
    def stop(self) -> None:
        """Stop at once."""


LAMP = Kind("lamp", "Lamp", Lamp)


def within_reach(session: Session) -> tuple[str, ...]:
    return session.stopper.robots if session.stopper is not None else ()


def blink_and_wait() -> dict[str, object]:
    long = {"type": "values_number", "id": "n", "fields": {"NUMBER": 600}}
    wait = {"type": "control_wait", "id": "w", "inputs": {"SECONDS": {"shadow": long}}}
    blink = {"type": "robot_lamp_do_blink", "id": "b", "fields": {"ROBOT": "Lamp"}, "next": {"block": wait}}
    started = {"type": "events_started", "id": "s", "next": {"block": blink}}
    return {"blocks": {"languageVersion": 0, "blocks": [started]}}


@contextmanager
def used_by_a_program(session: Session, node: nep.Node) -> Iterator[None]:
    """Running program that has used a lamp; the lamp disconnects at the end."""
    driver = Driver(LAMP, "Lamp", node)
    driver.start()
    try:
        tick_until(session, lambda: within_reach(session))
        session.document.apply_edit(blink_and_wait())
        session.runs.run()
        tick_until(session, lambda: "w" in session.runs.running_blocks)
        yield
    finally:
        driver.close()


def is_needed(session: Session) -> bool:
    """Return whether an error alert reports the missing lamp; an unused lamp that leaves is no error."""
    return any(alert.id == "robot:Lamp" and alert.severity == "error" for alert in session.alerts.active)


def test_robot_lost_during_a_program_is_named_until_it_replies(session: Session) -> None:
    with nep.node("lamps") as node:
        with used_by_a_program(session, node):
            pass
        tick_until(session, lambda: not session.fleet.connected)
        tick_until(session, lambda: is_needed(session))
        for _ in range(2):  # “Stop again” without a reply proves nothing, either
            with usual_time_limits():
                session.runs.stop()
                tick_until(session, lambda: session.runs.view().state == "stopping")
                tick_until(session, lambda: session.runs.view().state != "stopping")
            assert session.runs.view().title == "Lamp didn't reply"
            assert not session.runs.view().can_run
            tick_until(session, lambda: not is_needed(session))
        driver = Driver(LAMP, "Lamp", node)
        driver.start()
        try:
            tick_until(session, lambda: session.fleet.connected)
            session.runs.stop()
            tick_until(session, lambda: session.runs.view().state == "proven")
            assert str(session.runs.view().result).startswith("Lamp stopped (")
        finally:
            driver.close()
    tick_until(session, lambda: not within_reach(session))


def test_user_can_confirm_that_a_lost_robot_stands_still(session: Session) -> None:
    with nep.node("lamps") as node, used_by_a_program(session, node):
        pass
    tick_until(session, lambda: not session.fleet.connected)
    stop_unanswered(session)
    session.runs.confirm_stopped()
    tick_until(session, lambda: not within_reach(session))


def test_robots_unknown_to_a_new_master_stay_connected_during_discovery(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    with nep.node("lamps") as node:
        driver = Driver(LAMP, "Lamp", node)
        driver.start()
        tick_until(session, lambda: within_reach(session))
        session.live.source.close()  # from here on, the test passes the graphs in
        session.tick()  # applies what the source has delivered before
        driver.close()
        graph = session.live.graph
        assert graph is not None
        empty = replace(graph, epoch=graph.epoch + 1, nodes={}, topics={})
        now = time.monotonic()

        def receive_empty_graph(later_s: float) -> None:
            monkeypatch.setattr(session.live, "_clock", lambda: now + later_s)
            session._mailbox.post_event(GraphReceived(empty, 0.0))
            session.tick()

        for later_s in (0.0, 1.0):
            receive_empty_graph(later_s)
            assert session.live.graph is graph
            assert session.fleet.connected
        receive_empty_graph(DISCOVERY_TIMEOUT_S)
        assert session.live.graph is empty
        assert not session.fleet.connected


def test_session_close_ends_the_program(session: Session) -> None:
    with nep.node("lamps") as node, used_by_a_program(session, node):
        runner = session.runs._runner
        assert runner is not None
        session.close()
        assert runner.wait(30.0)
