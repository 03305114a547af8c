"""Count of the functions of nep and app that a message, an edit, Run, Stop and `nep topic list` call.

    python3 dev.py bench ways -- --list

Counted are the distinct functions of nep and app that ran in Studio's process between a cause and its
effect, without those that ran in the idle seconds before, such as those of every tick. Python's
profile hook counts them, in the window's thread and in all others. For the command `nep topic list`,
all functions of the process are counted. The noise is a few functions, even on a busy computer.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWebEngineWidgets import QWebEngineView
from PySide6.QtWidgets import QApplication, QWidget

from bench.blocks_editor import WATCH, Bench, program
from bench.studio_window import Studio, child, network, run_for, studio, until

ROOT = Path(__file__).resolve().parents[1]
OURS = (str(ROOT / "app"), str(ROOT / "nep"))
HEAD = {"format": "nep-behaviour", "version": 1, "description": "", "robots": {}}
IDLE_S = 2.0
PUBLISHER = """
import sys, nep
node = nep.node("one"); pub = node.new_pub("pose", "json")
for n, _line in enumerate(sys.stdin):
    pub.publish({"x": n, "joints": [n, 2, 3]}); print(n, flush=True)
"""
COMMAND = """
import sys, threading
ours, seen = sys.argv.pop(1), set()
def heard(frame, event, _argument):
    if event == "call" and frame.f_code.co_filename.startswith(ours): seen.add(frame.f_code)
threading.setprofile(heard); sys.setprofile(heard)
sys.argv[:] = ["nep", "topic", "list"]
import nep.cli
try:
    nep.cli.main()
except SystemExit:
    pass
sys.setprofile(None)
names = sorted(f"{c.co_filename.removeprefix(ours)} {getattr(c, 'co_qualname', c.co_name)}"
               for c in seen if not c.co_name.startswith("<") and c.co_flags & 1)  # not the bodies of classes
print("WAY", *names, sep="\\n")
"""


class Heard:
    """Recorder of the functions of nep and app that run, with `sys.setprofile` in each thread.

    Create it before the threads whose functions it records.
    """

    def __init__(self) -> None:
        """Install the profile hook in this thread and all threads that start later."""
        self._now: set[CodeType] | None = None
        threading.setprofile(self._called)
        sys.setprofile(self._called)

    def _called(self, frame: FrameType, event: str, _argument: object) -> None:
        now = self._now
        if now is not None and event == "call" and frame.f_code.co_filename.startswith(OURS):
            now.add(frame.f_code)

    @contextmanager
    def recording(self) -> Iterator[set[CodeType]]:
        """Yield the set to which the functions that run in the block are added."""
        self._now = found = set[CodeType]()
        try:
            yield found
        finally:
            self._now = None

    def way(self, cause: Callable[[], object], effect: Callable[[], object], what: str) -> list[str]:
        """Return the functions that run between a cause and its effect, but not when idle."""
        with self.recording() as idle:
            run_for(IDLE_S)
        with self.recording() as found:
            cause()
            until(effect, what, 40)
            run_for(0.2)  # includes the functions of the next ticks
        return sorted(_named(code) for code in found - idle if not code.co_name.startswith("<"))


def _named(code: CodeType) -> str:
    return (
        f"{Path(code.co_filename).relative_to(ROOT).as_posix()} {getattr(code, 'co_qualname', code.co_name)}"
    )


def press(widget: QWidget) -> None:
    """Send a mouse press and release to a button."""
    at = QPointF(widget.rect().center())
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    for kind in (QEvent.Type.MouseButtonPress, QEvent.Type.MouseButtonRelease):
        where = widget.mapToGlobal(at)
        QApplication.sendEvent(widget, QMouseEvent(kind, at, where, left, left, none))


def button(studio: Studio, name: str) -> QWidget:
    """Return the visible button of this class name."""
    found = [
        each
        for each in studio.window.findChildren(QWidget)
        if type(each).__name__ == name and each.isVisible()
    ]
    assert found, f"no {name} is shown"
    return found[0]


def message(heard: Heard, studio: Studio, address: str) -> list[str]:
    """Return the functions from a message of another process to the tree of the Inspector."""
    with child(PUBLISHER, [], address) as other:
        other.tell("first")
        other.answer()

        def topic() -> object:
            return next((each for each in studio.session.live.topics if each.name == "pose"), None)

        until(topic, "the topic")
        studio.window.open_topic("pose")
        until(lambda: getattr(topic(), "is_watched", False), "the Inspector looks")
        for _ in range(3):
            other.tell("again")
            other.answer()
            run_for(0.5)
        seen = [0]

        def shown() -> bool:
            newest = getattr(topic(), "newest", None)
            return newest is not None and newest.payload["x"] > seen[0]

        newest = topic().newest  # type: ignore[attr-defined]
        seen[0] = newest.payload["x"]
        return heard.way(lambda: other.tell("one more"), shown, "the message")


def run_and_stop(heard: Heard, studio: Studio, address: str) -> tuple[list[str], list[str]]:
    """Return the functions from Run to the first highlighted block, and from Stop to the robot's reply."""
    robot = "import runpy, sys; sys.argv = ['simulated', '--name', 'Pepper']\n"
    robot += "runpy.run_module('app.robots.simulated', run_name='__main__')"
    with child(robot, [], address):
        fleet, runs = studio.session.fleet, studio.session.runs
        until(lambda: any(link.state == "ready" for link in fleet.links), "the robot", 60)
        run_for(1.0)
        begin, end = button(studio, "RunButton"), button(studio, "StopButton")
        began = heard.way(lambda: press(begin), lambda: runs.running_blocks, "it runs")
        ended = heard.way(lambda: press(end), lambda: runs.view().state == "proven", "it stopped")
    return began, ended


def edit(heard: Heard, studio: Studio) -> list[str]:
    """Return the functions from dropping a block at another place to writing the journal."""
    view = next(each for each in studio.window.findChildren(QWidget) if type(each).__name__ == "BlocklyView")
    bench = object.__new__(Bench)
    bench.view = view  # type: ignore[assignment]
    bench.ask(f"(() => {{ {WATCH} return 0 }})()")
    journals = Path(os.environ["NEP_STUDIO_HOME"])  # also contains settings, but those have no blocks

    def written() -> dict[Path, bytes]:
        kept = {path: path.read_bytes() for path in journals.glob("*.json")}
        return {path: text for path, text in kept.items() if b"events_started" in text}

    bench.drop_ms(there=True)
    run_for(1.0)
    before = written()
    return heard.way(lambda: bench.drop_ms(there=False), lambda: written() != before, "the journal")


def topic_list(address: str) -> list[str]:
    """Return the functions of `nep topic list` in its own process."""
    done = subprocess.run(
        [sys.executable, "-c", COMMAND, str(ROOT / "nep")],
        env={**os.environ, "NEP_MASTER": address, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.partition("WAY\n")[2].splitlines()


def behaviour(folder: Path) -> Path:
    """Write a behaviour of some blocks, the first of which waits for a long time; return its path."""
    blocks = program(20)
    path = folder / "ways.nepb"
    path.write_text(json.dumps({**HEAD, "name": "ways", "workspace": blocks}))
    return path


def main() -> int:
    """Print the counts; with `--list`, also the functions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--list", action="store_true", help="name the functions")
    options = parser.parse_args()
    heard = Heard()
    ways: dict[str, list[str]] = {}
    with network() as address:
        ways["nep topic list"] = topic_list(address)
        with studio(address) as opened:
            ways["message to tree"] = message(heard, opened, address)
        with studio(address, "behaviour") as opened:
            opened.commands.files.open_all([behaviour(Path(os.environ["NEP_STUDIO_HOME"]))])
            until(lambda: opened.window.findChild(QWebEngineView), "the editor")
            run_for(5.0)
            ways["edit to journal"] = edit(heard, opened)
            ways["Run to first block"], ways["Stop to answer"] = run_and_stop(heard, opened, address)
    for name, functions in ways.items():
        print(f"{name:20} {len(functions):4} functions of ours")
        if options.list:
            print(*(f"    {each}" for each in functions), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
