"""Python's settings: a busy thread lets the window have its turn, and standing garbage is put aside.

What comes later is still collected.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Iterator

import pytest
from PySide6.QtCore import QObject

from app.ui.startup import interpreter


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    interval, thresholds, enabled = sys.getswitchinterval(), gc.get_threshold(), gc.isenabled()
    yield
    sys.setswitchinterval(interval)
    gc.unfreeze()
    gc.set_threshold(*thresholds)
    (gc.enable if enabled else gc.disable)()


def test_the_window_never_waits_for_as_long_as_python_would_let_it() -> None:
    sys.setswitchinterval(0.005)
    interpreter.shorten_switch_interval()
    assert sys.getswitchinterval() <= 0.001


def test_studio_does_so_when_it_starts() -> None:
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


def test_what_stands_is_put_aside_and_later_garbage_is_collected() -> None:
    standing = [[n] for n in range(1000)]
    gc.disable()
    interpreter.freeze_garbage()
    assert gc.isenabled()
    assert gc.get_freeze_count() > 1000
    assert gc.get_threshold()[0] == interpreter.NEW_OBJECTS
    assert not any(each is standing for each in gc.get_objects())
    circle: list[object] = []
    circle.append(circle)
    del circle
    assert gc.collect() >= 1


def test_it_settles_a_while_after_the_last_start(qtbot: object, qapp: object) -> None:
    owner = QObject()
    timer = interpreter.GcFreezeTimer(owner)
    timer.setInterval(20)
    before = gc.get_freeze_count()
    timer.start()
    with qtbot.waitSignal(timer.timeout):  # type: ignore[attr-defined]
        timer.start()
    assert gc.get_freeze_count() > before
    assert not timer.isActive()
