"""Tests of the session on a real network with a master, a virtual robot, original topics and a program."""

from __future__ import annotations

import json
import os
import signal
import threading
from pathlib import Path
from typing import ClassVar

import psutil
import pytest

import nep
from app.core.network.source import JobFailed
from app.core.parts.robots import MONITORING_FAILED_MESSAGE
from app.core.session import Session
from app.errors import RobotInputError, UnknownRobotError
from app.intents import ConnectRobot
from app.robots.description.description import thing_description
from app.robots.kit import Call, Driver, Kind, Link, action, safe_stop
from tests.blocks.wire_robot import usual_time_limits
from tests.core.waiting import tick_until

EXAMPLES = Path(__file__).parents[2] / "resources" / "examples"


class Lamp:
    """Robot with one action."""

    made: ClassVar[list[Lamp]] = []

    def __init__(self, link: Link) -> None:
        self.stops = 0
        self.made.append(self)

    @action("blink", category="Looks", icon="lightbulb", timeout_s=30)
    def blink(self, call: Call) -> None:
        """Blink at once."""

    @safe_stop(watchdog_s=0.5)
    def stop(self) -> None:
        """Stop at once."""
        self.stops += 1


LAMP = Kind("lamp", "Lamp", Lamp)


def test_topics_appear_with_their_statistics_and_disappear(session: Session) -> None:
    with nep.node("talker") as node:
        publisher = node.new_pub("/hello", "json")
        tick_until(session, lambda: "/hello" in session.live.topics)
        assert session.live.master.kind == "connected"

        def rate() -> float | None:
            publisher.publish({"n": 1})
            return session.live.topics["/hello"].rate_hz

        tick_until(session, rate)
        assert session.traffic.messages_per_s
        assert session.live.topics["/hello"].publisher_nodes == ("talker",)
    tick_until(session, lambda: session.live.topics["/hello"].gone_s is not None)


def test_topics_are_subscribed_only_while_watched(session: Session) -> None:
    with nep.node("talker") as node:
        publisher = node.new_pub("/hello", "json")
        tick_until(session, lambda: "/hello" in session.live.topics)
        assert publisher.subscribers == 0
        watch = session.live.watch("/hello")
        tick_until(session, lambda: publisher.subscribers == 1)
        publisher.publish({"say": "hé"})
        tick_until(session, lambda: session.live.topics["/hello"].newest is not None)
        newest = session.live.topics["/hello"].newest
        assert newest is not None
        assert newest.payload == {"say": "hé"}
        watch.close()
        tick_until(session, lambda: publisher.subscribers == 0)
        assert session.live.topics["/hello"].newest is None


def test_topic_can_be_watched_before_it_exists(session: Session) -> None:
    with session.live.watch("/later"), nep.node("talker") as node:
        publisher = node.new_pub("/later", "json")
        tick_until(session, lambda: publisher.subscribers == 1)
        publisher.publish(5)
        tick_until(session, lambda: session.live.topics["/later"].received == 1)


def test_undecodable_messages_raise_one_alert_that_a_valid_message_resolves(session: Session) -> None:
    with session.live.watch("/bad"), nep.node("talker") as node:
        publisher = node.new_pub("/bad", "json")
        tick_until(session, lambda: publisher.subscribers == 1)
        for _ in range(7):
            publisher.publish_bytes(b"{not json")
        tick_until(session, lambda: session.live.topics["/bad"].received == 7)
        (alert,) = session.alerts.active
        assert alert.id == "message:/bad"
        assert alert.count == 7
        assert "7 messages" in alert.title
        publisher.publish({"good": True})
        tick_until(session, lambda: not session.alerts.active)


def test_virtual_robot_connects_runs_an_action_and_stops(session: Session) -> None:
    session.launcher.start_virtual_robot("Pepper")
    tick_until(session, lambda: session.fleet.connected)
    link = session.fleet.link("Pepper")
    assert link is not None
    assert link.is_virtual
    tick_until(session, lambda: link.chip_text == "virtual, ready")
    with session.fleet.watch_sensors("Pepper"):
        tick_until(session, lambda: "distance" in link.values and link.drawing is not None)
        stream = session.live.images.stream("/Pepper/camera")
        tick_until(session, lambda: stream.picture is not None)
        stream.close()
        said = session.fleet.invoke("Pepper", "say", {"text": "hi"})
        tick_until(session, lambda: not said.is_running)
        assert said.state == "succeeded", said
        walk = session.fleet.invoke("Pepper", "walk", {"distance": 2.0})
        tick_until(session, lambda: link.drawing is not None and link.drawing["moving"])
        assert link.state == "busy"
        session.runs.stop()
        tick_until(session, lambda: session.runs.view().state == "proven")
        tick_until(session, lambda: link.drawing is not None and not link.drawing["moving"])
        assert walk.state == "canceled"
        assert link.last_stop is not None
        assert link.last_stop.startswith("confirmed in ")
    session.launcher.stop_virtual_robot("Pepper")
    tick_until(session, lambda: link.state == "away")
    with pytest.raises(RobotInputError):
        session.fleet.invoke("Pepper", "fly", {})


def test_alert_about_a_crashed_virtual_robot_offers_a_restart(session: Session) -> None:
    session.launcher.start_virtual_robot("Pepper")
    tick_until(session, lambda: session.fleet.connected)
    session.launcher._robots["Pepper"][0].kill()
    tick_until(session, lambda: session.alerts.has("companion:Pepper"))
    (alert,) = [alert for alert in session.alerts.active if alert.id == "companion:Pepper"]
    assert (alert.button, alert.intent) == ("Restart the robot", ConnectRobot("Pepper"))
    tick_until(session, lambda: not session.fleet.connected)
    session.launcher.start_virtual_robot("Pepper")
    tick_until(session, lambda: not session.alerts.has("companion:Pepper"))


def test_hung_virtual_robot_can_be_restarted(session: Session) -> None:
    session.launcher.start_virtual_robot("Pepper")
    tick_until(session, lambda: session.fleet.connected)
    hung = session.launcher._robots["Pepper"][0]
    psutil.Process(hung.pid).suspend()
    tick_until(session, lambda: not session.fleet.connected)
    session.launcher.restart_virtual_robot("Pepper")
    assert hung.poll() is not None
    tick_until(session, lambda: session.fleet.connected)


def test_unwritable_journal_raises_an_alert_until_it_is_writable(session: Session, tmp_path: Path) -> None:
    folder = tmp_path / "journal"
    folder.write_text("a file is in its place")
    session.document.apply_edit({"blocks": {"blocks": []}, "edit": 1})
    tick_until(session, lambda: session.alerts.has("journal"))
    folder.unlink()
    session.document.apply_edit({"blocks": {"blocks": []}, "edit": 2})
    tick_until(session, lambda: not session.alerts.has("journal"))


def test_invalid_action_input_and_unknown_robot_are_rejected(session: Session) -> None:
    with nep.node("lamp") as node:
        driver = Driver(LAMP, "Lamp", node)
        driver.start()
        try:
            tick_until(session, lambda: session.fleet.connected)
            with pytest.raises(RobotInputError):
                session.fleet.invoke("Lamp", "blink", {"colour": 5})
            with pytest.raises(UnknownRobotError):
                session.fleet.invoke("Nobody", "blink", {})
        finally:
            driver.close()


def test_example_runs_and_its_stop_is_confirmed(session: Session) -> None:
    session.launcher.start_virtual_robot("Pepper")
    tick_until(session, lambda: session.fleet.connected and session.stopper and session.stopper.robots)
    session.document.open_example(EXAMPLES / "1-greeting.nepb")
    assert not [p for p in session.document.problems() if p.severity == "error"]
    session.runs.run()
    tick_until(session, lambda: session.runs.running_blocks)
    assert session.runs.view().state == "running"
    session.runs.pause()
    tick_until(session, lambda: session.runs.view().state == "paused")
    session.runs.resume()
    session.runs.stop()
    tick_until(session, lambda: session.runs.view().state == "proven")
    assert session.runs.view().result_status == "ok"
    assert session.runs.view().title.startswith("Stopped after")
    # The exit of the program is reported later and must not count as a second stop.
    stops = [record for record in session.console.records if "stopped (" in record.text]
    ended = threading.Event()
    for _ in range(40):
        ended.wait(0.01)
        session.tick()
    assert [record for record in session.console.records if "stopped (" in record.text] == stops
    assert session.runs.view().state == "proven"


def test_virtual_robot_whose_process_ended_needs_no_manual_switch_off(session: Session) -> None:
    session.launcher.start_virtual_robot("Pepper")
    tick_until(session, lambda: session.fleet.connected and session.stopper and session.stopper.robots)
    session.document.open_example(EXAMPLES / "1-greeting.nepb")
    session.runs.run()
    tick_until(session, lambda: session.runs.running_blocks)
    session.launcher._robots["Pepper"][0].kill()
    with usual_time_limits():
        tick_until(session, lambda: not session.runs.active)
        tick_until(session, lambda: session.runs.view().can_run)
    assert not session.alerts.has("stop")
    tick_until(session, lambda: session.alerts.has("companion:Pepper"))
    session.launcher.start_virtual_robot("Pepper")
    assert session.launcher.ended_robots == frozenset()


def test_program_with_an_error_marks_its_block_and_does_not_run(session: Session) -> None:
    block = {"type": "control_wait", "id": "w", "inputs": {}}
    started = {"type": "events_started", "id": "s", "next": {"block": block}}
    session.document.apply_edit({"blocks": {"languageVersion": 0, "blocks": [started]}})
    session.runs.run()
    assert "w" in session.runs.block_errors
    assert session.runs.view().state == "ready"


def test_robots_of_a_killed_program_are_stopped(session: Session) -> None:
    with nep.node("lamp") as node:
        driver = Driver(LAMP, "Lamp", node)
        driver.start()
        commands = node.new_sub("/Lamp/command", "robot/command")
        try:
            tick_until(session, lambda: session.stopper and session.stopper.robots)
            session.document.apply_edit(json.loads(json.dumps(_forever())))
            session.runs.run()
            tick_until(session, lambda: "w" in session.runs.running_blocks)
            runner = session.runs._runner
            assert runner is not None
            assert runner.pid is not None
            os.kill(runner.pid, signal.SIGKILL if os.name == "posix" else signal.SIGTERM)
            tick_until(session, lambda: session.runs.view().state == "proven")
            assert Lamp.made[-1].stops >= 1
            stops = []

            def has_stop() -> bool:
                while (message := commands.receive(0.0)) is not None:
                    stops.extend([message.payload] if message.payload["op"] == "stop" else [])
                return bool(stops)

            tick_until(session, has_stop)  # its own subscriber may lag behind the driver's
            assert {stop["ends"] for stop in stops} == {runner.program_key}
            assert [alert.id for alert in session.alerts.active] == ["program"]
        finally:
            driver.close()


def test_end_of_a_program_stops_only_its_own_robots(session: Session) -> None:
    with nep.node("lamps") as node:
        drivers = [Driver(LAMP, name, node) for name in ("Lamp", "Other")]
        for driver in drivers:
            driver.start()
        used, other = Lamp.made[-2:]
        try:
            tick_until(session, lambda: session.stopper and len(session.stopper.robots) == 2)
            blink = {"type": "robot_lamp_do_blink", "id": "b", "fields": {"ROBOT": "Lamp"}}
            started = {"type": "events_started", "id": "s", "next": {"block": blink}}
            session.document.apply_edit({"blocks": {"languageVersion": 0, "blocks": [started]}})
            session.runs.run()
            tick_until(session, lambda: session.runs.view().title.startswith("Finished"))
            assert session.runs.view().result is not None
            assert session.runs.view().result.startswith("Lamp stopped")
            assert (used.stops >= 1, other.stops) == (True, 0)
            session.runs.stop_robot("Other")
            tick_until(session, lambda: other.stops >= 1)
            link = session.fleet.link("Other")
            tick_until(session, lambda: link is not None and link.last_stop is not None)
        finally:
            for driver in drivers:
                driver.close()


def test_unresponsive_robot_is_named_and_run_stays_disabled(session: Session) -> None:
    with nep.node("mute") as node:
        description = node.new_pub("/Mute/description", "robot/description", latched=True)
        description.publish(thing_description(LAMP.thing_model, "Mute"))
        tick_until(session, lambda: session.stopper and session.stopper.robots)
        with usual_time_limits():
            session.runs.stop()
            tick_until(session, lambda: session.runs.view().stop_label == "Stopping")
            tick_until(session, lambda: session.runs.view().state == "unanswered")
        view = session.runs.view()
        assert view.title.startswith("Mute ")
        assert not view.can_run
        assert any(alert.id == "stop" for alert in session.alerts.active)
        session.runs.confirm_stopped()
        assert session.runs.view().state == "ready"
        assert not any(alert.id == "stop" for alert in session.alerts.active)


def _forever() -> dict[str, object]:
    wait = {"type": "control_wait", "id": "w", "inputs": {"SECONDS": {"shadow": _number(1)}}}
    blink = {"type": "robot_lamp_do_blink", "id": "b", "fields": {"ROBOT": "Lamp"}, "next": {"block": wait}}
    loop = {"type": "control_forever", "id": "f", "inputs": {"BODY": {"block": blink}}}
    started = {"type": "events_started", "id": "s", "next": {"block": loop}}
    return {"blocks": {"languageVersion": 0, "blocks": [started]}}


def _number(value: float) -> dict[str, object]:
    return {"type": "values_number", "id": f"n{value}", "fields": {"NUMBER": value}}


def test_failed_network_job_is_reported_only_if_it_has_a_message_template(session: Session) -> None:
    session._on_event(JobFailed(MONITORING_FAILED_MESSAGE, "the master has gone"))
    session._on_event(JobFailed("", "nobody asked"))
    texts = [record.text for record in session.console.records]
    assert "can't monitor the robots: the master has gone" in texts
    assert not [text for text in texts if "nobody asked" in text]
