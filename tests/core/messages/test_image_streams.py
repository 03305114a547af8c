"""Tests of image streams: only the newest image is decoded, and only while a panel shows it.

The threadless fake that panel tests use must behave in the same way.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from app.core.messages.image_streams import ImageRateMeter, Images
from app.core.messages.picture import decode, reuse_picture
from app.core.network.watches import Watches
from nep.messages.message import Message
from tests.ui import fakes


def jpeg(colour: tuple[int, int, int], topic: str = "/camera", seq: int = 1) -> Message:
    frame = np.full((24, 32, 3), colour, np.uint8)
    data = cv2.imencode(".png", frame)[1].tobytes()
    return Message(
        topic, data, "image", "image", seq=seq, extension={"shape": [24, 32, 3], "encoding": "png"}
    )


def until(true: Callable[[], bool], seconds: float = 30) -> None:
    ended = threading.Event()
    for _ in range(int(seconds * 100)):
        if true():
            return
        ended.wait(0.01)
    raise AssertionError("waited in vain")


@pytest.fixture
def watched() -> list[str]:
    return []


@pytest.fixture(params=[Images, fakes.Images], ids=["beside", "at once"])
def kind(request: pytest.FixtureRequest) -> type[Images]:
    return request.param  # type: ignore[no-any-return]


@pytest.fixture
def images(kind: type[Images], watched: list[str]):
    images = kind(lambda topic: Watches(watched.append, watched.remove).open([topic]))
    yield images
    images.close()


def test_identical_bytes_reuse_pixels_for_new_message(images: Images) -> None:
    stream = images.stream("/camera")
    images.offer([jpeg((10, 20, 30), seq=7)])
    until(lambda: stream.picture is not None)
    first = stream.picture
    assert first is not None
    images.offer([jpeg((10, 20, 30), seq=8)])
    until(lambda: stream.picture is not None and stream.picture.seq == 8)
    assert stream.picture is not None
    assert stream.picture.bgra is first.bgra
    assert stream.picture.received_s >= first.received_s
    images.offer([jpeg((10, 20, 31), seq=9)])
    until(lambda: stream.picture is not None and stream.picture.seq == 9)
    assert stream.picture.bgra is not first.bgra


@pytest.mark.parametrize("size", [(320, 240), (33, 25), (1, 1), (17, 400)])
@pytest.mark.parametrize("fit", [None, (16, 12), (4, 3), (0, 0)])
@pytest.mark.parametrize("kind", [".jpg", ".png"])
def test_decoded_image_is_reused_only_for_identical_bytes_at_the_same_size(
    size: tuple[int, int], fit: tuple[int, int] | None, kind: str
) -> None:
    frame = np.random.default_rng(1).integers(0, 255, (size[1], size[0], 3), np.uint8)
    data = cv2.imencode(kind, frame)[1].tobytes()
    first, second = (Message("/camera", data, "image", "image", seq=n) for n in (1, 2))
    shown, error = decode(first, 1.0, fit)
    assert shown is not None, error
    again = reuse_picture(shown, second, 2.0, fit)
    assert again is not None
    assert (again.bgra is shown.bgra, again.seq, again.received_s) == (True, 2, 2.0)
    assert reuse_picture(shown, first, 2.0, fit) is None, "it is wanted in another size, and is to be decoded"
    assert reuse_picture(None, second, 2.0, fit) is None
    whole = reuse_picture(shown, second, 2.0, None)
    assert (whole is not None) == shown.is_full_resolution
    other = Message("/camera", data + b"x", "image", "image", seq=3)
    assert reuse_picture(shown, other, 3.0, fit) is None


@pytest.mark.parametrize("place", [0, 1, 5_000, 199_999])
def test_single_changed_byte_gives_a_new_image(place: int) -> None:
    shape = {"shape": [100, 2000], "encoding": "mono8"}
    first = Message("/camera", bytes(200_000), "image", "image", seq=1, extension=shape)
    shown, error = decode(first, 1.0)
    assert shown is not None, error
    data = bytearray(200_000)
    same = Message("/camera", bytes(data), "image", "image", seq=2, extension=shape)
    assert reuse_picture(shown, same, 2.0, None) is not None
    data[place] = 1
    other = Message("/camera", bytes(data), "image", "image", seq=2, extension=shape)
    assert reuse_picture(shown, other, 2.0, None) is None


def test_received_image_is_decoded_with_its_size_and_sequence_number(images: Images) -> None:
    stream = images.stream("/camera")
    images.offer([jpeg((10, 20, 30), seq=7)])
    until(lambda: stream.picture is not None)
    assert stream.picture is not None
    assert stream.picture.bgra[0, 0].tolist() == [10, 20, 30, 255]
    assert (stream.picture.width, stream.picture.height, stream.picture.seq) == (32, 24, 7)


def test_only_newest_image_of_a_batch_is_decoded(images: Images, monkeypatch) -> None:
    decoded: list[int | None] = []

    def seen(message: Message, *more: object):
        decoded.append(message.seq)
        return decode(message, *more)  # type: ignore[arg-type]

    monkeypatch.setattr("app.core.messages.image_streams.decode", seen)
    stream = images.stream("/camera")
    images.offer([jpeg((n, n, n), seq=n) for n in range(1, 50)])
    until(lambda: stream.picture is not None and stream.picture.seq == 49)
    until(lambda: stream.arriving_hz is not None)
    assert decoded == [49]


def test_stream_ignores_images_of_other_topics_and_images_after_close(
    images: Images, watched: list[str]
) -> None:
    stream = images.stream("/camera")
    assert watched == ["/camera"]
    images.offer([jpeg((1, 2, 3), "/other")])
    stream.close()
    images.offer([jpeg((1, 2, 3))])
    assert stream.picture is None
    assert watched == []


def test_undecodable_image_sets_error_and_keeps_last_image(images: Images) -> None:
    stream = images.stream("/camera")
    images.offer([jpeg((1, 2, 3))])
    until(lambda: stream.picture is not None)
    images.offer([Message("/camera", b"no picture", "image", "image")])
    until(lambda: stream.error is not None)
    assert stream.picture is not None
    images.offer([jpeg((4, 5, 6))])
    until(lambda: stream.error is None)


def test_unexpected_decoder_exception_does_not_stop_later_images(images: Images, monkeypatch) -> None:
    def strange(message: Message, *more: object):
        if message.seq == 1:
            raise KeyError("no such thing")
        return decode(message, *more)  # type: ignore[arg-type]

    monkeypatch.setattr("app.core.messages.image_streams.decode", strange)
    stream = images.stream("/camera")
    images.offer([jpeg((1, 2, 3), seq=1)])
    until(lambda: stream.error is not None)
    assert stream.error == "An image on “/camera” can't be shown: 'no such thing'"
    images.offer([jpeg((4, 5, 6), seq=2)])
    until(lambda: stream.picture is not None)
    assert stream.error is None


def test_two_panels_can_show_one_topic(images: Images) -> None:
    one, two = images.stream("/camera"), images.stream("/camera")
    images.offer([jpeg((1, 2, 3))])
    until(lambda: one.picture is not None and two.picture is not None)
    one.close()
    images.offer([jpeg((9, 9, 9), seq=2)])
    until(lambda: two.picture is not None and two.picture.seq == 2)
    assert one.picture is not None
    assert one.picture.seq == 1


def test_grey_and_colour_images_are_decoded() -> None:
    for channels, encoding in ((1, "mono8"), (3, "bgr8"), (3, "rgb8")):
        shape = [4, 6, 3] if channels == 3 else [4, 6]
        data = bytes(range(4 * 6 * channels))
        picture, error = decode(
            Message("/c", data, "image", "image", extension={"shape": shape, "encoding": encoding}), 0.0
        )
        assert error is None
        assert picture is not None
        assert picture.bgra.shape == (4, 6, 4)


def test_rate_needs_two_events_and_ignores_old_events() -> None:
    rate = ImageRateMeter()
    rate.add(0.0)
    assert rate.rate_hz(1.0) is None
    for number in range(1, 121):
        rate.add(number / 30)
    assert rate.rate_hz(3.5) == pytest.approx(30, rel=0.02)
    assert rate.rate_hz(20.0) is None


def test_displayed_rate_equals_arrival_rate_when_painting_lags() -> None:
    arriving, shown = ImageRateMeter(), ImageRateMeter()
    for number in range(90):
        arriving.add(number / 30)
        if number < 85:  # the newest images are still queued
            shown.add(number / 30)
    assert arriving.rate_hz(3.0) == shown.rate_hz(3.0)


def large(seq: int, value: int = 9) -> Message:
    frame = np.full((480, 640, 3), value, np.uint8)
    return Message(
        "/camera", frame.tobytes(), "image", "image", seq=seq,
        extension={"shape": [480, 640, 3], "encoding": "bgr8"},
    )  # fmt: skip


def test_image_is_decoded_at_display_size_and_again_when_enlarged(images: Images) -> None:
    stream = images.stream("/camera")
    stream.set_size((160, 120))
    images.offer([large(1)])
    until(lambda: stream.picture is not None)
    assert stream.picture is not None
    assert stream.picture.bgra.shape == (120, 160, 4)
    stream.set_size(None)
    until(lambda: stream.picture is not None and stream.picture.is_full_resolution)
    assert stream.picture.seq == 1
    stream.set_size((100, 80))  # the next image is smaller; the current one is kept
    assert stream.picture.is_full_resolution
    images.offer([large(2)])
    until(lambda: stream.picture is not None and stream.picture.seq == 2)
    assert not stream.picture.is_full_resolution


def test_largest_requested_size_of_two_panels_is_decoded(images: Images) -> None:
    small, whole = images.stream("/camera"), images.stream("/camera")
    small.set_size((160, 120))
    images.offer([large(1)])
    until(lambda: small.picture is not None and whole.picture is not None)
    assert small.picture is whole.picture
    assert small.picture is not None
    assert small.picture.is_full_resolution


def test_frozen_image_is_decoded_in_full_on_demand_while_arrivals_are_counted(
    images: Images,
) -> None:
    stream, other = images.stream("/camera"), images.stream("/camera")
    for each in (stream, other):
        each.set_size((160, 120))
    images.offer([large(1)])
    until(lambda: stream.picture is not None)
    stream.set_frozen(True)
    images.offer([large(2)])
    until(lambda: other.picture is not None and other.picture.seq == 2)
    assert stream.picture is not None
    assert stream.picture.seq == 1
    stream.set_size(None)
    until(lambda: stream.picture is not None and stream.picture.is_full_resolution)
    assert stream.picture.seq == 1
    until(lambda: stream.arriving_hz is not None)
    stream.set_frozen(False)
    images.offer([large(3)])
    until(lambda: stream.picture is not None and stream.picture.seq == 3)


@pytest.mark.parametrize("kind", [Images])
def test_images_are_decoded_in_decoder_thread(images: Images) -> None:
    seen: list[int] = []

    class Extension(dict[str, object]):
        def get(self, key: str, default: object = None) -> object:  # type: ignore[override]
            seen.append(threading.get_ident())
            return super().get(key, default)

    stream = images.stream("/camera")
    images.offer([Message("/camera", b"no picture at all", "image", "image", extension=Extension())])
    until(lambda: stream.error is not None)
    assert seen
    assert threading.get_ident() not in seen


def test_suspended_stream_decodes_nothing_and_keeps_its_image(images: Images, watched: list[str]) -> None:
    stream, other = images.stream("/camera"), images.stream("/camera")
    images.offer([jpeg((1, 2, 3), seq=1)])
    until(lambda: stream.picture is not None and other.picture is not None)
    assert not stream.is_awaiting_image
    stream.suspend()
    stream.suspend()
    images.offer([jpeg((1, 2, 3), seq=2)])
    until(lambda: other.picture is not None and other.picture.seq == 2)
    assert (stream.picture is not None and stream.picture.seq, stream.is_awaiting_image) == (1, True)
    other.suspend()
    assert watched == [], "nobody looks"
    stream.resume()
    assert watched == ["/camera"]
    assert stream.is_awaiting_image, "what it has may be old"
    images.offer([jpeg((1, 2, 3), seq=3)])
    until(lambda: stream.picture is not None and stream.picture.seq == 3)
    assert not stream.is_awaiting_image
    stream.close()
    stream.resume()
    assert watched == [], "a stream that was closed stays closed"


def test_resumed_stream_is_not_reported_as_silent(kind: type[Images]) -> None:
    now = [100.0]
    images = kind(lambda topic: Watches(str, str).open([topic]), lambda: now[0])
    stream = images.stream("/camera")
    images.offer([jpeg((1, 2, 3))])
    until(lambda: stream.picture is not None)
    now[0] = 104.0
    assert (stream.silent_s, stream.age_s) == (4.0, 4.0)
    stream.suspend()
    now[0] = 200.0
    stream.resume()
    now[0] = 201.0
    assert (stream.silent_s, stream.age_s) == (1.0, 101.0)
    images.close()


def test_frozen_image_of_suspended_stream_can_be_enlarged_after_resume(images: Images) -> None:
    stream = images.stream("/camera")
    stream.set_size((160, 120))
    images.offer([large(1)])
    until(lambda: stream.picture is not None)
    assert stream.picture is not None
    assert not stream.picture.is_full_resolution
    stream.set_frozen(True)
    stream.suspend()
    stream.set_size(None)
    stream.resume()
    until(lambda: stream.picture is not None and stream.picture.is_full_resolution)
    assert (stream.picture.seq, stream.is_awaiting_image) == (1, True)


def test_silence_of_an_image_stream_can_be_restarted_while_its_age_continues(images: Images) -> None:
    now = [10.0]
    images.clock = lambda: now[0]
    stream = images.stream("/camera")
    assert stream.silent_s is None
    images.offer([jpeg((10, 20, 30))])
    until(lambda: stream.picture is not None)
    now[0] += 5.0
    assert stream.silent_s == 5.0
    images.restart_silence()
    assert stream.silent_s == 0.0
    now[0] += 1.5
    assert (stream.silent_s, stream.age_s) == (1.5, 6.5)
