"""Message about the pixel of an image that the user clicked."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

from nep.geometry import Header, Point, Time

MESSAGE_TYPES = ("json", Point.MSG_TYPE, "geometry_msgs/PointStamped")
"""Supported message types for a point. "json" contains all fields."""
Button = Literal["left", "middle"]


def default_topic(image_topic: str) -> str:
    """Return the default topic for clicked points.

    Args:
        image_topic: Topic of the images.
    """
    return f"{image_topic.rstrip('/')}/point"


@dataclass(frozen=True, slots=True)
class PicturePoint:
    """Pixel of an image of ``width`` x ``height`` pixels, independent of zoom, rotation and mirroring.

    Attributes:
        x: Column in the received image, from 0 at the left edge.
        y: Row in the received image, from 0 at the top edge.
        stamp_ns: Time stamp of the image in ns since 1970; None if the image has none.
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

    def payload(self, image_topic: str, msg_type: str) -> dict[str, object]:
        """Return the payload of the message about the point.

        Args:
            image_topic: Topic of the images.
            msg_type: One of `MESSAGE_TYPES`.
        """
        stamp = Time.from_ns(self.stamp_ns) if self.stamp_ns is not None else None
        point = asdict(Point(float(self.x), float(self.y), 0.0))
        if msg_type == Point.MSG_TYPE:
            return point
        if msg_type == "geometry_msgs/PointStamped":
            return {"header": asdict(Header(stamp or Time())), "point": point}
        return {
            "x": self.x,
            "y": self.y,
            "width": self.width,
            "height": self.height,
            "button": self.button,
            "stamp": asdict(stamp) if stamp is not None else None,
            "topic": image_topic,
        }
