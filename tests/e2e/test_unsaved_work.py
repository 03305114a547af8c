"""Tests of SIGKILL for Studio, a publisher and the master: no work or message is lost, no process remains."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest

import nep
from tests.e2e.behaviours import forever, say, started, turn, write
from tests.e2e.programs import Program
from tests.e2e.studio import END_S, Studio
from tests.e2e.test_tabs import shown, tabs
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
WAITS = "!!document.querySelector('.nepTab:not([hidden]) .blocklyBlockCanvas > .control_wait')"
PEER = str(Path(__file__).parent / "peer.py")


@pytest.fixture
def publisher(address: str) -> Iterator[Program]:
    with Program(PEER, "publish", "/count") as program:
        yield program


def delete_the_script(studio: Studio) -> None:
    studio.point(".nepTab:not([hidden]) [data-id=started] > .blocklyPath", dy=30)
    studio.screen.key("Delete")


def add_a_block(studio: Studio) -> None:
    """Find a block with the keyboard in the toolbox of the visible tab and add it."""
    studio.choose("Edit", "Find and add a block")
    until(lambda: studio.page("document.activeElement.type") == "search", "the keys go to the field")
    studio.screen.type("wait")
    studio.spot(".nepTab:not([hidden]) .blocklyFlyout .control_wait")
    studio.screen.key("Return")
    studio.spot(".nepTab:not([hidden]) .blocklyDragging")
    studio.screen.key("Return")


def sleeping(process: psutil.Process) -> bool:
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE


def test_unsaved_work_is_offered_and_restored_after_kill_9(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    path = write(tmp_path / "Mine.nepb", started(say("Hello")))
    saved = path.read_bytes()
    studio = start(str(path))
    studio.open_category("Control")
    view = studio.find(kind="QWebEngineView")["rect"]
    before = set(studio.blocks())
    studio.drag(".blocklyFlyout .control_wait", view[0] + 420, view[1] + 300)
    edited = until(lambda: set(studio.blocks()) - before and set(studio.blocks()), "the block is there")
    journals = studio.home / "journal"
    until(lambda: any("control_wait" in each.read_text() for each in journals.glob("*.json")), "it is kept")
    studio.kill()

    again = start()
    again.says("Restore unsaved work?")
    again.says("“Mine” wasn't saved before Studio closed.")
    again.click("Restore")
    until(lambda: set(again.blocks()) == edited, "every block is back")
    assert path.read_bytes() == saved, "the file is as it was last saved"
    again.click("Blocks")
    again.screen.key("s", ["Ctrl"])
    again.says("Saved Mine")
    assert b"control_wait" in path.read_bytes()
    assert again.quit() == 0


def test_last_behaviour_or_the_start_page_is_shown_after_quit(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    studio = start(str(write(tmp_path / "Mine.nepb", started(say("Hello")))))
    studio.spot("[data-id=started]")
    blocks = set(studio.blocks())
    assert studio.quit() == 0

    again = start()
    until(lambda: set(again.blocks()) == blocks, "what was worked on last shows")
    assert not again.all("Restore")
    again.choose("File", "Start page")
    again.find(kind="StartPage")
    assert again.quit() == 0

    third = start()
    third.find(kind="StartPage")


def test_active_tab_and_tab_order_are_restored_after_kill_9(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    files = [write(tmp_path / f"{name}.nepb", started(say(name))) for name in ("One", "Two", "Three")]
    studio = start(*map(str, files))
    until(lambda: tabs(studio) == ["One", "Two", "Three"], "the files are open")
    until(lambda: "say Three" in shown(studio), "the last shows")
    delete_the_script(studio)
    until(lambda: tabs(studio)[2] == "Three, not saved", "the third is edited")
    studio.screen.key("Tab", ["Ctrl"])
    until(lambda: "say One" in shown(studio), "the first shows")
    studio.screen.key("n", ["Ctrl"])
    until(lambda: tabs(studio) == ["One", "New behaviour", "Two", "Three, not saved"], "a new one")
    until(lambda: shown(studio) == set(), "it shows")
    add_a_block(studio)
    until(lambda: tabs(studio)[1] == "New behaviour, not saved", "the new one is edited")
    journals = studio.home / "journal"
    kept = lambda: [each.read_text("utf-8") for each in journals.glob("*.json")]  # noqa: E731
    until(lambda: len(kept()) == 2 and any("control_wait" in each for each in kept()), "both are kept")
    until(lambda: '"current": 1' in (studio.home / "settings.json").read_text("utf-8"), "so is the order")
    studio.kill()

    again = start()
    again.click("Restore")
    order = ["One", "New behaviour, not saved", "Two", "Three, not saved"]
    until(lambda: tabs(again) == order, "all tabs are back, in their order")
    until(lambda: again.page(WAITS), "the one that was worked on shows, with its block")
    again.screen.key("Tab", ["Ctrl", "Shift"])
    until(lambda: "say One" in shown(again), "what was not edited")
    again.screen.key("Tab", ["Ctrl", "Shift"])
    until(lambda: tabs(again) == order and shown(again) == set(), "the third is as it was left")
    assert again.quit() == 0


def test_discarded_work_is_not_offered_again(start: Callable[..., Studio], tmp_path: Path) -> None:
    studio = start(str(write(tmp_path / "Mine.nepb", started(say("Hello")))))
    studio.point("[data-id=started] > .blocklyPath", dy=30)
    studio.screen.key("Delete")
    until(lambda: list((studio.home / "journal").glob("*.json")), "the edit is kept")
    studio.kill()
    again = start()
    again.click("Discard")
    until(lambda: not list((studio.home / "journal").glob("*.json")), "it is thrown away")
    assert again.quit() == 0


def test_robot_stops_and_exits_when_studio_is_killed(
    start: Callable[..., Studio], tmp_path: Path, address: str
) -> None:
    studio = start(str(write(tmp_path / "Turning.nepb", started(forever(turn(300))))))
    studio.use_virtual_pepper()
    studio.click("Run", kind="RunButton")
    until(lambda: "turn" in studio.outlined("running"), "the block glows")
    mine = [*studio.children("app.robots.simulated"), *studio.children("app.blocks.runtime.child")]
    (master,) = studio.children("nep", "master")
    assert len(studio.programs()) == 1
    with nep.node("somebody", master=address) as node:
        heard = node.new_pub("/somebody/is/here", "json")
        studio.kill()
        until(lambda: not any(sleeping(each) for each in mine), "robot and program end with Studio")
        assert sleeping(master), "the master stays for the program that still needs it"
        assert "/somebody/is/here" in node.graph().topics
        heard.publish({})
    until(lambda: not sleeping(master), "the master ends when nobody needs it")


def test_killed_publisher_is_removed_from_graph_and_topic_list(
    start: Callable[..., Studio], address: str, publisher: Program
) -> None:
    studio = start()
    studio.click("Open the Developer layout")
    publisher.says("ready")
    studio.row("Topics", "/count")
    with nep.node("looker", master=address) as node:
        assert "/count" in node.graph().topics
        publisher.kill()
        until(lambda: "/count" not in node.graph().topics, "the graph forgets it")
        until(lambda: studio.row("Topics", "/count")["struck"], "the list strikes it through")
    until(lambda: not [r for r in studio.rows("Topics") if r["texts"][0] == "/count"], "10 s later it leaves")


def test_no_message_is_lost_when_the_master_is_killed(
    start: Callable[..., Studio], address: str, publisher: Program
) -> None:
    studio = start()
    studio.click("Open the Developer layout")
    publisher.says("ready")
    with Program(PEER, "hear", "/count") as listener:
        listener.says("ready")
        until(lambda: len(listener.lines) > 50, "messages flow")
        (master,) = studio.children("nep", "master")
        master.kill()

        def known() -> bool:
            found = studio.children("nep", "master")
            return bool(found) and found[0].pid != master.pid and nep.masters.master.is_running(address, 0.2)

        until(known, "Studio starts another master")
        with nep.node("looker", master=address) as node:

            def everybody() -> bool:
                graph = node.graph()
                topic = graph.topics.get("/count")
                names = {each.name for each in graph.nodes.values()}
                return bool(
                    topic and topic.publishers and topic.subscribers and {"publisher", "hearer"} <= names
                )

            until(everybody, "the new master knows all of them again")
        heard = len(listener.lines)
        until(lambda: len(listener.lines) > heard + 50, "messages flow as before")
        publisher.end_input()
        assert publisher.wait(END_S) == 0
        last = int(publisher.lines[-1]) - 1
        listener.says(str(last))
        numbers = [int(line) for line in listener.lines if line.isdigit()]
        assert numbers == list(range(numbers[0], last + 1)), "every message, once, in order"
