"""Tests of the interpreter settings: a short switch interval and frozen long-lived objects.

Objects created later are still collected.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QAction
from pytestqt.qtbot import QtBot

from app.ui.startup import interpreter


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    interval, thresholds, enabled = sys.getswitchinterval(), gc.get_threshold(), gc.isenabled()
    yield
    sys.setswitchinterval(interval)  # frozen objects stay frozen: collecting all of them takes a second
    gc.set_threshold(*thresholds)
    (gc.enable if enabled else gc.disable)()


def test_switch_interval_is_shortened_to_keep_the_gui_responsive() -> None:
    sys.setswitchinterval(0.005)
    interpreter.shorten_switch_interval()
    assert sys.getswitchinterval() <= 0.001


def test_studio_shortens_the_switch_interval_at_startup() -> None:
    program = (
        "import sys\n"
        "from app.ui.application import make_application\n"
        "make_application()\n"
        "print(sys.getswitchinterval())\n"
    )
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    said = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    assert float(said.stdout) == pytest.approx(interpreter.SWITCH_INTERVAL_S)


def test_long_lived_objects_are_frozen_and_later_garbage_is_collected() -> None:
    standing = [[n] for n in range(1000)]
    gc.disable()
    interpreter.freeze_objects()
    assert gc.get_freeze_count() > 1000
    assert not any(each is standing for each in gc.get_objects())
    circle: list[object] = []
    circle.append(circle)
    del circle
    assert gc.collect() >= 1


class Deleted:
    """Record of the thread ids in which Qt objects of reference cycles were deleted."""

    def __init__(self) -> None:
        self.by: list[int] = []

    def make(self, circles: int) -> None:
        for _circle in range(circles):
            item = QAction()
            item.destroyed.connect(lambda: self.by.append(threading.get_ident()), Qt.DirectConnection)
            item.me = item  # type: ignore[attr-defined]


def test_qt_objects_are_deleted_in_the_gui_thread_even_with_busy_threads(qtbot: QtBot) -> None:
    deleted, made = Deleted(), 300
    owner = QObject()
    gc.collect()
    timer = interpreter.GcTimer(owner)
    timer.setInterval(5)
    timer.start()
    deleted.make(made)

    def busy() -> None:
        for _round in range(10):
            _kept = [[n] for n in range(2 * interpreter.NEW_OBJECTS_THRESHOLD)]

    threads = [threading.Thread(target=busy) for _thread in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not deleted.by
    _kept = [[n] for n in range(2 * interpreter.NEW_OBJECTS_THRESHOLD)]
    qtbot.waitUntil(lambda: len(deleted.by) == made, timeout=60_000)
    assert set(deleted.by) == {threading.get_ident()}


def test_older_gc_generations_are_collected_less_often(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(gc, "collect", asked.append)
    few, many = interpreter.COLLECTIONS_THRESHOLD, interpreter.COLLECTIONS_THRESHOLD + 1
    made = interpreter.NEW_OBJECTS_THRESHOLD + 1
    for counts in ((made - 1, many, many), (made, few, many), (made, many, few), (made, many, many)):
        monkeypatch.setattr(gc, "get_count", lambda counts=counts: counts)
        interpreter.collect_garbage()
    assert asked == [0, 1, 2]


def test_gc_freeze_timer_runs_one_interval_after_its_last_restart(qtbot: object, qapp: object) -> None:
    owner = QObject()
    timer = interpreter.GcFreezeTimer(owner)
    timer.setInterval(20)
    before = gc.get_freeze_count()
    timer.start()
    with qtbot.waitSignal(timer.timeout):  # type: ignore[attr-defined]
        timer.start()
    assert gc.get_freeze_count() > before
    assert not timer.isActive()
