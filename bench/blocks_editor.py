"""Benchmark of the block editor with 1000 blocks: load time, drop latency and CPU use during a run.

    python3 dev.py bench blocks_editor -- --rounds 9

"20 blocks" is the baseline of a nearly empty page, "1000 blocks again" shows the repeatability.
Times are medians, from the user's input to the next painted frame. Offscreen unless ``QT_QPA_PLATFORM``
is set; software rendering with ``QT_QUICK_BACKEND=software``.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
if hasattr(os, "geteuid") and os.geteuid() == 0:
    os.environ.setdefault("QTWEBENGINE_DISABLE_SANDBOX", "1")

import psutil
from PySide6.QtCore import QElapsedTimer, QEventLoop, QPoint, Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.blocks.toolbox.definitions import editor_definitions
from app.ui.blockly.view import BlocklyView, register_scheme
from bench.blocks import TRUSTED

LOAD_S, DROP_MS = 1.0, 50.0
LONG_MS = 30_000
WATCH = """
window.benchDrops = []; window.benchGap = 0;
document.addEventListener('pointerup', () => {
  const began = performance.now();
  requestAnimationFrame(() => {
    const done = new MessageChannel();
    done.port1.onmessage = () => window.benchDrops.push(performance.now() - began);
    done.port2.postMessage(0);
  });
  let before = began; window.benchGap = 0;
  const look = (now) => { window.benchGap = Math.max(window.benchGap, now - before); before = now;
    if (now - began < 700) requestAnimationFrame(look); else window.benchWatched = true; };
  window.benchWatched = false; requestAnimationFrame(look);
}, true);
"""
FRAME = """(window.benchShown = false,
  requestAnimationFrame(() => requestAnimationFrame(() => benchShown = true)))"""


def number(value: float) -> dict[str, object]:
    """Return a shadow block with a number for an input."""
    return {"shadow": {"type": "values_number", "fields": {"NUMBER": value}}}


def program(blocks: int) -> dict[str, object]:
    """Return a workspace of at least this many blocks, without shadows, in scripts of about 20 blocks."""
    tops: list[dict[str, object]] = []
    made = 0
    while made < blocks:
        top: dict[str, object] = {"type": "events_started", "id": f"s{made}"}
        top |= {"x": 40 + 460 * (len(tops) % 6), "y": 40 + 760 * (len(tops) // 6)}
        tops.append(top)
        made, last = made + 1, top
        for _ in range(5):
            if made < blocks:
                made, last = _part(made, last)
    return {"blocks": {"languageVersion": 0, "blocks": tops}, "variables": [{"id": "v", "name": "count"}]}


def _part(made: int, last: dict[str, object]) -> tuple[int, dict[str, object]]:
    """Append four blocks: a wait, and an if that compares the variable."""
    wait: dict[str, object] = {"type": "control_wait", "id": f"w{made}", "inputs": {"SECONDS": number(2)}}
    variable: dict[str, object] = {"type": "variables_get", "id": f"v{made}", "fields": {"VAR": {"id": "v"}}}
    below: dict[str, object] = {"type": "values_compare", "id": f"c{made}", "fields": {"RELATION": "<"}}
    below["inputs"] = {"A": {"block": variable}, "B": number(20)}
    inputs = {"CONDITION": {"block": below}}
    last["next"] = {"block": wait}
    choice: dict[str, object] = {"type": "control_if", "id": f"i{made}", "inputs": inputs}
    wait["next"] = {"block": choice}
    return made + 4, choice


class Bench:
    """Editor page driven by scripts and mouse events without pauses."""

    def __init__(self) -> None:
        """Open the page and wait until it is ready."""
        self.view = BlocklyView()
        self.view.resize(1440, 900)
        self.view.set_definitions(editor_definitions([]))
        ready = QEventLoop()
        self.view.ready.connect(ready.quit)
        self.view.show()
        ready.exec()
        self.ask(f"(() => {{ {WATCH} return 0 }})()")

    def ask(self, script: str) -> object:
        """Return the result of a script, or None if it has none."""
        assert self.view.web is not None
        said: list[object] = []
        loop = QEventLoop()

        def answered(it: object) -> None:
            said.append(it)
            loop.quit()

        self.view.web.page.runJavaScript(f"JSON.stringify({script})", answered)
        loop.exec()
        return json.loads(str(said[0])) if said[0] else None

    def wait_for(self, script: str) -> None:
        """Wait until a script returns true; exit after a timeout."""
        watch = QElapsedTimer()
        watch.start()
        while not self.ask(script):
            if watch.elapsed() > LONG_MS:
                raise SystemExit(f"it never came: {script}")

    def load_s(self, workspace: Mapping[str, object]) -> float:
        """Load a workspace and return the seconds until its blocks are painted."""
        began = time.perf_counter()
        self.view.load(workspace)
        loop = QEventLoop()
        self.view.flush(lambda _newest: loop.quit())
        loop.exec()
        self.ask(FRAME)
        self.wait_for("window.benchShown")
        return time.perf_counter() - began

    def drop_ms(self, there: bool) -> tuple[float, float]:
        """Drag the second part of the first script away, or back.

        Return the time from the drop to the next painted frame and the longest frame gap, in ms.
        """
        box = "document.querySelector('[data-id=w1]').getBoundingClientRect()"
        where = self.ask(f"(r => [r.left, r.top])({box})")
        assert isinstance(where, list)
        start = QPoint(round(where[0]) + 12, round(where[1]) + 18)
        end = start + (QPoint(180, 60) if there else QPoint(-180, -60))
        assert self.view.web is not None
        target = self.view.web.keyboard_target()
        assert isinstance(target, QWidget)
        before = self.ask("window.benchDrops.length")
        QTest.mouseMove(target, start)
        QTest.mousePress(target, Qt.MouseButton.LeftButton, pos=start)
        for step in range(1, 9):
            QTest.mouseMove(target, start + (end - start) * step / 8)
        self.wait_for("!!document.querySelector('.blocklyDragging')")
        QTest.mouseRelease(target, Qt.MouseButton.LeftButton, pos=end)
        self.wait_for(f"window.benchDrops.length > {before} && window.benchWatched")
        return float(str(self.ask("window.benchDrops.at(-1)"))), float(str(self.ask("window.benchGap")))

    def running_share(self, seconds: float, per_s: int) -> float:
        """Return the CPU use of all processes in cores while ``per_s`` blocks per second are highlighted."""
        ids = [str(each) for each in range(1, 60, 4)]
        at = 0

        def next_block() -> None:
            nonlocal at
            at += 1
            self.view.highlight([f"w{ids[at % len(ids)]}"])

        timer = QTimer()
        timer.timeout.connect(next_block)
        if per_s:
            timer.start(1000 // per_s)
        began, used = time.perf_counter(), _cpu_s()
        loop = QEventLoop()
        QTimer.singleShot(int(seconds * 1000), loop.quit)
        loop.exec()
        timer.stop()
        share = (_cpu_s() - used) / (time.perf_counter() - began)
        self.view.highlight([])
        return share


def _cpu_s() -> float:
    own = psutil.Process()
    processes = [own, *own.children(recursive=True)]
    return sum(sum(each.cpu_times()[:2]) for each in processes)


def measured(bench: Bench, rounds: int) -> dict[str, tuple[float, float, float]]:
    """Return the load time (s), drop latency (ms) and longest frame gap (ms) of each size.

    Sizes alternate, a large one always after a small one, because loading includes clearing the
    previous page.
    """
    sizes: dict[str, Mapping[str, object]] = {
        "20 blocks": program(20), "1000 blocks": program(1000),
        "20 blocks again": program(20), "1000 blocks again": program(1000),
    }  # fmt: skip
    taken: dict[str, list[tuple[float, float, float]]] = {name: [] for name in sizes}
    for _ in range(rounds + 1):
        for name, workspace in sizes.items():
            load = bench.load_s(workspace)
            drops = [bench.drop_ms(there) for there in (True, False)]
            taken[name].append((load, max(each[0] for each in drops), max(each[1] for each in drops)))
    return {name: _middle(each[1:]) for name, each in taken.items()}  # without the warm-up (allocations)


def _middle(rows: list[tuple[float, float, float]]) -> tuple[float, float, float]:
    load, drop, gap = (statistics.median(column) for column in zip(*rows, strict=True))
    return load, drop, gap


def main() -> int:
    """Print the table; return 1 if the run is not valid or misses a goal."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=4.0, help="how long a running block is watched")
    asked = parser.parse_args()
    register_scheme()
    application = QApplication.instance() or QApplication(sys.argv[:1])
    bench = Bench()
    rows = measured(bench, asked.rounds)
    for name, (load, drop, gap) in rows.items():
        print(f"{name:>17}: load {load:6.3f} s   drop {drop:5.1f} ms   longest standstill {gap:5.1f} ms")
    bench.load_s(program(1000))
    shares: list[tuple[str, Callable[[], float]]] = [
        ("at rest", lambda: bench.running_share(asked.seconds, 0)),
        ("30 blocks a second", lambda: bench.running_share(asked.seconds, 30)),
        ("one block that runs", lambda: bench.running_share(asked.seconds, 1)),
    ]
    for words, measure in shares:
        print(f"{words:>20}: {100 * measure():5.1f} % of a core, all processes")
    load, drop, _ = rows["1000 blocks"]
    trusted = abs(rows["1000 blocks again"][0] / rows["1000 blocks"][0] - 1) <= TRUSTED
    reached = load <= LOAD_S and drop <= DROP_MS
    print(f"goals ({LOAD_S:g} s, {DROP_MS:g} ms) {'reached' if reached else 'missed'}; "
          f"the run {'counts' if trusted else 'does not count: the computer was busy'}")  # fmt: skip
    bench.view.close()
    del application
    return 0 if reached and trusted else 1


if __name__ == "__main__":
    sys.exit(main())
