"""Tests of control characters: rejected in names, escaped in displayed text."""

from __future__ import annotations

import re
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

import nep
from nep.errors import DecodeError, RequestRefusedError
from nep.protocol.wire import check_node_name, check_topic
from nep.text import escaped, first_control, shortened, strip_controls

CONTROLS = [
    *map(chr, range(0x20)),
    "\x7f",
    *map(chr, range(0x80, 0xA0)),
    *"\u2028\u2029\u202a\u202b\u202d\u202e",
]
CONTROLS += [*"\u2066\u2067\u2068\u2069\u200e\u200f\u061c\u200b\ufeff", "\ud800", "\udfff"]


@pytest.mark.parametrize("control", CONTROLS, ids=ascii)
def test_name_with_control_character_is_rejected_with_an_escaped_message(control: str) -> None:
    name = f"arm{control}2"
    assert first_control(name) == ascii(control)[1:-1]
    with pytest.raises(nep.BadNameError, match=re.escape(ascii(name)[1:-1])) as bad_name:
        nep.node(name)
    with pytest.raises(nep.BadTopicError) as bad_topic:
        check_topic(f"/{name}")
    for raised in (bad_name, bad_topic):
        assert control not in str(raised.value)
        str(raised.value).encode("utf-8")


def test_node_name_length_is_1_to_200_bytes() -> None:
    for good in (
        "a",
        "Pepper 2",
        "Ärm",
        "机器人",
        "قلم",
        "می‌خواهم",
        "👩‍🚀",
        "x" * 200,
        "é" * 100,
        "{}",
        "<img>",
    ):
        assert check_node_name(good) == good
    for bad in ("", "x" * 201, "é" * 101, "a" * 1_000_000):
        with pytest.raises(nep.BadNameError, match="1 to 200 are allowed") as raised:
            check_node_name(bad)
        assert len(str(raised.value)) < 400


@pytest.mark.parametrize("name", ["a\x1b[2J", "a\nb", "a\u202eb", "\x9b2J", "x" * 201], ids=repr)
def test_node_with_control_characters_or_a_too_long_name_is_not_created(name: str) -> None:
    with pytest.raises(ValueError, match="node"):
        nep.node(name, "memory")


@given(st.text(st.characters(categories=["L", "N", "P", "S", "Zs", "Cc", "Cf", "Cs", "Zl", "Zp"])))
def test_escaped_text_is_one_line_without_control_characters(text: str) -> None:
    shown = escaped(text)
    assert not first_control(shown)
    assert not any(unicodedata.category(letter) in {"Cc", "Cs", "Zl", "Zp"} for letter in shown)
    assert len(shown.splitlines()) <= 1
    shown.encode("utf-8")
    if not first_control(text):
        assert shown == text


def test_escaped_text_keeps_line_breaks_if_allowed() -> None:
    assert escaped("a\n\tb\x1b[2J\r\x85c", lines=True) == "a\n\tb\\x1b[2J\\r\\x85c"
    assert escaped("a\nb") == "a\\nb"


def test_remote_text_in_errors_is_escaped_and_truncated() -> None:
    for error in (
        DecodeError("json", 3, "no \x1b]0;title\x07" + "x" * 9999),
        RequestRefusedError("\x9b2J" * 999),
    ):
        assert not first_control(str(error))
        assert len(str(error)) < 6 * 500 + 100


def test_long_text_is_truncated_with_its_length() -> None:
    assert shortened("abc", 3) == "abc"
    assert shortened("abcd", 3) == "abc… (4 characters)"


def test_control_characters_are_removed_from_remote_text() -> None:
    assert strip_controls("a\u202eb\x1b[2J\nc\td") == "ab[2J c d"
    assert strip_controls("a\u202eb\nc\td", lines=True) == "ab\nc\td"
    assert strip_controls("".join(CONTROLS)).strip(" ") == ""
