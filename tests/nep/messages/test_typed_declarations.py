"""Tests of the declaration of message types: which are accepted, and which new_pub and new_sub reject."""

from __future__ import annotations

import re
import sys
from dataclasses import InitVar, dataclass
from datetime import datetime
from enum import Enum, IntEnum
from typing import Any, ClassVar, Literal, TypedDict

import pytest

import nep
from nep.geometry import Twist
from nep.messages.typed import message_type


class Colour(Enum):
    RED = "red"


class Level(IntEnum):
    LOW = 1


class Strict(TypedDict):
    b: str


@dataclass
class Part:
    number: int = 0


@dataclass
class Base:
    MSG_TYPE: ClassVar[str] = "test/Base"


@dataclass
class Derived(Base):
    b: int = 2


def test_message_type_is_named_after_its_class_or_declared_name() -> None:
    assert [message_type(each).name for each in (Part, Derived, Strict, Twist)] == [
        "Part", "test/Base", "Strict", "geometry_msgs/Twist",
    ]  # fmt: skip


@dataclass
class Bytes:
    inner: list[bytes]


@dataclass
class Keys:
    inner: dict[int, str]


@dataclass
class Sets:
    inner: set[int]


@dataclass
class BytesEnum:
    inner: Literal[b"a"]


@dataclass
class EnumWord:
    inner: Literal[Level.LOW]


@dataclass
class Unhashable:
    inner: Literal[{}]  # type: ignore[valid-type]


@dataclass
class TwoMaps:
    inner: Part | Strict | None


@dataclass
class TwoTexts:
    inner: Literal["now"] | datetime


@dataclass
class TwoLists:
    inner: list[int] | tuple[str, int]


@dataclass
class Unknown:
    inner: NowhereToBeFound  # noqa: F821 - that is what it tests


@dataclass
class Private:
    _inner: int


@dataclass
class Image:
    MSG_TYPE: ClassVar[str] = "image"


@dataclass
class Empty:
    MSG_TYPE: ClassVar[str] = ""


@dataclass
class Numbered:
    MSG_TYPE: ClassVar[Any] = 3


@dataclass
class Needs:
    other: InitVar[int]
    kept: int = 0


@dataclass(init=False)
class OwnConstructor:
    kept: int = 0

    def __init__(self, another: int) -> None:
        self.kept = another


class Plain:
    pass


@pytest.mark.parametrize(
    ("declared", "sentence"),
    [
        (Bytes, "Bytes.inner is a 'bytes', which typed messages don't support; see docs/types.md"),
        (Keys, "Keys.inner is a 'dict[int, str]', which typed messages don't support"),
        (Sets, "Sets.inner is a 'set[int]', which"),
        (BytesEnum, "BytesEnum.inner is a "),
        (EnumWord, "EnumWord.inner is a "),
        (Unhashable, "Unhashable.inner is a "),
        (TwoMaps, "TwoMaps.inner is a 'tests.nep.messages.test_typed_declarations.Part |"),
        (TwoTexts, "TwoTexts.inner is a "),
        (
            TwoLists,
            "TwoLists.inner is a 'list[int] | tuple[str, int]', whose types can't be distinguished in JSON",
        ),
        (Unknown, "the type hints of 'Unknown' can't be resolved: name 'NowhereToBeFound' is not defined"),
        (Private, "Private._inner isn't sent; add a default value"),
        (
            Image,
            (
                "the message type of 'Image' is 'image', a built-in type without fields; set MSG_TYPE to "
                "another name"
            ),
        ),
        (
            Needs,
            "Needs.other is required" if sys.version_info >= (3, 11) else "the type hints of 'Needs' can't",
        ),
        (
            OwnConstructor,
            "OwnConstructor.another is required by the constructor but isn't a field of the message",
        ),
        (Empty, "MSG_TYPE is empty"),
        (Numbered, "MSG_TYPE must be a 'str', not 'int'"),
        (Plain, "msg_type is the class 'Plain', which is neither a dataclass nor a TypedDict"),
        (int, "msg_type is the class 'int'"),
        (dict, "msg_type is the class 'dict'"),
        (Colour, "msg_type is the class 'Colour'"),
    ],
)
def test_unsupported_type_is_rejected_by_new_pub_and_new_sub(declared: type, sentence: str) -> None:
    with nep.node("n", "memory", master="typed-refused") as node:
        for make in (node.new_pub, node.new_sub):
            with pytest.raises(ValueError, match=re.escape(sentence)) as caught:
                make("t", declared)
            assert str(caught.value).startswith(sentence)
        assert not node.graph().topics


def test_too_deeply_nested_types_are_rejected() -> None:
    hint: Any = int
    for _level in range(2000):
        hint = list[hint]
    usual = sys.getrecursionlimit()
    sys.setrecursionlimit(1000)  # a library may have raised the limit
    try:
        with pytest.raises(ValueError, match="the types in 'Deep' are nested too deeply; use a dataclass"):
            message_type(TypedDict("Deep", {"inner": hint}))
    finally:
        sys.setrecursionlimit(usual)


@pytest.mark.parametrize("given", [list[int], dict[str, int], Part(), Part | None, None, 3])
def test_message_type_that_is_not_a_class_is_rejected(given: Any) -> None:
    with nep.node("n", "memory", master="typed-no-class") as node:
        for make in (node.new_pub, node.new_sub):
            with pytest.raises(ValueError, match="msg_type must be a 'str', not "):
                make("t", given)
        with pytest.raises(ValueError, match="msg_type must be a 'str', not "):
            node.new_callback("t", given, print)
