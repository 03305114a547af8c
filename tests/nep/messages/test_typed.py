"""Tests of typed messages: valid payloads, rejected ones with the path of the mismatch, and nep.geometry."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from datetime import date, datetime, time, timedelta, timezone
from enum import Enum, IntEnum, IntFlag
from typing import Annotated, Any, ClassVar, Literal, NewType, Optional, TypedDict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nep
import nep.geometry
import nep.sensor
from nep.geometry import Header, Point, Pose, PoseStamped, Quaternion, Time, Twist, Vector3
from nep.messages.codecs import CODECS, JSON
from nep.messages.message import Message
from nep.messages.typed import TypedReader, message_type, typed_codec
from tests.examples import examples
from tests.nep.programs import running


class Colour(Enum):
    RED = "red"
    ONE = 1


class Level(IntEnum):
    LOW = 1
    HIGH = 2


class Rights(IntFlag):
    READ = 1
    WRITE = 2


Metres = NewType("Metres", float)


@dataclass
class Part:
    number: int = 0
    word: str = "x"


class Loose(TypedDict, total=False):
    a: int


class Strict(Loose):
    b: str


@dataclass(frozen=True)
class Everything:
    MSG_TYPE: ClassVar[str] = "test/everything"

    f: float
    i: int
    s: str
    b: bool
    floats: list[float]
    parts: tuple[Part, ...]
    pair: tuple[int, str]
    by_name: dict[str, Part]
    maybe: Part | None
    old_maybe: Optional[int]  # noqa: UP045 - that is what it tests
    either: int | str
    word: Literal["a", "b", 1, None]  # noqa: PYI061 - that is what it tests
    colour: Colour
    level: Level
    rights: Rights
    at: datetime
    day: date
    clock: time
    marked: Annotated[Metres, "m"]
    strict: Strict
    anything: Any
    nothing: None
    sequence: Sequence[bool]
    bare: list  # type: ignore[type-arg]


@dataclass
class Reading:
    value: float | None = 1.0


@dataclass
class Number:
    value: float | int | str | list[int] | Part | bool | None = None


@dataclass
class Share:
    of_one: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.of_one <= 1.0:
            raise ValueError("it is not from 0 to 1")


@dataclass
class Shares:
    shares: list[Share]


@dataclass
class Tree:
    children: list[Tree] = field(default_factory=list)
    parent: Tree | None = None


def sent(payload: object) -> Any:
    """Return the JSON value that a typed publisher sends."""
    return json.loads(bytes(typed_codec(message_type(type(payload)), JSON).encode(payload).data))


def read(declared: type, plain: object, codec: str = "json") -> Any:
    """Return the instance that a typed subscriber decodes."""
    return read_bytes(declared, CODECS[codec].encode(plain).data, codec)


def read_bytes(declared: type, data: bytes | memoryview, codec: str = "json") -> Any:
    return TypedReader(message_type(declared)).convert(Message("t", data, codec, codec)).payload


def refused(declared: type, plain: object) -> str:
    with pytest.raises(nep.DecodeError) as caught:
        read(declared, plain)
    return caught.value.reason


def unsent(payload: object, declared: type | None = None) -> tuple[str, str]:
    codec = typed_codec(message_type(declared or type(payload)), JSON)
    with pytest.raises(nep.EncodeError) as caught:
        codec.encode(payload)
    return caught.value.reason, caught.value.place


# ---- round trips

_words = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
_whole = st.integers(-(1 << 63), (1 << 64) - 1)
_numbers = st.floats(allow_nan=False, allow_infinity=False)
_parts = st.builds(Part, _whole, _words)
_zones = st.one_of(st.none(), st.integers(-23, 23).map(lambda hours: timezone(timedelta(hours=hours))))
_everything = st.builds(
    Everything,
    _numbers, _whole, _words, st.booleans(),
    st.lists(_numbers, max_size=4),
    st.lists(_parts, max_size=3).map(tuple),
    st.tuples(_whole, _words),
    st.dictionaries(_words, _parts, max_size=3),
    st.one_of(st.none(), _parts),
    st.one_of(st.none(), _whole),
    st.one_of(_whole, _words),
    st.sampled_from(["a", "b", 1, None]),
    st.sampled_from(list(Colour)), st.sampled_from(list(Level)), st.integers(0, 3).map(Rights),
    st.datetimes(timezones=_zones), st.dates(), st.times(),
    _numbers.map(Metres),
    st.one_of(
        st.fixed_dictionaries({"b": _words}), st.fixed_dictionaries({"a": _whole, "b": _words})
    ),
    st.recursive(st.one_of(st.none(), st.booleans(), _words), lambda each: st.lists(each, max_size=3)),
    st.none(),
    st.lists(st.booleans(), max_size=3),
    st.lists(_words, max_size=3),
)  # fmt: skip


@given(_everything)
@settings(max_examples=examples(150), deadline=None)
def test_typed_message_round_trip_preserves_values_and_types(payload: Everything) -> None:
    encoded = typed_codec(message_type(Everything), JSON).encode(payload)
    came = read_bytes(Everything, encoded.data)
    assert came == payload
    assert [type(getattr(came, each.name)) for each in fields(came)] == [
        type(getattr(payload, each.name)) for each in fields(payload)
    ]


@given(st.recursive(
    st.one_of(st.none(), st.booleans(), _whole, st.floats(), _words),
    lambda each: st.one_of(
        st.lists(each, max_size=4),
        st.dictionaries(st.sampled_from([each.name for each in fields(Everything)]), each, max_size=12),
    ),
))  # fmt: skip
@settings(max_examples=examples(300), deadline=None)
def test_arbitrary_payload_becomes_an_instance_or_raises_decode_error(plain: object) -> None:
    for declared in (Everything, PoseStamped, Part, Tree):
        try:
            assert isinstance(read(declared, plain), declared)
        except nep.DecodeError:
            continue


@pytest.mark.parametrize("codec", ["json", "msgpack"])
def test_payload_of_another_program_is_converted_to_the_declared_type(codec: str) -> None:
    plain = {"position": {"x": 1, "y": 2.5}, "later": [1], "orientation": {"w": 0, "v": 1}}
    assert read(Pose, plain, codec) == Pose(Point(1.0, 2.5, 0.0), Quaternion(0.0, 0.0, 0.0, 0.0))


def test_typed_message_is_encoded_with_its_field_names() -> None:
    assert sent(Twist(Vector3(1), Vector3(z=2))) == {
        "linear": {"x": 1.0, "y": 0.0, "z": 0.0},
        "angular": {"x": 0.0, "y": 0.0, "z": 2.0},
    }


def test_numpy_numbers_and_arrays_in_typed_messages_are_encoded() -> None:
    state = nep.sensor.JointState(position=np.arange(3), velocity=np.ones(2, "float32"), name=("a", "b"))
    assert (sent(state)["position"], sent(state)["velocity"]) == ([0.0, 1.0, 2.0], [1.0, 1.0])
    assert sent(Part(np.int64(3))) == {"number": 3, "word": "x"}
    assert sent(Vector3(np.float32(0.5), np.array(2.0), np.int8(1))) == {"x": 0.5, "y": 2.0, "z": 1.0}


def test_payloads_decoded_from_one_message_do_not_share_lists() -> None:
    message = Message("t", b'{"position":[1.0]}', "json", "json")
    reader = TypedReader(message_type(nep.sensor.JointState))
    first, second = reader.convert(message).payload, reader.convert(message).payload
    first.position.append(2.0)
    assert second.position == [1.0]
    assert message.payload == {"position": [1.0]}


def test_nan_in_float_fields_is_sent_as_null_and_null_is_decoded_as_nan() -> None:
    assert math.isnan(read(Vector3, {"x": None}).x)
    assert sent(Vector3(math.nan, math.inf)) == {"x": None, "y": None, "z": 0.0}
    assert read_bytes(Vector3, b'{"x": NaN, "y": -Infinity}').y == -math.inf


def test_null_is_decoded_as_none_in_optional_float_fields() -> None:
    assert read(Reading, {"value": None}).value is None
    assert read(Reading, {}).value == 1.0


def test_iso_8601_texts_and_msgpack_timestamps_are_decoded_as_datetimes() -> None:
    @dataclass
    class Seen:
        at: datetime

    assert read(Seen, {"at": "2026-01-31T12:00:00.500Z"}).at.utcoffset() == timedelta(0)
    moment = datetime(2026, 1, 31, tzinfo=timezone.utc)
    assert read(Seen, {"at": moment}, "msgpack").at == moment
    assert refused(Seen, {"at": "noon"}).startswith("at is 'noon'; expected a string such as '2026")


def test_recursive_type_round_trips_and_rejects_cycles() -> None:
    tree = Tree([Tree(), Tree([Tree()])])
    assert read(Tree, sent(tree)) == tree
    tree.parent = tree
    assert unsent(tree) == ("the value contains itself, or has too many levels", "")
    deep = b'{"children":[' * 500 + b"]}" * 500
    with pytest.raises(nep.DecodeError):
        read_bytes(Tree, deep * 4)


def test_private_fields_are_not_encoded_and_init_false_fields_are_not_decoded() -> None:
    @dataclass
    class Square:
        side: float
        area: float = field(init=False)
        _cache: object = None

        def __post_init__(self) -> None:
            self.area = self.side**2

    square = Square(2.0)
    square._cache = object()
    assert sent(square) == {"side": 2.0, "area": 4.0}
    assert read(Square, {"side": 3, "area": 1, "_cache": 1}) == Square(3.0)


# ---- conversion errors and their paths


@pytest.mark.parametrize(
    ("declared", "plain", "reason"),
    [
        (PoseStamped, {"pose": {"position": {"x": "1"}}}, "pose.position.x is a 'str'; expected a 'float'"),
        (PoseStamped, {"pose": {"position": [1]}},
         "pose.position is a 'list'; expected a map of the fields of 'Point'"),
        (Pose, [], "the value is a 'list'; expected a map of the fields of 'Pose'"),
        (Pose, None, "the value is a 'NoneType'; expected a map of the fields of 'Pose'"),
        (Vector3, {"x": True}, "x is a 'bool'; expected a 'float'"),
        (Part, {"number": 1.0}, "number is a 'float'; expected a 'int'"),
        (Part, {"number": True}, "number is a 'bool'; expected a 'int'"),
        (Part, {"word": None}, "word is a 'NoneType'; expected a 'str'"),
        (Tree, {"children": [{}, {"children": [{}, 3]}]},
         "children[1].children[1] is a 'int'; expected a map of the fields of 'Tree'"),
        (nep.sensor.JointState, {"name": ["a", 1]}, "name[1] is a 'int'; expected a 'str'"),
        (nep.sensor.JointState, {"name": "ab"}, "name is a 'str'; expected a 'list'"),
        (nep.sensor.JointState, {"position": [1, 2.0, False]}, "position[2] is a 'bool'; expected a 'float'"),
        (Strict, {"a": 1}, "b is missing; expected a 'str'"),
        (Strict, {"b": "", "a": None}, "a is a 'NoneType'; expected a 'int'"),
    ],
)  # fmt: skip
def test_mismatched_payload_is_rejected_with_its_path(declared: type, plain: object, reason: str) -> None:
    assert refused(declared, plain) == reason


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("pair", [1], "pair has 1 values; expected 2 values"),
        ("pair", [1, 2], "pair[1] is a 'int'; expected a 'str'"),
        ("by_name", {"k": {"number": ""}}, "by_name.k.number is a 'str'; expected a 'int'"),
        ("maybe", {"number": ""}, "maybe.number is a 'str'; expected a 'int'"),
        ("maybe", 3, "maybe is a 'int'; expected a 'Part' or None"),
        ("either", 1.5, "either is a 'float'; expected a 'int' or a 'str'"),
        ("word", "c", "word is 'c'; expected 'a', 'b', 1 or None"),
        ("word", True, "word is True; expected 'a', 'b', 1 or None"),
        ("word", 1.0, "word is 1.0; expected 'a', 'b', 1 or None"),
        ("colour", "blue", "colour is 'blue'; expected 'red' or 1"),
        ("colour", True, "colour is True; expected 'red' or 1"),
        ("colour", [], "colour is []; expected 'red' or 1"),
        ("rights", -1.5, "rights is -1.5; expected a 'Rights'"),
        ("day", "2026-02-30", "day is '2026-02-30'; expected a string such as '2026-01-31'"),
        ("nothing", 0, "nothing is a 'int'; expected None"),
        ("strict", {}, "strict.b is missing; expected a 'str'"),
    ],
)
def test_mismatched_or_missing_field_is_rejected_by_name(name: str, value: object, reason: str) -> None:
    good = _good()
    assert isinstance(read(Everything, good), Everything)
    assert refused(Everything, {**good, name: value}) == reason
    del good[name]
    assert refused(Everything, good).startswith(f"{name} is missing; expected ")


def _good() -> dict[str, Any]:
    return {
        "f": 1, "i": 1, "s": "", "b": False, "floats": [], "parts": [], "pair": [1, ""], "by_name": {},
        "maybe": None, "old_maybe": None, "either": 1, "word": None, "colour": 1, "level": 2, "rights": 3,
        "at": "2026-01-31T12:00:00+00:00", "day": "2026-01-31", "clock": "12:00:00", "marked": 0,
        "strict": {"b": ""}, "anything": {}, "nothing": None, "sequence": [], "bare": [1, "a"],
    }  # fmt: skip


def test_error_in_post_init_is_reported_as_decode_error_with_its_path() -> None:
    assert refused(Shares, {"shares": [{"of_one": 0}, {"of_one": 2}]}) == (
        "shares[1] was rejected by 'Share': it is not from 0 to 1"
    )


@pytest.mark.parametrize(
    ("payload", "reason", "place"),
    [
        (
            PoseStamped(pose=Pose(Point("1"))),
            "pose.position.x is a 'str'; expected a 'float'",
            "pose.position.x",
        ),
        (PoseStamped(header=Header(Time(1.5))), "header.stamp.sec is a 'float'; expected a 'int'",
         "header.stamp.sec"),
        (Pose(position=Vector3()), "position is a 'Vector3'; expected a 'Point'", "position"),
        (Pose(position={"x": 1}), "position is a 'dict'; expected a 'Point'", "position"),
        (Part(1 << 64), "number doesn't fit into 64 bits; expected a 'int'", "number"),
        (Part(-(1 << 63) - 1), "number doesn't fit into 64 bits; expected a 'int'", "number"),
        (Part(word="\ud800"), "word contains an unpaired surrogate; use valid Unicode text", "word"),
        (Vector3(10**400), "x is too large; expected a 'float'", "x"),
        (Vector3(y=True), "y is a 'bool'; expected a 'float'", "y"),
        (Vector3(y=None), "y is a 'NoneType'; expected a 'float'", "y"),
        (Vector3(y=np.zeros(2)), "y is a 'ndarray'; expected a 'float'", "y"),
        (nep.sensor.JointState(name=["a", b"b"]), "name[1] is a 'bytes'; expected a 'str'", "name[1]"),
        (nep.sensor.JointState(position={1.0}), "position is a 'set'; expected a 'list'", "position"),
    ],
)  # fmt: skip
def test_unencodable_typed_value_is_reported_with_its_path(payload: object, reason: str, place: str) -> None:
    assert unsent(payload) == (reason, place)


def test_dict_published_on_a_typed_topic_is_validated() -> None:
    encode = typed_codec(message_type(Strict), JSON).encode
    assert json.loads(bytes(encode({"b": "x", "a": 3}).data)) == {"b": "x", "a": 3}
    assert unsent({"b": "x", "aa": 1}, Strict) == ("aa isn't a field of 'Strict'; did you mean 'a'?", "aa")
    assert unsent({"a": 1}, Strict) == ("b is missing; expected a 'str'", "b")
    assert unsent({"b": 1}, Strict) == ("b is a 'int'; expected a 'str'", "b")
    assert unsent([], Strict) == ("publish a 'Strict'", "")
    assert unsent({1: 1}, Strict)[1] == "1"


@pytest.mark.parametrize("value", [1, 1.0, 1.5, "1", True, None, [1], [], Part(2)])
def test_union_field_preserves_the_type_of_its_value(value: object) -> None:
    came = read(Number, sent(Number(value))).value
    assert (came, type(came)) == (value, type(value))


def test_mismatched_union_value_is_reported_with_all_alternatives() -> None:
    assert refused(Number, {"value": ["a"]}) == (
        "value is a 'list'; expected a 'int', a 'str', a 'list', a 'Part', a 'bool', a 'float' or None"
    )


# ---- import cost and unusual classes


def test_typed_message_modules_are_imported_on_first_use() -> None:
    program = (
        "import sys, nep\n"
        "with nep.node('n', 'memory', master='m') as node:\n"
        "    pub, sub = node.new_pub('t'), node.new_sub('t')\n"
        "    pub.publish(1)\n"
        "    parts = ('nep.messages.typed', 'nep.messages.shapes', 'nep.geometry', 'nep.sensor')\n"
        "    print(sub.listen(), [each for each in parts if each in sys.modules])\n"
        "print(nep.geometry.Point(1), nep.sensor.Temperature.MSG_TYPE)\n"
    )
    with running(program) as alone:
        assert alone.end() == (
            "(True, 1) []\nPoint(x=1, y=0.0, z=0.0) sensor_msgs/Temperature\n", ""
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Odd:
    class_: int = 1
    _private: int = 5
    self_: str = "me"


@dataclass
class Base:
    MSG_TYPE: ClassVar[str] = "test/Base"

    a: int


@dataclass
class Derived(Base):
    b: int = 2


@dataclass
class Nothing:
    pass


class NothingAtAll(TypedDict):
    pass


def test_derived_and_empty_dataclasses_round_trip_without_private_fields() -> None:
    assert read(Odd, sent(Odd(class_=3, _private=1))) == Odd(class_=3)
    assert message_type(Derived).name == "test/Base"
    assert json.loads(bytes(typed_codec(message_type(Base), JSON).encode(Derived(1)).data)) == {"a": 1}
    assert read(Derived, {"a": 1}) == Derived(1)
    assert read(Nothing, sent(Nothing())) == Nothing()
    assert read(Nothing, {"a": 1}) == Nothing()
    assert read(NothingAtAll, {"a": 1}) == {}


def test_instance_with_a_deleted_attribute_is_rejected() -> None:
    @dataclass
    class Slot:
        a: int
        b: int = 1

    slot = Slot(1)
    del slot.a
    with nep.node("n", "memory", master="typed-slot") as node:
        sub, pub = node.new_sub("t"), node.new_pub("t", Slot)
        pub.publish(slot)
        assert "'a'" in pub.problem
        pub.publish(Slot(2))
        assert sub.listen(timeout_s=30.0) == (True, {"a": 2, "b": 1})


def test_threads_publish_and_receive_different_types_concurrently() -> None:
    with nep.node("n", "memory", master="typed-threads") as node:
        faults: list[object] = []

        def use(declared: type, payload: object) -> None:
            topic = f"/{declared.__name__}"
            sub, pub = node.new_sub(topic, declared), node.new_pub(topic, declared)
            for _n in range(500):
                pub.publish(payload)
                came = sub.listen(timeout_s=30.0)
                if came != (True, payload):
                    faults.append(came)

        message_type.cache_clear()
        threads = [
            threading.Thread(target=use, args=(type(each), each))
            for each in (Twist(), PoseStamped(), Part(3), Tree([Tree()]))
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert faults == []
