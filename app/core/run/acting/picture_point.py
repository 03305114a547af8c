"""A pixel of a picture that a person clicked, as a message."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

from nep.geometry import Header, Point, Time

TYPES = ("json", Point.MSG_TYPE, "geometry_msgs/PointStamped")
"""Types that a point may be sent as; "json" has all that is known of it."""
Button = Literal["left", "middle"]


def topic_of(pictures: str) -> str:
    """Where points in the pictures of a topic are sent, unless a person says otherwise."""
    return f"{pictures.rstrip('/')}/point"


@dataclass(frozen=True, slots=True)
class PicturePoint:
    """A pixel of a picture of ``width`` x ``height``, however it was zoomed, turned and flipped.

    ``x`` counts from the left and ``y`` from the top edge of the picture as it was received, from 0;
    ``stamp_ns`` is the picture's own time, None where its publisher tells none.
    """

    x: int
    y: int
    width: int
    height: int
    stamp_ns: int | None
    button: Button = "left"

    @property
    def share(self) -> tuple[float, float]:
        """Where the middle of the pixel is, as shares of the picture's width and height."""
        return (self.x + 0.5) / max(1, self.width), (self.y + 0.5) / max(1, self.height)

    def payload(self, pictures: str, msg_type: str) -> dict[str, object]:
        """The message of one of `TYPES`; ``pictures`` is the topic that the picture came from."""
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
