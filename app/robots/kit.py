"""The driver kit: all that a module needs to drive a robot (docs/robots.md shows a whole one).

The description, the blocks, the forms and the checks come from the typed methods; cancel, time-out, busy
policy, heartbeat watchdog, proven stop and RIZE's dialect come with the :class:`Driver`.
"""

from __future__ import annotations

from app.robots.driver.call import Call, Canceled, Clock, Failed, Link, MonotonicClock
from app.robots.driver.declare import Kind, action, detections, event, picture, safe_stop, sensor
from app.robots.driver.driver import Driver
from app.robots.driver.process import main, tell_briefly
from app.robots.driver.schema import Advanced, Colour, Image, Range, Suggested, Text, Title, Words

tell_briefly()

__all__ = [
    "Advanced", "Call", "Canceled", "Clock", "Colour", "Driver", "Failed", "Image", "Kind", "Link",
    "MonotonicClock", "Range", "Suggested", "Text", "Title", "Words", "action", "detections", "event",
    "main", "picture", "safe_stop", "sensor",
]  # fmt: skip
