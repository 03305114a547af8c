"""Benchmark of image streams in the open window: four of 1280 x 720, two of 1920 x 1080, 30 Hz each.

    python bench/studio_images.py [--seconds 8]

Another process publishes JPEG images of a moving scene. Each stream has its own Image panel in the
real window. "shown" is the share of the sent images that were painted, "age" the time from publishing
to painting in ms, "late" the delay of a 10 ms timer in the window's event loop, "bare" the delay of a
program that only waits.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from dataclasses import replace
from time import time_ns

from PySide6.QtCore import QEvent, QObject, Qt
from studio_window import (
    BARE,
    Child,
    Meter,
    Studio,
    child,
    network,
    percentile,
    run_for,
    studio,
    until,
    verdict,
)

from app.ui.pictures.view import PictureView

SHOWN, AGE_MS, GAP_MS, HZ = 0.98, 70.0, 16.0, 30
CASES = ((4, 1280, 720), (2, 1920, 1080))

CAMERAS = """
import sys, threading, time
import cv2, numpy as np, nep
count, width, height, hz = (int(word) for word in sys.argv[1:])
cv2.setNumThreads(1)
y, x = np.mgrid[0:height, 0:width]
frames = []
for shift in range(6):
    planes = [(x + 40 * shift) % 256, (y + x // 2) % 256, (y * 2 + 25 * shift) % 256]
    frame = np.dstack(planes).astype(np.uint8)
    for n in range(12):
        at = (int((n * 0.08 + shift * 0.02) * width) % width, int((0.1 + 0.07 * n) * height))
        cv2.circle(frame, at, 20 + 4 * n, (20 * n, 255 - 20 * n, 128), -1)
    frames.append(cv2.imencode(".jpg", cv2.GaussianBlur(frame, (5, 5), 0), [1, 80])[1].tobytes())
info = {"shape": [height, width, 3], "encoding": "jpeg"}
node = nep.node(f"cameras {width}")
pubs = [node.new_pub(f"/camera/{width}/{n}", "image") for n in range(count)]
pause = threading.Event()
print("ready", flush=True)
for line in sys.stdin:
    began, sent = time.perf_counter(), 0
    seconds = float(line)
    while sent < seconds * hz * count:
        due = began + sent / (hz * count)
        now = time.perf_counter()
        if now < due:
            pause.wait(due - now)
        pubs[sent % count].publish_bytes(frames[(sent // count) % len(frames)], info)
        sent += 1
    print(sent, len(frames[0]), flush=True)
"""


class Eyes(QObject):
    """Event filter that records the age of every image that a view paints."""

    def __init__(self, views: list[PictureView]) -> None:
        super().__init__()
        self.ages_ms: list[float] = []
        self._seen: dict[PictureView, object] = {}
        for view in views:
            view.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802  Qt's name
        """Record the age of a newly painted image; never filter an event out."""
        if event.type() == QEvent.Type.Paint and isinstance(watched, PictureView):
            picture = watched.picture
            if picture is not None and picture is not self._seen.get(watched):
                self._seen[watched] = picture
                if picture.stamp_ns is not None:
                    self.ages_ms.append((time_ns() - picture.stamp_ns) / 1e6)
        return False


def open_views(opened: Studio, topics: list[str]) -> list[PictureView]:
    """Open an Image panel for each topic, all visible, and close all other panels."""
    bench = opened.window.bench
    assert bench is not None
    for name in bench.open_names():
        bench.docks[name].close()
    docks = []
    for number, topic in enumerate(topics):
        dock = bench.open("image" if number == 0 else f"image{number}")
        assert dock is not None
        dock.panel.show_topic(topic)
        docks.append(dock)
    across, down = Qt.Orientation.Horizontal, Qt.Orientation.Vertical
    bench.splitDockWidget(docks[0], docks[1], across)
    for above, below in zip(docks, docks[2:], strict=False):
        bench.splitDockWidget(above, below, down)
    run_for(0.3)
    views = [view for dock in docks for view in dock.panel.findChildren(PictureView)]
    assert len(views) == len(topics)
    return views


def case(address: str, bare: Child, shape: tuple[int, int, int], seconds: float) -> tuple[bool, float]:
    """Measure and print a row; return whether its goals were reached, and an idle program's delay in ms."""
    count, width, height = shape
    with child(CAMERAS, [str(word) for word in (*shape, HZ)], address) as cameras, studio(address) as opened:
        cameras.answer()
        image = opened.window.panels["image"]
        opened.window.benches["developer"]._panels = {  # noqa: SLF001  one Image panel a layout is enough for people
            **opened.window.panels,
            **{f"image{n}": replace(image, name=f"image{n}") for n in range(1, count)},
        }
        topics = [f"/camera/{width}/{number}" for number in range(count)]
        until(lambda: all(topic in opened.session.live.topics for topic in topics), "the cameras are listed")
        views = open_views(opened, topics)
        cameras.tell("2")
        cameras.answer()
        run_for(1.0)
        meter, eyes = Meter(opened), Eyes(views)
        bare.tell(str(seconds))
        cameras.tell(str(seconds))
        row = meter.measure(seconds)
        sent, size = (int(word) for word in cameras.answer().split())
        bare_ms = float(bare.answer())
        run_for(0.3)
        age = percentile(eyes.ages_ms, 95)
        shown = len(eyes.ages_ms) / sent
        print(
            f"{f'{count} x {width}x{height}':>16} {size / 1000:>7.0f} {sent:>6} {shown:>7.1%} "
            f"{percentile(eyes.ages_ms, 50):>7.1f} {age:>7.1f} {row.late_p99:>8.1f} {bare_ms:>6.1f} "
            f"{row.gui:>6.0%} {row.process:>8.0%} {row.memory:>7.0f}",
            flush=True,
        )
        return shown >= SHOWN and age < AGE_MS and row.late_p99 < GAP_MS, bare_ms


def main() -> int:
    """Measure and print a table; return 0 if every goal was reached."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=8.0)
    seconds: float = parser.parse_args().seconds
    reached, bare_ms = True, 0.0
    with ExitStack() as stack:
        address = stack.enter_context(network())
        bare = stack.enter_context(child(BARE, (), address))
        bare.answer()
        print(
            f"{'':>16} {'kB':>7} {'sent':>6} {'shown':>7} {'age50':>7} {'age95':>7} {'late p99':>8} "
            f"{'bare':>6} {'GUI':>6} {'process':>8} {'RSS MB':>7}"
        )
        for shape in CASES:
            well, late = case(address, bare, shape, seconds)
            reached, bare_ms = reached and well, max(bare_ms, late)
    print(f"goals: {SHOWN:.0%} shown, age p95 under {AGE_MS:g} ms, late p99 under {GAP_MS:g} ms")
    return verdict(reached, bare_ms)


if __name__ == "__main__":
    sys.exit(main())
