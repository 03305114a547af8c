"""Driver kit: everything a module needs to drive a robot (docs/robots.md has a complete example).

A robot is declared as a class; its description, blocks, forms and input checks are generated from the typed
methods. The :class:`Driver` adds cancellation, timeouts, busy policies, the heartbeat watchdog, the confirmed
stop and RIZE's dialect.

Example:
    ::

        from typing import Annotated

        from app.robots import kit


        class Table:
            @kit.action("turn by %angle °", "Movement", "rotate-ccw", uses=("motor",), risk="moves")
            def turn(self, call: kit.Call, angle: Annotated[float, kit.Range(-180, 180, unit="deg")] = 90.0):
                ...

            @kit.safe_stop(watchdog_s=0.5, within_s=0.2)
            def stop(self): ...

            def __init__(self, link: kit.Link):
                self.link = link


        if __name__ == "__main__":
            raise SystemExit(kit.main(kit.Kind("table", "Table", Table)))
"""

from __future__ import annotations

from app.clock import Clock, MonotonicClock, ThreadClock
from app.robots.driver.call import Call, Canceled, Failed, Link
from app.robots.driver.declare import Kind, action, detections, event, picture, safe_stop, sensor
from app.robots.driver.driver import Driver
from app.robots.driver.process import install_exception_hook, main
from app.robots.driver.schema import Advanced, Colour, Image, Range, Suggested, Text, Title, Words

install_exception_hook()

__all__ = [
    "Advanced", "Call", "Canceled", "Clock", "Colour", "Driver", "Failed", "Image", "Kind", "Link",
    "MonotonicClock", "Range", "Suggested", "Text", "ThreadClock", "Title", "Words", "action", "detections",
    "event", "main", "picture", "safe_stop", "sensor",
]  # fmt: skip
