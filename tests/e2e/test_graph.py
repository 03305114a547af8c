"""Test of the graph in the real window: connections are shown and followed with keys and mouse."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.e2e.fingers import Fingers
from tests.e2e.programs import Program
from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
TALK = """
import sys, threading
import nep
talker, listener = nep.node("talker"), nep.node("listener")
heard = listener.new_sub("/chatter", "json", sink=lambda messages: None)
told = talker.new_pub("/chatter", "json")
ended = threading.Event()
def talk():
    while not ended.wait(0.1):
        told.publish({"say": "hello"})
threading.Thread(target=talk).start()
print("talks", flush=True)
sys.stdin.read()
ended.set()
"""


def said(studio: Studio) -> str:
    """Return the screen reader's description of the selection in the graph."""
    return str(studio.find("Graph of nodes")["description"])


def test_graph_navigation_leads_from_a_topic_publisher_to_its_subscribers(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    studio = start()
    fingers = Fingers(studio)
    studio.click("Open the Developer layout")
    studio.find("Topics", kind="Dock")
    script = tmp_path / "talk.py"
    script.write_text(TALK, "utf-8")
    with Program(str(script)) as program:
        program.says("talks", 60)
        fingers.do("Graph", "Graph")
        studio.says("nodes, 1 topic")
        left, top, wide, high = studio.still("Graph of nodes")["rect"]
        studio.screen.click(left + wide / 2, top + high - 10)  # on the empty canvas
        studio.find("Graph of nodes", focus=True)

        def walked() -> bool:
            """Select the first node, then follow its line as soon as it is drawn."""
            if not said(studio).startswith("/chatter"):
                fingers.press("Right")
            return "from talker to listener" in said(studio)

        until(walked, lambda: said(studio))
        studio.find("/chatter", kind="ElidedLabel")
        fingers.press("Right")
        until(lambda: said(studio).startswith("listener, Python"), lambda: said(studio))
        fingers.press("Left")
        until(lambda: said(studio).startswith("/chatter"), lambda: said(studio))
        studio.click("Inspect")
        until(lambda: studio.values("Newest message").get("say"), "the Inspector shows what is said")
        until(lambda: "studio" in said(studio), lambda: f"who inspects it hears it, too: {said(studio)}")
    assert studio.quit() == 0
