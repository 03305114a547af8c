"""Pixel of an image that the user clicked, as a message."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

from nep.geometry import Header, Point, Time

TYPES = ("json", Point.MSG_TYPE, "geometry_msgs/PointStamped")
"""Message types for a point; "json" contains all fields."""
Button = Literal["left", "middle"]


def default_topic(pictures: str) -> str:
    """Return the default topic for points in the images of topic ``pictures``."""
    return f"{pictures.rstrip('/')}/point"


@dataclass(frozen=True, slots=True)
class PicturePoint:
    """Pixel of an image of ``width`` x ``height``, independent of zoom, rotation and mirroring.

    Attributes:
        x: Column from the left edge of the received image, from 0.
        y: Row from the top edge, from 0.
        stamp_ns: Time stamp of the image; None if its publisher sends none.
    """

    x: int
    y: int
    width: int
    height: int
    stamp_ns: int | None
    button: Button = "left"

    @property
    def relative_position(self) -> tuple[float, float]:
        """Centre of the pixel as fractions of the image's width and height."""
        return (self.x + 0.5) / max(1, self.width), (self.y + 0.5) / max(1, self.height)

    def payload(self, pictures: str, msg_type: str) -> dict[str, object]:
        """Return the message of one of `TYPES`; ``pictures`` is the topic of the image."""
        stamp = Time.from_ns(self.stamp_ns) if self.stamp_ns is not None else None
        place = asdict(Point(float(self.x), float(self.y), 0.0))
        if msg_type == Point.MSG_TYPE:
            return place
        if msg_type == "geometry_msgs/PointStamped":
            return {"header": asdict(Header(stamp or Time())), "point": place}
        return {
            "x": self.x,
            "y": self.y,
            "width": self.width,
            "height": self.height,
            "button": self.button,
            "stamp": asdict(stamp) if stamp is not None else None,
            "topic": pictures,
        }
