"""Tests of the text of values that other programs sent."""

from __future__ import annotations

import sys
from types import MappingProxyType

import pytest

from nep.text import bounded_str, quotable


def nested(levels: int) -> object:
    value: object = "x"
    for level in range(levels):
        value = [value] if level % 2 else {"a": value}
    return value


class SpeechlessError(Exception):
    def __str__(self) -> str:
        raise RuntimeError("no words")


class Endless(dict[str, object]):
    """Infinite map that counts how many keys were read."""

    def __init__(self) -> None:
        self.read = 0

    def __bool__(self) -> bool:
        return True

    def __iter__(self):
        while True:
            self.read += 1
            yield str(self.read)

    def __getitem__(self, name: str) -> object:
        return self


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("a b", "a b"),
        ("", ""),
        (None, "None"),
        (True, "True"),
        (2**64, "18446744073709551616"),
        (1.5, "1.5"),
        ([1, "a", None], "[1, 'a', None]"),
        ({"a": [1]}, "{'a': [1]}"),
        (MappingProxyType({"a": (1,)}), "{'a': [1]}"),
        (b"\xff", r"b'\xff'"),
        ("a\ud800", r"a\ud800"),
        (["\ud800"], r"['\ud800']"),
        (10**5_000, "an integer with 5001 digits"),
        (ValueError(), "ValueError"),
        (ValueError("odd"), "odd"),
        (SpeechlessError(), "SpeechlessError"),
        (nested(1_000), "[{'a': [{'a': [{'a': [{'a': […]}]}]}]}]"),
        ("n" * 300, "n" * 200 + "… (300 characters)"),
    ],
    ids=lambda value: str(type(value)),
)
def test_values_are_formatted_as_bounded_text(value: object, text: str) -> None:
    assert bounded_str(value) == text
    bounded_str(value).encode()


def test_only_the_displayed_part_of_a_value_is_read() -> None:
    endless = Endless()
    assert len(bounded_str(endless)) <= 201
    assert endless.read < 1_000
    assert len(bounded_str(list(range(10_000_000)))) <= 201
    assert len(bounded_str([["x" * 5_000_000] * 1_000] * 1_000)) <= 201


def test_bounded_text_works_near_the_recursion_limit() -> None:
    def fall(levels: int) -> str:
        return fall(levels - 1) if levels else bounded_str(nested(60))

    depth = len(__import__("inspect").stack())
    for left in range(1, 40):
        try:
            assert fall(sys.getrecursionlimit() - depth - left)
        except RecursionError:
            continue


def test_quoted_value_is_one_line_without_controls() -> None:
    assert quotable({"\x1b[2J\n": "\u202e"}) == r"{'\x1b[2J\n': '\u202e'}"
    assert quotable("a\n\x1b") == r"a\n\x1b"
