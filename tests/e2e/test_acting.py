"""Tests of publishing and calling by hand in the real window with real programs, and of their end by Stop."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest

import nep
from tests.e2e.fingers import Fingers
from tests.e2e.person import middle
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = [pytest.mark.long, pytest.mark.timeout(400)]


@dataclass
class Lamp:
    """Messages and requests received by a program with a lamp."""

    heard: list[object] = field(default_factory=list)
    asked: list[object] = field(default_factory=list)


@contextmanager
def lamp(address: str) -> Iterator[Lamp]:
    """Program that subscribes to /lamp and serves `colour_of`."""
    made = Lamp()

    def answer(request: dict[str, object]) -> dict[str, object]:
        made.asked.append(request)
        return {"colour": "amber", "of": request["name"]}

    with nep.node("lamp", master=address) as node:
        node.new_callback("/lamp", "json", made.heard.append)
        node.new_server("colour_of", answer, threads=1)
        thread = threading.Thread(target=node.spin)
        thread.start()
        try:
            yield made
        finally:
            node.stop_spin()
            thread.join()


def write(studio: Studio, fingers: Fingers, name: str, words: str, **wanted: object) -> None:
    """Click a field of the form, replace its text and wait until the text is shown."""
    studio.screen.click(*middle(studio.find(name, enabled=True, **wanted)["rect"]))
    studio.find(name, focus=True, **wanted)
    fingers.write(words)
    until(
        lambda: studio.all(name, text=words, **wanted),
        lambda: f"{name} says {words}: {[each['text'] for each in studio.all(name, **wanted)]}",
    )


def said(studio: Studio) -> str:
    """Return the buttons and the Console lines, for the message of a failed test."""
    kinds = ("Switch", "Button", "LinkButton")
    buttons = [
        (each["name"] or each["text"], each["enabled"]) for each in studio.look() if each["kind"] in kinds
    ]
    lines = [row["texts"] for row in studio.rows("Events, newest first")][:8]
    return f"buttons {buttons}; the Console {lines}"


def test_message_is_armed_and_published_by_hand_until_stop_and_a_service_is_called(
    studio: Studio, address: str
) -> None:
    fingers = Fingers(studio)
    studio.find("Use the virtual robot", enabled=True)
    studio.screen.key("2", held=["Alt"])
    studio.says(f"Master {address}")
    with lamp(address) as seen:
        fingers.do("publish a mess", "Publish a message")
        write(studio, fingers, "Message name", "Warm light")
        write(studio, fingers, "Topic", "/lamp", kind="TopicEdit")
        fingers.press("Escape")  # closes the completion list
        write(studio, fingers, "Message", '{"level": 0.4 "on": true}', kind="JsonLinesEdit")
        studio.says("a comma is missing between two values")
        assert seen.heard == []
        studio.click("Fix it")
        studio.click("Arm and send")
        until(
            lambda: seen.heard == [{"level": 0.4, "on": True}],
            lambda: f"heard once: {seen.heard}; {said(studio)}",
        )

        studio.click("Start sending")
        until(lambda: len(seen.heard) > 10, lambda: f"heard again: {len(seen.heard)}; {said(studio)}")
        fingers.press("F12")
        until(lambda: not studio.all("Stop sending"), "Stop ends it")
        studio.find("Arm and send", enabled=True)

        fingers.do("call a serv", "Call a service")
        studio.says("1 service of 1 node")
        count = len(seen.heard)  # only now: a message may still be under way when the button goes
        studio.click("JSON")  # the service has no schema for a form
        write(studio, fingers, "Request", '{"name": "Aiko"}')
        studio.click("Arm and call")
        until(lambda: seen.asked == [{"name": "Aiko"}], lambda: f"called once: {seen.asked}; {said(studio)}")
        studio.says("replied in ")
        assert len(seen.heard) == count
    assert studio.quit() == 0
