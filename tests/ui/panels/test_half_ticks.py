"""Test of the refresh rate of image panels: twice per tick, other panels once."""

from __future__ import annotations

from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]


def test_image_panels_are_refreshed_twice_per_tick(qtbot, window: MainWindow, commands: object) -> None:
    window.show()
    window.show_layout("developer")
    bench = window.bench
    assert bench is not None
    image, topics = bench.docks["image"], bench.docks["topics"]
    qtbot.waitUntil(lambda: image.is_displayed() and topics.is_displayed())
    image.panel.shows_video = True
    before = image.panel.refreshed, topics.panel.refreshed  # type: ignore[attr-defined]
    for _ in range(10):
        window.timer.timeout.emit()
    assert image.panel.refreshed == before[0] + 10  # type: ignore[attr-defined]
    assert topics.panel.refreshed == before[1] + 5  # type: ignore[attr-defined]
