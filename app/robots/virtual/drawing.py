"""The body and its room as Studio draws them: the message of the topic ``state``."""

from __future__ import annotations

from app.robots.virtual.body import Body
from app.robots.virtual.room import Room


def drawable(body: Body) -> dict[str, object]:
    """Metres and degrees; head pitch positive is down, arms 0 hang and 180 point up."""
    return {
        "x": round(body.x, 3),
        "y": round(body.y, 3),
        "theta_deg": round(body.theta_deg, 1),
        "head_yaw_deg": round(body.head_yaw.angle, 1),
        "head_pitch_deg": round(body.head_pitch.angle, 1),
        "speech": body.speech,
        "eyes": body.eyes,
        "shoulders": body.shoulders,
        "emotion": body.emotion,
        **{f"arm_{side}_deg": round(joint.angle, 1) for side, joint in body.arms.items()},
        **{f"elbow_{side}_deg": round(joint.angle, 1) for side, joint in body.elbows.items()},
        "moving": not body.still,
        "touched": sorted(body.touched),
        **surroundings(body.room),
    }


def surroundings(room: Room) -> dict[str, object]:
    """The room and what is in it."""
    return {
        "objects": _objects(room),
        "room": {
            "x_min": room.x_min,
            "x_max": room.x_max,
            "y_min": room.y_min,
            "y_max": room.y_max,
            "height": room.height,
            "openings": [vars(opening) for opening in room.openings],
        },
    }


def _objects(room: Room) -> list[dict[str, object]]:
    ball, person, card = room.ball, room.person, room.marker
    return [
        {"kind": "ball", "z": ball.z, **vars(ball)},
        {"kind": "person", "face_z": person.face_z, **vars(person)},
        {"kind": "marker", "name": card.name, **vars(card)},
        *({**vars(box), "name": box.kind} for box in room.boxes),
    ]
