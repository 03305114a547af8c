"""Endurance test of the window with everything running: memory stays flat and handles are released.

    python bench/soak.py [--minutes 15] [--csv build/soak.csv]

The real window has a virtual robot with a visible camera and a behaviour that moves it endlessly.
Simulated user actions change layouts, panels and topics every two seconds, and stop and run the
program again. Memory (without file mappings), handles and threads of this process and all its child
processes are sampled. After a warm-up of one third of the time a line is fitted to the memory: its
rise until the end must stay within 6 % of the memory, or 12 MB. Handles and threads vary with the
visible panels: their maximum in the second half after the warm-up must not exceed that of the first
half.
"""

from __future__ import annotations

import argparse
import csv
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import cycle
from pathlib import Path

import psutil
from studio_window import Studio, network, percentile, run_for, studio, until

from app.core.session import Session
from app.intents import Inspect
from nep.recordings.reader import Recording

ROOT = Path(__file__).resolve().parents[1]
EVERY_S, STEP_S, HURRY_S, FIRST_S = 2.5, 2.0, 0.5, 18.0
RISE_SHARE, RISE_MB, MORE = 0.06, 12.0, 8
BARS = "▁▂▃▄▅▆▇█"
PANELS = ("image", "console", "alerts", "nodes", "sensors", "robots")
PEPPER = json.loads((ROOT / "resources/examples/1-greeting.nepb").read_text("utf-8"))["robots"]


def shadow(kind: str, field: str, value: object) -> dict[str, object]:
    """Return a shadow block for a slot."""
    return {"shadow": {"type": kind, "id": f"{kind} {value}", "fields": {field: value}}}


def behaviour() -> dict[str, object]:
    """Return a behaviour that turns the robot and lets it speak, in an endless loop."""
    pepper: dict[str, object] = {"ROBOT": "Pepper"}
    say = {
        "type": "robot_pepper_do_say",
        "id": "say",
        "fields": pepper,
        "inputs": {"TEXT": shadow("values_text", "TEXT", "Round and round")},
    }
    turn = {
        "type": "robot_pepper_do_turn",
        "id": "turn",
        "fields": {**pepper, "DIRECTION": "left"},
        "inputs": {"ANGLE": shadow("values_number", "NUMBER", 45)},
        "next": {"block": say},
    }
    loop = {"type": "control_forever", "id": "forever", "inputs": {"BODY": {"block": turn}}}
    start = {"type": "events_started", "id": "started", "x": 56, "y": 56, "next": {"block": loop}}
    return {
        "format": "nep-behaviour",
        "version": 1,
        "name": "Soak",
        "workspace": {"blocks": {"languageVersion": 0, "blocks": [start]}},
        "robots": PEPPER,
    }


@dataclass(frozen=True)
class Sample:
    """One sample: seconds since the start, memory in MB, the tick in ms, and counts."""

    at_s: float
    studio_mb: float
    others_mb: float
    processes: int
    handles: int
    threads: int
    window_ms: float
    sizes: Mapping[int, float] = field(default_factory=dict, repr=False)
    """Memory of the child processes in MB, by process ID; only those that live throughout are judged."""


def private_mb(process: psutil.Process) -> float:
    """Return the memory without file mappings, in MB.

    How much of the mapped libraries counts for a process depends on the other processes that use them.
    """
    memory = process.memory_info()
    return (memory.rss - getattr(memory, "shared", 0)) / 1e6


def take(began: float, opened: Studio) -> Sample:
    """Take a sample of this process and all its child processes."""
    own = psutil.Process()
    sizes: dict[int, float] = {}
    for other in own.children(recursive=True):
        try:
            sizes[other.pid] = private_mb(other)
        except psutil.Error:
            continue  # the process has just exited
    return Sample(
        round(time.monotonic() - began, 1),
        round(private_mb(own), 1),
        round(sum(sizes.values()), 1),
        len(sizes),
        own.num_fds() if hasattr(own, "num_fds") else own.num_handles(),
        own.num_threads(),
        round(opened.session.tick_ms, 2),
        sizes,
    )


def hands(opened: Studio) -> Iterator[Callable[[], object]]:
    """Yield simulated user actions endlessly."""
    commands, session = opened.commands, opened.session
    panels, topics = cycle(PANELS), cycle(range(7))

    def inspect() -> object:
        live = sorted(topic.name for topic in session.live.topics.existing_topics())
        return commands.request(Inspect(live[next(topics) * 5 % len(live)])) if live else None

    def toggle() -> object:
        name, bench = next(panels), opened.window.bench
        if bench is None or name not in opened.window.panels:
            return None
        return bench.docks[name].close() if name in bench.open_names() else bench.open(name)

    def run() -> object:
        return None if session.runs.active else session.runs.run()

    while True:
        yield lambda: commands.run("layout.developer")
        yield inspect
        yield toggle
        yield inspect
        yield lambda: commands.run("layout.behaviour")
        yield toggle
        yield run
        yield toggle
        yield lambda: commands.run("theme.dark")
        yield inspect
        yield lambda: commands.run("theme.light")
        yield session.runs.stop
        yield lambda: commands.run("layout.behaviour")
        yield run


def soak(opened: Studio, seconds: float) -> list[Sample]:
    """Run the window for `seconds` with simulated user actions; return the samples."""
    began, doing, samples = time.monotonic(), hands(opened), []
    next_step = next_sample = began
    while (now := time.monotonic()) < began + seconds:
        if now >= next_step:
            # warm-up: open every panel once before the samples that are judged
            next_step = now + (HURRY_S if now < began + FIRST_S else STEP_S)
            next(doing)()
        if now >= next_sample:
            next_sample = now + EVERY_S
            samples.append(take(began, opened))
        run_for(0.1)
    return samples


def begin_recording(session: Session) -> None:
    """Start a recording of all topics, including images."""
    folder = session.settings.path.parent / "Recordings"
    folder.mkdir()
    session.recordings.set_folder(folder)
    said = session.recordings.record("Soak")
    until(lambda: session.recordings.is_recording, f"it records {said}", 30.0)


def recorded_all(session: Session) -> bool:
    """Stop the recording; return True if its file is complete and no message was dropped."""
    session.recordings.stop()
    until(lambda: not session.recordings.is_recording, "the recording has ended", 60.0)
    (path,) = session.recordings.folder.glob("*.mcap")
    with Recording(path) as recording:
        unkept = sum(each.unkept for each in recording.stats().values())
        print(
            f"recorded {recording.message_count} messages of {len(recording.topics)} topics, "
            f"{path.stat().st_size / 1e6:.1f} MB in {recording.duration_s:.0f} s; {unkept} not kept"
        )
        return recording.is_complete and recording.message_count > 0 and not unkept


def rise(samples: Sequence[Sample], values: Sequence[float]) -> float:
    """Return the rise of a fitted line from the first to the last sample."""
    slope = statistics.linear_regression([sample.at_s for sample in samples], values).slope
    return slope * (samples[-1].at_s - samples[0].at_s)


def chart(values: Sequence[float], width: int = 60) -> str:
    """Return the values as a sparkline, scaled from minimum to maximum."""
    least, most = min(values), max(values)
    chosen = [values[n * (len(values) - 1) // max(1, width - 1)] for n in range(min(width, len(values)))]
    return "".join(BARS[round((value - least) / ((most - least) or 1) * 7)] for value in chosen)


def judge(samples: Sequence[Sample]) -> bool:
    """Print the table; return True if everything stayed flat after the warm-up."""
    warm = samples[len(samples) // 3 :]
    flat = True
    print(f"{'':>10} {'first':>8} {'warm':>8} {'last':>8} {'most':>8} {'rise':>8} {'may':>7}")
    lasting = set(warm[0].sizes).intersection(*(sample.sizes for sample in warm))
    for name in ("studio_mb", "others_mb", "handles", "threads"):
        values = [float(getattr(sample, name)) for sample in warm]
        if name == "others_mb":  # only processes that ran throughout the measurement
            values = [sum(sample.sizes[pid] for pid in lasting) for sample in warm]
        if name.endswith("mb"):
            risen, may = rise(warm, values), max(RISE_MB, RISE_SHARE * values[0])
        else:
            half = len(values) // 2
            risen, may = max(values[half:]) - max(values[:half]), float(MORE)
        well = risen <= may
        flat &= well
        first = float(getattr(samples[0], name))
        print(
            f"{name:>10} {first:>8.1f} {values[0]:>8.1f} {values[-1]:>8.1f} {max(values):>8.1f} "
            f"{risen:>+8.1f} {may:>7.1f}  {'flat' if well else 'RISES'}"
        )
        print(f"{'':>11}{chart([float(getattr(sample, name)) for sample in samples])}")
    window = [sample.window_ms for sample in warm]
    print(f"session's tick: median {statistics.median(window):.2f} ms, p95 {percentile(window, 95):.2f} ms")
    return flat


def main() -> int:
    """Run the test, print a table and write the samples; return 0 if everything stayed flat."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=15.0)
    parser.add_argument("--csv", type=Path, default=ROOT / "build" / "soak.csv")
    arguments = parser.parse_args()
    with network() as address, studio(address, "behaviour") as opened:
        session = opened.session
        file = session.settings.path.parent / "Soak.nepb"
        file.write_text(json.dumps(behaviour()), encoding="utf-8")
        opened.commands.files.open(file)
        session.launcher.start_virtual_robot("Pepper")
        until(lambda: session.fleet.connected, "the virtual robot is there", 60.0)
        session.runs.run()
        until(lambda: session.runs.running_blocks, "the behaviour runs", 30.0)
        begin_recording(session)
        samples = soak(opened, arguments.minutes * 60)
        whole = recorded_all(session)
    arguments.csv.parent.mkdir(parents=True, exist_ok=True)
    with arguments.csv.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        names = [each.name for each in fields(Sample) if each.name != "sizes"]
        writer.writerow(names)
        writer.writerows([getattr(sample, name) for name in names] for sample in samples)
    flat = judge(samples) and whole
    print(f"{len(samples)} samples in {arguments.csv}; {'flat' if flat else 'NOT flat'}")
    return 0 if flat else 1


if __name__ == "__main__":
    sys.exit(main())
