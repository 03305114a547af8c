"""Test of alerts in the real window: they cover no panel, open from the status bar and resize nothing."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import nep
from nep.masters.master import Master
from nep.programs.gateway.attachment import GatewayAttachment
from nep.programs.gateway.request_server import Ports
from nep.recordings.writer import RecordingWriter
from tests.e2e.fingers import Fingers
from tests.e2e.studio import Studio
from tests.e2e.waiting import until
from tests.nep.recordings.messages import TestClock, json_message, limits

pytestmark = pytest.mark.timeout(400)
TOOLS = ("Dock", "TitleTab", "_Segment", "StatusItem")


@pytest.fixture
def held() -> Iterator[list[int]]:
    """Three ports of the gateway, occupied by this process."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(3)]
        for each in sockets:
            each.bind(("127.0.0.1", 0))
            each.listen(1)
        yield [each.getsockname()[1] for each in sockets]


@pytest.fixture
def master(address: str, held: list[int], tmp_path: Path) -> Iterator[Master]:
    """Master whose gateway finds its ports occupied."""
    gateway = GatewayAttachment(tmp_path / "ports.json", Ports(*held))
    with Master(address, attachments=[gateway], learn_s=0.0) as master:
        yield master


@contextmanager
def adder(address: str) -> Iterator[None]:
    """Program that offers a service."""
    with nep.node("adder", master=address) as node:
        node.new_server("add", lambda _request: {"sum": 3, "of": {"a": 1, "b": 2}}, threads=1)
        thread = threading.Thread(target=node.spin)
        thread.start()
        try:
            yield
        finally:
            node.stop_spin()
            thread.join()


def overlap(one: Sequence[float], other: Sequence[float]) -> bool:
    left, top = max(one[0], other[0]), max(one[1], other[1])
    right, bottom = min(one[0] + one[2], other[0] + other[2]), min(one[1] + one[3], other[1] + other[3])
    return left < right and top < bottom


def places(studio: Studio) -> dict[tuple[str, str, str], Sequence[float]]:
    """Return the rectangles of panels and buttons, except those in the banner."""
    banner = next((each["rect"] for each in studio.all(kind="Banner")), (0, 0, 0, 0))
    found = {}
    for each in studio.look():
        kind, rect = str(each["kind"]), each["rect"]
        inside = overlap(rect, banner) and rect[2] * rect[3] < banner[2] * banner[3]
        is_tool = kind.endswith("Button") or kind in TOOLS
        if re.search(r"\d ms|messages/s", str(each["name"])):
            continue  # its width changes with its digits
        if is_tool and rect[2] > 0 and not (inside and rect[0] >= banner[0]):
            name = re.sub(r"\d+", "0", str(each["name"]))  # the status bar shows counts
            found[kind, name, str(each["in"])] = rect
    return found


def settled_places(studio: Studio) -> dict[tuple[str, str, str], Sequence[float]]:
    """Return the rectangles of panels and buttons once they no longer change."""
    seen: list[dict[tuple[str, str, str], Sequence[float]]] = []

    def still() -> bool:
        seen.append(places(studio))
        return len(seen) > 2 and seen[-1] == seen[-2] == seen[-3]

    until(still, "the panels stand still")
    return seen[-1]


def height_of_timeline(studio: Studio) -> float:
    """Open the selected recording and return the height of the Timeline once it no longer changes."""
    seen: list[float] = []

    def still() -> bool:
        seen.append(next((each["rect"][3] for each in studio.all(kind="TimelinePanel")), 0.0))
        return len(seen) > 3 and seen[-1] > 0 and len(set(seen[-3:])) == 1

    studio.click("Open", **{"in": "recordings"})
    until(still, lambda: f"the Timeline stands still: {seen}")
    return seen[-1]


def test_alerts_cover_no_panel_and_panels_keep_their_size(
    start: Callable[..., Studio], master: Master, address: str, held: list[int], tmp_path: Path
) -> None:
    folder = tmp_path / "home" / "Recordings"
    folder.mkdir(parents=True)
    with RecordingWriter(folder / "Tour.mcap", clock=TestClock(), limits=limits()) as writer:
        writer.post([json_message(seq) for seq in range(50)])
    studio = start()
    fingers = Fingers(studio)

    studio.find("Use the virtual robot", enabled=True)
    fingers.press("2", held=["Alt"])
    studio.screen.move(700, 500)  # over a panel, so that any shift of the layout would be noticed
    words = lambda: str(studio.find(kind="Banner")["name"])  # noqa: E731
    until(lambda: all(str(port) in words() for port in held), "one alert for all ports")
    before = settled_places(studio)
    banner = studio.still(kind="Banner")
    assert not [each for each, rect in before.items() if overlap(rect, banner["rect"])]
    fingers.until_on("Tab", held=["Shift"], kind="StatusItem", name="1 alert")
    fingers.press("Return")
    studio.find(kind="AlertsPanel")

    fingers.press("Home", held=["Alt"])
    studio.says("What would you like to do?")
    until(lambda: not studio.all(kind="Banner"), "ports are told to developers alone")
    fingers.press("1", held=["Alt"])
    studio.find(kind="RunBar")
    until(lambda: not studio.all(kind="Banner") and not studio.all("1 alert"), "nor in this layout")

    fingers.press("2", held=["Alt"])
    studio.click("Console", kind="TitleTab")
    studio.click("1 alert", kind="StatusItem")
    studio.find(kind="AlertsPanel")
    before = settled_places(studio)
    studio.click("Dismiss")
    until(lambda: not studio.all(kind="Banner"), "the banner goes")
    until(lambda: places(studio) == before, "no strip is left, and nothing moved")

    with adder(address):
        fingers.do("call a serv", "Call a service")
        studio.click("Arm and call")
        studio.says("replied in ")
        panel, answer = (
            studio.still(kind="ServicesPanel")["rect"],
            studio.still("Reply", kind="TableView")["rect"],
        )
        assert answer[3] > 60
        assert panel[0] <= answer[0] < answer[0] + answer[2] <= panel[0] + panel[2]
        assert panel[1] <= answer[1] < answer[1] + answer[3] <= panel[1] + panel[3]

    fingers.do("recordings", "Recordings")
    first = height_of_timeline(studio)
    studio.click("Back to live")
    until(lambda: not studio.all(kind="TimelinePanel"), "the Timeline is closed, and Open is in its place")
    assert height_of_timeline(studio) == first
