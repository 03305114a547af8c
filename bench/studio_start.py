"""Benchmark of Studio's start: the time to a usable window, and to the block editor.

    python bench/studio_start.py [--times 7] [--imports]

Each start is a separate process with its own home folder. Its times are counted from the creation of
the process; "own work" is the processor time of the process, which depends less on other programs.
"window" is the first paint of the window, "usable" the first iteration of the event loop after it
(from then on clicks are handled), "master" the first reply of a master that Studio started, "editor"
the block editor's page with its blocks. "plain" is a Qt window with one label; "plain again" is a
second series, which shows the noise. --imports lists the modules that take longest to import.
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[1]
USABLE_S, EDITOR_S, TRUSTED = 0.8, 1.5, 0.1
Stages = dict[str, tuple[float, float]]
STAGES = ("python", "imports", "application", "session", "built", "window", "usable", "master", "editor")

PLAIN = """
import json, sys, time
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QLabel
class Label(QLabel):
    def paintEvent(self, event):
        super().paintEvent(event)
        QTimer.singleShot(0, tell)
def tell():
    print(json.dumps({"usable": (time.time(), time.process_time())}), flush=True)
    app.quit()
app = QApplication([])
label = Label("Studio")
label.resize(1440, 900)
label.show()
app.exec()
"""

STUDIO = """
import gc, json, sys, time
def now():
    return time.time(), time.process_time()
at = {"python": now()}
gc.disable()  # this and the next line as `app.__main__` does
import app.core.session
from app.ui import application as module
from PySide6.QtCore import QEvent, QObject, QTimer
at["imports"] = now()
module.qt_log.install_handlers()
app = module.make_application()
at["application"] = now()
session = module.Session()
at["session"] = now()
window = module.make_window(session, module.Options(opens_new_window=True))
at["built"] = now()
class Eyes(QObject):
    def eventFilter(self, watched, event):
        if event.type() == QEvent.Type.Paint and "window" not in at and watched is window:
            at["window"] = now()
            QTimer.singleShot(0, usable)
        return False
eyes = Eyes()
window.installEventFilter(eyes)
def usable():
    at["usable"] = now()
    window.removeEventFilter(eyes)
    if sys.argv[1] == "editor":
        window.commands.run("layout.behaviour")
def look():
    if "master" not in at and session.live.master.kind == "connected":
        at["master"] = now()
    bench = window.benches.get("behaviour")
    panel = bench.docks["behaviour"].panel if bench is not None else None
    editor = getattr(panel, "editor", None)
    if editor is not None and "editor" not in at and editor.is_ready:
        at["editor"] = now()
    if "master" in at and "usable" in at and ("editor" in at or sys.argv[1] != "editor"):
        print(json.dumps(at), flush=True)
        looking.stop()
        window.close()
looking = QTimer()
looking.timeout.connect(look)
looking.start(10)
window.on_shut = lambda: QTimer.singleShot(0, app.quit)
soon = module.DeferredSteps(window, module.deferred_steps(window))
soon.prepend([window.start_session])
window.show()
app.exec()
"""


def environ_with(compiled: str) -> dict[str, str]:
    """Return the environment of a start, in which compiled modules are cached in the folder `compiled`.

    Thus modules are compiled only once, as on a user's computer.
    """
    environ = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    environ.update(PYTHONPATH=str(ROOT), PYTHONPYCACHEPREFIX=compiled)
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        environ["QTWEBENGINE_DISABLE_SANDBOX"] = "1"  # Chromium's sandbox doesn't work as root
    return environ


def once(compiled: str, program: str, *arguments: str) -> Stages:
    """Start once; return for each stage the seconds since process creation and the processor time."""
    with socket.socket() as probe, tempfile.TemporaryDirectory(prefix="nep-start-") as home:
        probe.bind(("127.0.0.1", 0))
        environ = {
            **environ_with(compiled),
            "NEP_STUDIO_HOME": home,
            "NEP_MASTER": f"127.0.0.1:{probe.getsockname()[1]}",
            "NEP_GATEWAY": "0",
        }
        probe.close()
        began = time.time()
        done = subprocess.run(
            [sys.executable, "-c", program, *arguments],
            env=environ,
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if not lines:
        raise SystemExit(f"a start failed:\n{done.stderr[-2000:]}")
    return {stage: (moment - began, work) for stage, (moment, work) in json.loads(lines[-1]).items()}


def medians(starts: list[Stages], which: int) -> dict[str, float]:
    """Return the median of each stage: of the elapsed seconds (0) or of the processor time (1)."""
    return {stage: statistics.median(each[stage][which] for each in starts) for stage in starts[0]}


def table(title: str, rows: dict[str, dict[str, float]]) -> None:
    """Print the stages of each kind of start."""
    print(f"{title:>18} " + " ".join(f"{stage:>11}" for stage in STAGES))
    for name, row in rows.items():
        print(f"{name:>18} " + " ".join(f"{row[s]:>11.2f}" if s in row else f"{'':>11}" for s in STAGES))


def imports() -> None:
    """List the modules that take longest to import by themselves."""
    command = [sys.executable, "-X", "importtime", "-c", "import app.ui.application"]
    with tempfile.TemporaryDirectory(prefix="nep-pyc-") as compiled:
        for _ in range(2):  # the first run fills the bytecode cache
            done = subprocess.run(
                command, cwd=ROOT, capture_output=True, text=True, check=True, env=environ_with(compiled)
            )
    rows = []
    for line in done.stderr.splitlines():
        parts = line.removeprefix("import time:").split("|")
        if len(parts) == 3 and parts[0].strip().isdigit():
            rows.append((int(parts[0]), int(parts[1]), parts[2].strip()))
    print(f"{'own ms':>8} {'all ms':>8}")
    for own, all_of_it, name in sorted(rows, reverse=True)[:25]:
        print(f"{own / 1000:>8.1f} {all_of_it / 1000:>8.1f}  {name}")


def main() -> int:
    """Measure and print a table; return 0 if the goals were reached and the run counts."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--times", type=int, default=7)
    parser.add_argument("--imports", action="store_true")
    arguments = parser.parse_args()
    if arguments.imports:
        imports()
        return 0
    taken: dict[str, list[Stages]] = {name: [] for name in ("plain", "plain again", "window", "editor")}
    with tempfile.TemporaryDirectory(prefix="nep-pyc-") as compiled:
        once(compiled, STUDIO, "editor")  # the first start fills the bytecode cache and the disk cache
        for _ in range(arguments.times):
            for name, starts in taken.items():
                plain = name.startswith("plain")
                starts.append(once(compiled, PLAIN) if plain else once(compiled, STUDIO, name))
    found = {name: medians(starts, 0) for name, starts in taken.items()}
    table("s after the start", found)
    table("of these, own work", {name: medians(starts, 1) for name, starts in taken.items()})
    usable, editor = found["window"]["usable"], found["editor"]["editor"]
    again = found["plain again"]["usable"] / found["plain"]["usable"]
    counts = abs(again - 1.0) <= TRUSTED
    print(f"plain against itself: {again:.2f}; this run {'counts' if counts else 'does NOT count'}")
    print(f"{psutil.getloadavg()[0]:.1f} programs wanted {psutil.cpu_count()} processors in the last minute")
    print(f"goals: usable {usable:.2f} s of {USABLE_S:g} s, editor {editor:.2f} s of {EDITOR_S:g} s")
    return 0 if counts and usable <= USABLE_S and editor <= EDITOR_S else 1


if __name__ == "__main__":
    sys.exit(main())
