"""Tests of the distribution of extra window space to docks."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.ui.shell.commands.commands import Commands
from app.ui.shell.docking.sizes import distribute
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


@pytest.mark.parametrize(
    ("wanted", "room", "keep", "sizes"),
    [
        ([120, 384], 1424, [False, True], [1040, 384]),
        ([327, 275, 140], 742, [False, False, True], [327, 275, 140]),
        ([327, 275, 140], 1042, [False, False, True], [490, 412, 140]),
        ([380, 394], 480, [False, True], [236, 244]),
        ([120, 384], 300, [False, True], [120, 229]),
    ],
)
def test_extra_space_is_distributed_to_panels_without_fixed_size(
    wanted: list[int], room: int, keep: list[bool], sizes: list[int]
) -> None:
    assert distribute(wanted, room, fixed_flags=keep) == sizes


def widths(window: MainWindow, *names: str) -> list[int]:
    bench = window.bench
    assert bench is not None
    return [bench.docks[name].width() for name in names]


def test_side_columns_are_fixed_in_the_behaviour_and_grow_in_the_developer_layout(
    qtbot, window: MainWindow, commands: Commands
) -> None:
    window.show()
    commands.run("layout.behaviour")
    for size in ((1440, 900), (1920, 1080), (1100, 700), (1440, 900)):
        window.resize(*size)
        qtbot.waitUntil(lambda: abs(widths(window, "robot")[0] - 384) <= 1)
    assert window.bench is not None
    docks = window.bench.docks
    qtbot.waitUntil(lambda: abs(docks["sensors"].height() - 140) <= 1)
    qtbot.waitUntil(lambda: abs(docks["problems"].height() - 124) <= 1)
    commands.run("layout.developer")
    names = ("topics", "inspector")
    for size, wanted in (((1440, 900), (640, 330)), ((1920, 1080), (815, 417))):
        window.resize(*size)  # a large window has more room for topic names and messages
        qtbot.waitUntil(
            lambda wanted=wanted: all(
                abs(a - b) <= 4 for a, b in zip(widths(window, *names), wanted, strict=True)
            )
        )


def test_splitter_moved_by_the_user_keeps_its_position(qtbot, window: MainWindow, commands: Commands) -> None:
    window.show()
    commands.run("layout.behaviour")
    bench = window.bench
    assert bench is not None
    qtbot.waitUntil(lambda: abs(bench.docks["robot"].width() - 384) <= 1)
    line = QPoint(bench.docks["robot"].x() - 4, 300)
    assert bench.isSeparator(line)
    QTest.mousePress(bench, Qt.MouseButton.LeftButton, pos=line)
    QTest.mouseMove(bench, line - QPoint(100, 0))
    QTest.qWait(30)  # Qt moves the line when control returns to the event loop
    QTest.mouseRelease(bench, Qt.MouseButton.LeftButton, pos=line - QPoint(100, 0))
    qtbot.waitUntil(lambda: bench.docks["robot"].width() > 450)
    window.resize(1460, 900)
    QTest.qWait(20)
    assert bench.docks["robot"].width() > 450
    commands.run("layout.reset")
    qtbot.waitUntil(lambda: abs(bench.docks["robot"].width() - 384) <= 1)
