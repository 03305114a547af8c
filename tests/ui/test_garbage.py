"""Collections of garbage: what stands is put aside, and what comes later is still collected."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from PySide6.QtCore import QObject

from app.ui.startup import garbage


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    thresholds, enabled = gc.get_threshold(), gc.isenabled()
    yield
    gc.unfreeze()
    gc.set_threshold(*thresholds)
    (gc.enable if enabled else gc.disable)()


def test_what_stands_is_put_aside_and_later_garbage_is_collected() -> None:
    standing = [[n] for n in range(1000)]
    gc.disable()
    garbage.settle()
    assert gc.isenabled()
    assert gc.get_freeze_count() > 1000
    assert gc.get_threshold()[0] == garbage.NEW_OBJECTS
    assert not any(each is standing for each in gc.get_objects())
    circle: list[object] = []
    circle.append(circle)
    del circle
    assert gc.collect() >= 1


def test_it_settles_a_while_after_the_last_start(qtbot: object, qapp: object) -> None:
    owner = QObject()
    settling = garbage.Settling(owner)
    settling.setInterval(20)
    before = gc.get_freeze_count()
    settling.start()
    with qtbot.waitSignal(settling.timeout):  # type: ignore[attr-defined]
        settling.start()
    assert gc.get_freeze_count() > before
    assert not settling.isActive()
