"""Virtual robots as a person lives with them: they come back, share a room, are moved and spoken to."""

from __future__ import annotations

import json
from collections.abc import Callable

import pytest

from tests.e2e.studio import Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(240)


def test_the_robots_of_the_last_start_come_back_until_they_are_put_away(start: Callable[..., Studio]) -> None:
    studio = start()
    studio.click("Use the virtual robot")
    studio.says("Pepper ready", 40)
    assert studio.quit() == 0

    again = start()
    again.says("Pepper ready", 40)
    again.kill()

    third = start()
    third.says("Pepper ready", 40)
    third.choose("Robots", "Put the virtual robots away")
    until(lambda: not third.children("app.robots.simulated"), "its program has ended")
    assert third.quit() == 0

    assert json.loads((third.home / "settings.json").read_text())["virtual_robots"] == {}
