"""Tests of the camera of virtual robots against calculated positions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from app.robots.virtual.body import Body
from app.robots.virtual.camera import Camera, lens_of
from app.robots.virtual.lens import Lens
from app.robots.virtual.room import Room
from app.robots.virtual.vision import ObjectDetector, angles_to, message


@pytest.fixture(scope="module")
def camera() -> Camera:
    return Camera(Room())


@pytest.fixture(scope="module")
def eyes() -> ObjectDetector:
    return ObjectDetector()


def test_lens_projects_a_point_ahead_to_the_image_centre_and_a_left_point_to_the_left():
    lens = Lens((0, 0, 1), 0.0, 0.0)
    ahead, left, up = lens.to_pixels(
        lens.to_camera(np.array([[2, 0, 1], [2, 0.5, 1], [2, 0, 1.5]], dtype=float))
    )
    assert ahead == pytest.approx((160, 120))
    assert left[0] == pytest.approx(160 - lens.focal / 4)
    assert left[1] == pytest.approx(120)
    assert up[1] == pytest.approx(120 - lens.focal / 4)
    assert lens.focal == pytest.approx(160 / math.tan(math.radians(28.15)))
    down = Lens((0, 0, 1), 0.0, 30.0)
    assert down.to_pixels(down.to_camera(np.array([[2.0, 0, 1]])))[0][1] < 120


def test_shape_behind_the_camera_has_no_outline():
    lens = Lens((0, 0, 1), 0.0, 0.0)
    behind = np.array([[-1, -1, 0], [-1, 1, 0], [-1, 1, 2]], dtype=float)
    assert len(lens.outline(behind)) == 0
    across = np.array([[-1, -1, 0], [3, -1, 0], [3, 1, 0], [-1, 1, 0]], dtype=float)
    assert len(lens.outline(across)) == 4


@pytest.mark.parametrize("place", [(1.95, -0.78), (1.6, -0.5), (2.5, 0.9), (2.2, -1.2)])
def test_ball_is_detected_at_its_position(camera, eyes, place):
    body = Body(room=Room().with_moved("person", -2.0, -2.0).with_moved("ball", *place))
    lens = lens_of(body)
    (found,) = eyes.balls(camera.picture(body.room, lens))
    ball = body.room.balls[0]
    seen = lens.to_camera(np.array([[ball.x, ball.y, ball.z]]))
    expected = lens.to_pixels(seen)[0]
    assert found.centre == pytest.approx(tuple(expected), abs=2.5)
    assert found.box[2] == pytest.approx(2 * ball.radius * lens.focal / seen[0][2], abs=5)
    left, _ = angles_to(lens, found.centre)
    bearing = math.degrees(math.atan2(ball.y - lens.position[1], ball.x - lens.position[0]))
    assert left == pytest.approx(bearing, abs=1.5)


def test_ball_outside_the_view_is_not_detected(camera, eyes):
    for theta in range(0, 360, 30):
        body = Body(room=Room().with_moved("ball", -2.2, -2.2), theta_deg=float(theta) - 60)
        lens = lens_of(body)
        found = eyes.balls(camera.picture(body.room, lens))
        visible = lens.to_camera(np.array([[-2.2, -2.2, 0.15]]))[0]
        in_front = visible[2] > 0 and abs(visible[0] / visible[2]) < 0.6
        assert bool(found) <= bool(in_front), f"at {theta}"


@pytest.mark.parametrize("theta", [45.0, 60.0, 75.0])
def test_marker_is_detected(camera, eyes, theta):
    body = Body(theta_deg=theta)
    lens = lens_of(body)
    (found,) = eyes.markers(camera.picture(body.room, lens))
    card = body.room.markers[0]
    expected = lens.to_pixels(lens.to_camera(np.array([[card.x, card.y, card.z]])))[0]
    assert found.name == "marker 7"
    assert found.centre == pytest.approx(tuple(expected), abs=3)


def test_face_is_detected_at_the_skin_pixels(camera, eyes):
    body = Body()
    lens = lens_of(body)
    picture = camera.picture(body.room, lens)
    (found,) = eyes.faces(body.room, lens)
    assert found.name == "Aiko"
    assert found.confidence > 0.9
    x, y = (round(value) for value in found.centre)
    blue, green, red = (int(part) for part in picture[y, x])
    assert red > green > blue  # skin
    assert red > 180
    above = picture[found.box[1] + 3, x].astype(int)
    assert above.sum() < 250  # hair


def test_face_is_detected_only_while_visible(eyes):
    def seen(body: Body) -> bool:
        return bool(eyes.faces(body.room, lens_of(body)))

    assert seen(Body())
    assert not seen(Body(theta_deg=90.0))
    assert not seen(Body(theta_deg=180.0))
    assert not seen(Body(theta_deg=30.5))  # mostly outside the image
    hidden = Body(room=Room().with_moved("person", 0.35, -2.4), theta_deg=-75.0)
    tall = hidden.room.boxes[1]
    assert tall.height > hidden.room.people[0].face_z
    assert not seen(hidden)


def test_detection_message_has_count_name_and_image_size_and_no_name_if_empty(eyes):
    body = Body()
    told = message(eyes.faces(body.room, lens_of(body)), lens_of(body))
    assert (told["count"], told["name"], told["width"], told["height"]) == (1, "Aiko", 320, 240)
    assert set(told["items"][0]) == {"name", "confidence", "box"}
    assert message([], lens_of(body))["name"] is None


def test_equal_states_give_equal_camera_images(camera):
    body = Body()
    first = camera.picture(body.room, lens_of(body))
    again = Camera(Room()).picture(body.room, lens_of(body))
    assert first.shape == (240, 320, 3)
    assert first.dtype == np.uint8
    assert np.array_equal(first, again)
    body.turn(30, 90)
    body.step(2.0)
    assert not np.array_equal(first, camera.picture(body.room, lens_of(body)))


def test_every_pixel_is_painted_in_all_directions(camera):
    room = Room().with_moved("ball", -2.3, -2.3)
    for theta in range(0, 360, 15):
        for pitch in (-40.0, 0.0, 36.0):
            picture = camera.picture(room, Lens((-0.5, 0.3, 1.12), float(theta), pitch))
            black = (picture.sum(axis=2) == 0).sum()
            assert black == 0, f"{black} pixels at {theta}°, {pitch}°"
