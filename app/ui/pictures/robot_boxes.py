"""Which boxes belong on a picture: the detections of the robot whose camera it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.ui.pictures.boxes import Box, boxes_of

if TYPE_CHECKING:
    from app.core.robots.robot_link import RobotLink
    from app.core.session import Session
    from app.robots.description.description import Sensor


def camera_of(link: RobotLink) -> Sensor | None:
    """The robot's first camera, or None."""
    return next((sensor for sensor in link.robot.sensors if sensor.is_image and sensor.topic), None)


def owner_of(session: Session, topic: str) -> RobotLink | None:
    """The robot to which a topic's camera belongs, or None."""
    for link in session.fleet.links:
        if any(sensor.is_image and sensor.topic == topic for sensor in link.robot.sensors):
            return link
    return None


def boxes_on(link: RobotLink, topic: str) -> tuple[Box, ...]:
    """The boxes of all detections that were made in this camera's pictures; one colour for each sensor."""
    cameras = {sensor.name for sensor in link.robot.sensors if sensor.topic == topic}
    found: list[Box] = []
    detecting = [sensor for sensor in link.robot.sensors if sensor.kind == "detections"]
    for kind, sensor in enumerate(detecting):
        if sensor.camera is None or sensor.camera in cameras:
            found += boxes_of(link.values.get(sensor.name), kind)
    return tuple(found)
