"""Tests of the C# client with the test vectors that all implementations of the wire share."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import msgpack
import numpy as np
import pytest

from nep.backends.bases.loss import PublisherTracker
from nep.errors import WireError
from nep.messages import image_codec
from nep.protocol.clock_samples import ClockSamples
from nep.protocol.requests import PublisherRecord, RemotePublisher
from nep.system.computer import computer_id
from tests.clients.mono_programs import CSHARP, HAS_MONO, WITHOUT, MonoProgram, program, running
from tests.nep import bad_pictures as bad

pytestmark = pytest.mark.skipif(not HAS_MONO, reason=WITHOUT)
DATA = Path(__file__).parents[1] / "data" / "wire"
HAS_CODES = (DATA / "malformed.json").exists()  # vectors with numbers as text and errors as codes


def vectors(name: str) -> Any:
    return json.loads((DATA / f"{name}.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def wire() -> Iterator[MonoProgram]:
    with running(program("WirePeer.exe", CSHARP / "tests" / "peer" / "WirePeer.cs")) as made:
        yield made


def read(wire: MonoProgram, parts: list[str]) -> Any:
    return json.loads(wire.ask(" ".join(["message", *("." + part for part in parts)])))


def as_text(value: object) -> object:
    return str(value) if isinstance(value, int) else value


def test_messages_are_decoded_and_encoded_as_in_the_vectors(wire: MonoProgram) -> None:
    for vector in vectors("messages"):
        answer = read(wire, vector["parts"])
        if "error" in vector:
            assert "error" in answer, vector["name"]
            assert not HAS_CODES or answer["error"] == vector["error"], vector["name"]
            continue
        (message,) = answer
        means = vector["means"]
        for field in ("topic", "codec", "flags", "payload"):
            assert message[field] == means[field], vector["name"]
        for field in ("seq", "stamp_ns", "publisher"):
            assert message[field] == as_text(means[field]), vector["name"]
        whole = message["first"] + message["header"] + message["payload"]
        assert whole == "".join(vector["parts"][:3])
        if means["extension"]:
            assert msgpack.unpackb(bytes.fromhex(message["extension"])) == means["extension"]


def test_batches_are_decoded_as_in_the_vectors(wire: MonoProgram) -> None:
    for vector in vectors("batches"):
        answer = read(wire, [vector["part"]])
        if "error" in vector:
            assert not HAS_CODES or answer == {"error": vector["error"]}, vector["name"]
            assert "error" in answer
            continue
        assert len(answer) == len(vector["means"])
        for message, means in zip(answer, vector["means"], strict=True):
            assert {field: message[field] for field in means} == {
                field: value if field == "codec" else as_text(value) for field, value in means.items()
            }


def test_node_publisher_and_subscriber_ids_are_derived_from_the_node_key(wire: MonoProgram) -> None:
    for node in vectors("ids")["nodes"]:
        key = "e9" if node["key"] == "\u00e9" else node["key"]
        assert json.loads(wire.ask(f"id {key}")) == node["node_id"]
        for number, wanted in node["ids"].items():
            assert json.loads(wire.ask(f"id {key} {number}")) == wanted


def test_master_requests_and_replies_round_trip(wire: MonoProgram) -> None:
    for asked in vectors("master")["asked"]:
        for body in (asked["request"], asked["answer"]):
            again = bytes.fromhex(json.loads(wire.ask(f"pack {body}")))
            options = {"strict_map_key": False}
            assert msgpack.unpackb(again, **options) == msgpack.unpackb(bytes.fromhex(body), **options)


@pytest.mark.skipif(not HAS_CODES, reason="these vectors are not there yet")
def test_malformed_messages_are_rejected_with_the_codes_of_the_vectors(wire: MonoProgram) -> None:
    wrong = [
        (vector, answer)
        for vector in vectors("malformed")
        if (answer := read(wire, vector[1:])) != {"error": vector[0]}
    ]
    assert wrong == []


@pytest.mark.skipif(not HAS_CODES, reason="these vectors are not there yet")
def test_filters_and_notices_are_decoded_and_encoded_as_in_the_vectors(wire: MonoProgram) -> None:
    for vector in vectors("filters"):
        answer = json.loads(wire.ask(f"filter {vector['filter']}"))
        if "error" in vector:
            assert answer == {"error": vector["error"]}, vector["name"]
            continue
        means = vector["means"]
        assert {field: answer[field] for field in means if field in answer} == {
            field: means[field] for field in means if field in answer
        }
        assert answer.get("again", vector["filter"]) == vector["filter"]
    for vector in vectors("notices"):
        header = json.loads(wire.ask(f"header {vector['parts'][1]}"))
        assert header["header"] == vector["parts"][1]
        for field in ("seq", "stamp_ns", "publisher"):
            assert header[field] == vector["means"][field], vector["name"]


STEPS = (
    *(
        "listed",
        "expect",
        "arrived",
        "arrived",
        "arrived",
        "alone",
        "early",
        "reached",
        "promised",
        "promised",
    ),
    *("closing", "lapsed", "settle", "dropped", "forget"),
)


def losses_in_python(steps: list[tuple[str, int, int]]) -> list[object]:
    """Apply steps to a new subscriber's losses; return each result, then received and lost messages."""
    sources = PublisherTracker()

    def connect(id: int, history: int) -> None:
        record = PublisherRecord(id, "t", "json", "json", history=history)
        source = sources.add_listed(RemotePublisher(record, "n", "name"))
        source.is_silent, source.bye_deadline = False, None

    do: dict[str, Callable[[int, int], object]] = {
        "listed": connect,
        "expect": lambda id, _number: sources.expect_all_messages(id),
        "arrived": lambda id, number: sources.count_message(id, number, is_alone=False),
        "alone": lambda id, number: sources.count_message(id, number, is_alone=True),
        "early": lambda id, _number: sources.is_early(id),
        "reached": sources.advance_to,
        "promised": sources.expect_up_to,
        "closing": lambda id, number: sources.mark_closing(id, number, 0.0),
        "lapsed": sources.mark_silent,
        "settle": lambda id, _number: sources.count_missing(id),
        "dropped": lambda _id, number: sources.count_dropped(number),
        "forget": lambda id, _number: sources.pop(id),
    }
    results: list[object] = []
    for step, id, number in steps:
        try:
            result = do[step](id, number)
            results.append(result if isinstance(result, bool) else None)
        except WireError as error:
            results.append(error.code)
    return [*results, sources.received, sources.lost]


def test_losses_are_counted_as_in_python(wire: MonoProgram) -> None:
    chance = random.Random(34)
    for _ in range(1000):
        steps = [("expect", 1, 0), ("listed", 1, chance.choice((0, 3)))]
        for _ in range(chance.randrange(1, 25)):
            number = chance.choice((chance.randrange(1, 20), 2**33 + chance.randrange(3)))
            small = chance.randrange(1, 20)
            step = chance.choice(STEPS)
            is_leap = chance.random() < 0.05 and step in {"arrived", "reached", "promised"}
            steps.append((step, chance.randrange(1, 3), number if is_leap else small))
        asked = " ".join(":".join(map(str, each)) for each in steps)
        assert json.loads(wire.ask(f"loss {asked}")) == losses_in_python(steps), asked


def clock_in_python(steps: list[tuple[str, int, int]]) -> list[object]:
    """Apply steps to clock samples; return whether each sample was used, and each known offset."""
    wall = steady = 0
    samples = ClockSamples(lambda: wall, lambda: steady, 1e-9)
    sent = samples.now()
    results: list[object] = []
    for step, first, second in steps:
        if step == "add":
            results.append(samples.add(sent, first, second))
        elif step == "forget":
            samples.clear()
        else:
            wall, steady = first, second
            sent = samples.now() if step == "now" else sent
        offset = samples.offset()
        results.append("" if offset is None else f"{offset[0]} {offset[1]}")
    return results


def test_clocks_are_compared_as_in_python(wire: MonoProgram) -> None:
    chance = random.Random(27)
    for _ in range(300):
        wall, steady, ahead = 10**18, 0, chance.choice((0, 5 * 10**9, -(10**17), 2**62))
        steps: list[tuple[str, int, int]] = [("now", wall, steady)]
        for _ in range(chance.randrange(1, 20)):
            for step in ("now", "later"):
                passed, slew = chance.choice((10**3, 10**6, 10**9)), chance.choice((0, 0, 7, 10**9))
                wall, steady = wall + passed + slew, steady + passed
                steps.append((step, wall, steady))
            master = wall + ahead - chance.randrange(10**6)
            steps.append(("add", master, master + chance.choice((0, 10**3, -5, 10**9))))
            ahead += chance.choice((0, 0, 0, 10**8))
            if chance.random() < 0.05:
                steps.append(("forget", 0, 0))
        asked = " ".join(":".join(map(str, each)) for each in steps)
        assert json.loads(wire.ask(f"clock {asked}")) == clock_in_python(steps), asked


def test_computer_id_is_the_same_as_in_python(wire: MonoProgram) -> None:
    assert json.loads(wire.ask("computer")) == computer_id()


@pytest.mark.parametrize("order", [">", "<"])
def test_image_shapes_match_those_of_python(wire: MonoProgram, order: str) -> None:
    picture = np.zeros((3, 5, 3), np.uint8)
    jpeg, png = (cv2.imencode(f".{kind}", picture)[1].tobytes() for kind in ("jpeg", "png"))
    for orientation in range(10):
        told = bad.exif(orientation, order)
        turned_jpeg = jpeg[:2] + bad.segment(0xE1, told) + jpeg[2:]
        turned_png = png[:33] + bad.chunk(b"eXIf", told[6:]) + png[33:]
        for file in (turned_jpeg, turned_png):
            assert json.loads(wire.ask(f"image {file.hex()}")) == image_codec.image_info(file)
    for end in range(20, len(turned_jpeg), 7):
        cut = json.loads(wire.ask(f"image {turned_jpeg[:end].hex()}"))
        assert "error" in cut or cut["encoding"] == "jpeg"
        assert json.loads(wire.ask(f"image {turned_png[:end].ljust(26).hex()}"))["encoding"] == "png"
