"""Tests of images between native programs and published packages, in both formats of the original NEP."""

from __future__ import annotations

import pytest

pytestmark = [pytest.mark.ports, pytest.mark.interop, pytest.mark.timeout(300)]

PEERS = (
    ("native", "image"),
    ("0.5.3.5", "image"),
    ("0.5.4.5", "image"),
    ("0.5.4.5", "images"),
    ("0.5.4.8", "images"),
)
SHAPE = [48, 64, 3]
NEAR = 3
"""Tolerance for the value of an even colour after JPEG compression."""


def picture(publisher):
    """Return the colour of a publisher, distinct from others even after JPEG compression."""
    return [40 * publisher + 20, 220 - 40 * publisher, 128]


def saw(subscriber, colour):
    return any(
        got["shape"] == SHAPE
        and all(abs(is_ - was) <= NEAR for is_, was in zip(got["bgr"], colour, strict=True))
        for got in subscriber.got
    )


def test_images_are_exchanged_in_every_direction(peers, master):
    subscribers = [peers.start(kind, "subscriber", "camera", form) for kind, form in PEERS]
    publishers = [peers.start(kind, "publisher", "camera", form) for kind, form in PEERS]
    for program in (*subscribers, *publishers):
        program.wait_ready()
    for number, publisher in enumerate(publishers):
        colour = picture(number)
        for _ in range(60):
            publisher.tell({"bgr": colour, "shape": SHAPE})
            publisher.settle(0.2)
            if all(saw(each, colour) for each in subscribers):
                break
        missing = [PEERS[at] for at, each in enumerate(subscribers) if not saw(each, colour)]
        printed = [each.printed[-300:] for each in (publisher, *subscribers, master)]
        assert not missing, f"{PEERS[number]} is not seen by {missing}: {printed}"
    assert "Traceback" not in master.printed
