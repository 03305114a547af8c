"""Tests of the placement of an image in a view: zoom, pan, rotation and flip."""

from __future__ import annotations

import itertools

import pytest
from PySide6.QtCore import QPointF, QRectF, QSizeF

from app.ui.pictures.placement import MAX_ZOOM, PicturePlacement

VIEW, PICTURE = QSizeF(400, 300), QSizeF(800, 400)


def place_of(place: PicturePlacement, at: QPointF) -> tuple[float, float]:
    found = place.to_picture(at, place.area(VIEW, PICTURE))
    return round(found.x(), 6), round(found.y(), 6)


def test_image_is_fitted_and_centred_by_default_and_may_fill_the_view() -> None:
    place = PicturePlacement()
    assert place.area(VIEW, PICTURE) == QRectF(0, 50, 400, 200)
    # filling would crop too much
    assert place.area(VIEW, PICTURE, fills_view=True) == QRectF(0, 50, 400, 200)
    assert place.area(VIEW, QSizeF(640, 420), fills_view=True).height() == 300
    place.rotate(90)
    assert place.area(VIEW, PICTURE) == QRectF(125, 0, 150, 300)


@pytest.mark.parametrize("turned", [0, 90, 180, 270])
@pytest.mark.parametrize(("across", "down"), list(itertools.product([False, True], repeat=2)))
def test_zoom_keeps_the_point_under_the_mouse_in_every_orientation(turned, across, down) -> None:
    place = PicturePlacement()
    place.rotate(turned)
    for wanted, flip in ((across, True), (down, False)):
        if wanted:
            place.flip(is_horizontal=flip)
    area = place.area(VIEW, PICTURE)
    at = QPointF(area.x() + area.width() * 0.3, area.y() + area.height() * 0.6)
    before = place_of(place, at)
    place.zoom_at(7.0, at, VIEW, PICTURE)
    assert place_of(place, at) == pytest.approx(before, abs=1e-5)
    place.zoom_at(1 / 1.2, at, VIEW, PICTURE)
    assert place_of(place, at) == pytest.approx(before, abs=1e-5)


def test_panning_moves_the_image_with_the_mouse_up_to_its_edge() -> None:
    place = PicturePlacement()
    place.set_zoom(2.0)
    before = place_of(place, QPointF(100, 100))
    place.move(50, -20, VIEW, PICTURE)
    assert place_of(place, QPointF(150, 80)) == pytest.approx(before)
    place.move(1e6, 1e6, VIEW, PICTURE)
    assert place.area(VIEW, PICTURE).topLeft() == QPointF(0, 0)
    place.move(-10, -10, VIEW, PICTURE)  # immediately: the movement beyond the edge isn't accumulated
    assert place.area(VIEW, PICTURE).topLeft() == QPointF(-10, -10)


def test_image_that_fits_cannot_be_panned() -> None:
    place = PicturePlacement()
    place.move(30, 30, VIEW, PICTURE)
    assert place.area(VIEW, PICTURE) == QRectF(0, 50, 400, 200)


def test_zoom_has_limits() -> None:
    place = PicturePlacement()
    middle = QPointF(200, 150)
    place.zoom_at(1e9, middle, VIEW, PICTURE)
    assert place.zoom == MAX_ZOOM
    place.zoom_at(1e-9, middle, VIEW, PICTURE)
    assert place.zoom is not None
    assert 0 < place.zoom <= 0.02


@pytest.mark.parametrize("turns", range(1, 4))
def test_flipped_image_rotates_in_the_same_direction(turns: int) -> None:
    upright, flipped = PicturePlacement(), PicturePlacement()
    flipped.flip(is_horizontal=True)
    corner = QPointF(0, 0)
    for place in (upright, flipped):
        place.rotate(90 * turns)
    # a rotation to the right moves the upper left corner to the upper right
    seen = [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)][turns - 1]
    mapped = upright.orientation().map(corner)
    assert (round(mapped.x(), 6), round(mapped.y(), 6)) == seen
    mapped = flipped.orientation().map(QPointF(1, 0))  # flipped: shown at the upper left
    assert (round(mapped.x(), 6), round(mapped.y(), 6)) == seen


def test_four_quarter_turns_and_two_flips_are_the_identity() -> None:
    place = PicturePlacement()
    place.set_zoom(2.0)
    place.move(40, 30, VIEW, PICTURE)
    before = place.to_json()
    for _ in range(4):
        place.rotate(90)
    place.rotate(180)
    place.rotate(-180)
    for across in (True, False, True, False):
        place.flip(is_horizontal=across)
    after = place.to_json()
    assert after.pop("centre") == pytest.approx(before.pop("centre"))
    assert after == before


def test_placement_is_restored_with_the_layout_and_invalid_state_is_ignored() -> None:
    place = PicturePlacement()
    place.zoom_at(4.0, QPointF(10, 90), VIEW, PICTURE)
    place.rotate(270)
    place.flip(is_horizontal=False)
    again = PicturePlacement()
    again.restore(place.to_json())
    assert again == place
    for broken in (None, [], {"zoom": True, "turned": 45, "centre": "x"}, {"zoom": -1, "centre": [1]}):
        fresh = PicturePlacement()
        fresh.restore(broken)
        assert fresh == PicturePlacement()
