"""Benchmark of Studio's start time: an installed package and the source tree, interleaved.

    python bench/package_start.py FOLDER [--times 9] [--warm]

FOLDER contains the program `nep-studio`: an unpacked archive, or /opt/nep-studio. Each start has its
own home folder and is timed from outside: from the creation of the process until its window replies
to the request of a second start. By then it has been painted and responds. "own work" is the
processor time of the process until then, which depends less on other programs. Before each start the
system's file cache is dropped, as after booting; that needs root. Without root, or with --warm, the
files are cached already. "source again" is a second series of the source tree, which shows the noise.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from app.ui.startup.single_instance import OK_REPLY, socket_name

ROOT = Path(__file__).resolve().parents[1]
DROP = Path("/proc/sys/vm/drop_caches")
GOAL, TRUSTED = 1.5, 0.1
MAX_S, LOOK_S = 60.0, 0.002
MASTER_END_S = 10.0
PAUSE = threading.Event()


@dataclass(frozen=True)
class Start:
    """Seconds until the window replied, and processor time that the process used until then."""

    seconds: float
    work: float


def forget() -> bool:
    """Drop the system's file cache; return False if that isn't permitted."""
    try:
        os.sync()
        DROP.write_text("3")
    except OSError:
        return False
    return True


@contextlib.contextmanager
def surroundings() -> Iterator[dict[str, str]]:
    """Yield the environment of one start, with its own home folder, runtime folder and master port."""
    with tempfile.TemporaryDirectory(prefix="nep-start-") as folder, socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        environ = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        environ.update(
            NEP_STUDIO_HOME=folder,
            NEP_STATE_DIR=folder,
            XDG_RUNTIME_DIR=folder,
            NEP_MASTER=f"127.0.0.1:{probe.getsockname()[1]}",
            NEP_GATEWAY="0",
        )
        probe.close()
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            environ["QTWEBENGINE_DISABLE_SANDBOX"] = "1"  # Chromium's sandbox doesn't work as root
        yield environ


def until_answered(name: str, process: subprocess.Popen[bytes], until: float) -> None:
    """Send an empty request to the window repeatedly until it replies; exit on timeout."""
    while process.poll() is None and time.monotonic() < until:
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX) as line:
            line.settimeout(MAX_S)
            line.connect(name)
            line.sendall(json.dumps({"files": [], "demo": False}).encode() + b"\n")
            if line.recv(len(OK_REPLY)) == OK_REPLY:
                return
        PAUSE.wait(LOOK_S)
    raise SystemExit(f"no window answered within {MAX_S:g} s: {process.args!r}")


def once(command: Sequence[str], *, cold: bool) -> Start:
    """Start Studio, wait until its window replies, and stop it with all its child processes."""
    with surroundings() as environ:
        if cold:
            forget()
        os.environ["XDG_RUNTIME_DIR"] = environ["XDG_RUNTIME_DIR"]
        name = socket_name(Path(environ["NEP_STUDIO_HOME"]))
        began = time.monotonic()
        process = subprocess.Popen(command, cwd=ROOT, env=environ, stdout=subprocess.DEVNULL)
        family: list[psutil.Process] = []
        try:
            until_answered(name, process, began + MAX_S)
            seconds = time.monotonic() - began
            used = psutil.Process(process.pid).cpu_times()
            family = psutil.Process(process.pid).children(recursive=True)
            process.send_signal(signal.SIGTERM)
            process.wait(MAX_S)
        finally:
            process.kill()
            process.wait()
            _gone, left = psutil.wait_procs(family, MASTER_END_S)
            for each in left:
                with contextlib.suppress(psutil.Error):
                    each.kill()
    return Start(seconds, used.user + used.system)


def main() -> int:
    """Measure and print a table; return 0 if the goal was reached and the run counts."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--times", type=int, default=9)
    parser.add_argument("--warm", action="store_true")
    given = parser.parse_args()
    cold = not given.warm and forget()
    source = (sys.executable, "-m", "app")
    kinds = {
        "source": source,
        "package": (str(given.folder.resolve() / "nep-studio"),),
        "source again": source,
    }
    for command in kinds.values():
        once(command, cold=False)  # warm-up: fills the bytecode cache
    starts: dict[str, list[Start]] = {name: [] for name in kinds}
    for _ in range(given.times):
        for name, command in kinds.items():
            starts[name].append(once(command, cold=cold))
    print("cold: nothing was in memory" if cold else "warm: the files were in memory")
    print(f"{'':>14} {'median s':>9} {'least':>6} {'most':>6}  own work s")
    medians = {}
    for name, each in starts.items():
        seconds = [start.seconds for start in each]
        medians[name] = statistics.median(seconds)
        work = statistics.median(start.work for start in each)
        print(f"{name:>14} {medians[name]:>9.2f} {min(seconds):>6.2f} {max(seconds):>6.2f}  {work:.2f}")
    again = medians["source again"] / medians["source"]
    ratio = medians["package"] / statistics.mean((medians["source"], medians["source again"]))
    counts = abs(again - 1.0) <= TRUSTED
    print(f"source against itself: {again:.2f}; this run {'counts' if counts else 'does NOT count'}")
    print(f"{psutil.getloadavg()[0]:.1f} programs wanted {psutil.cpu_count()} processors in the last minute")
    print(f"package ÷ source: {ratio:.2f}, goal {GOAL:g}")
    return 0 if counts and ratio <= GOAL else 1


if __name__ == "__main__":
    sys.exit(main())
