"""Tests of panels and layouts that are restored after a restart."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)


def panels(studio: Studio) -> dict[str, tuple[int, ...]]:
    """Return the position and size of each panel in the window by name; of floating panels, only the size.

    Without a window manager Qt moves windows down a little at each start.
    """
    seen = studio.look()
    left, top, _, _ = next(each["rect"] for each in seen if each["kind"] == "MainWindow")
    found = {}
    for each in seen:
        x, y, width, high = each["rect"]
        if each["kind"] == "Dock" and width > 0:
            name = each["object"].removeprefix("panel.")
            found[name] = (width, high) if each["window"] else (x - left, y - top, width, high)
    return found


def settled(studio: Studio, true: Callable[[dict[str, tuple[int, ...]]], bool]) -> dict[str, tuple[int, ...]]:
    """Wait until the panels fulfil the condition and no longer move; return them."""
    before: list[dict[str, tuple[int, ...]]] = []

    def still() -> bool:
        before.append(panels(studio))
        return len(before) > 2 and before[-1] == before[-3] and true(before[-1])

    until(still, lambda: f"the panels stand still: {before[-1]}")
    return before[-1]


def close(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Return whether two rectangles are equal within 2 pixels, the rounding of a splitter."""
    return len(one) == len(other) and all(abs(a - b) <= 2 for a, b in zip(one, other, strict=True))


def test_panels_are_restored_after_a_restart(start: Callable[..., Studio]) -> None:
    studio = start()
    studio.click("Open the Developer layout")
    first = settled(studio, lambda now: set(now) == {"topics", "inspector", "image", "console"})

    studio.click("Options of Inspector")
    studio.pick("Close")
    wide = settled(studio, lambda now: set(now) == {"topics", "image", "console"})["topics"]
    window = studio.find(kind="MainWindow")["rect"]
    edge, high = window[0] + wide[0] + wide[2] + 3, window[1] + wide[1] + 300
    studio.screen.move(edge, high)
    studio.screen.press()
    studio.screen.glide(edge - 150, high)
    until(lambda: panels(studio)["topics"][2] < wide[2] - 140, "the panel follows the mouse")
    studio.screen.release()
    studio.click("Options of Image")
    studio.pick("Float")
    left = settled(studio, lambda now: len(now["image"]) == 2)
    assert studio.quit() == 0

    again = start()  # restores the last layout
    settled(again, lambda now: set(now) == set(left) and all(close(now[name], left[name]) for name in left))
    again.choose("View", "Reset panels")
    settled(
        again, lambda now: set(now) == set(first) and all(close(now[name], first[name]) for name in first)
    )


def test_inspected_topic_of_the_developer_layout_is_restored_after_a_restart(
    start: Callable[..., Studio],
) -> None:
    studio = start()
    studio.click("Use the virtual robot")
    studio.says("Pepper ready")
    studio.click("Developer")
    studio.click_row("Topics", "/Pepper/pose")
    until(lambda: "theta" in studio.values("Newest message"), "the inspector shows it")
    assert studio.quit() == 0
    again = start()
    again.click("Use the virtual robot")
    again.says("Pepper ready")
    again.click("Developer")
    until(lambda: "theta" in again.values("Newest message"), "the inspector shows it again")
