"""What a target of fuzzing is: one parser, what it may raise, and bytes to begin with."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import orjson

from nep.messages.packing import unpack

SEPARATOR = b"\xff|\xff"
"""Between the parts of one message."""


@dataclass(frozen=True)
class Target:
    """`run` gives whatever bytes to a parser: it may raise `errors`, and nothing else; it also checks.

    `seeds` makes what the parser takes, by the library's own writers where there are some. `slower` is how
    many times as long one run may take as others.
    """

    name: str
    run: Callable[[bytes], object]
    errors: tuple[type[Exception], ...]
    seeds: Callable[[], Iterable[bytes]]
    words: tuple[bytes, ...] = ()
    slower: int = 1

    def try_bytes(self, data: bytes) -> None:
        """Raises what the parser must not."""
        try:
            self.run(data)
        except self.errors as error:
            check_sentence(error)


@dataclass(frozen=True)
class Targets:
    """All of them, by name."""

    known: dict[str, Target] = field(default_factory=dict)

    def add(
        self,
        *errors: type[Exception],
        seeds: Callable[[], Iterable[bytes]],
        words: tuple[bytes, ...] = (),
        slower: int = 1,
    ) -> Callable[[Callable[[bytes], object]], Callable[[bytes], object]]:
        """Makes a function a target that is called like it."""

        def made(run: Callable[[bytes], object]) -> Callable[[bytes], object]:
            name = run.__name__
            assert name not in self.known, name
            self.known[name] = Target(name, run, errors, seeds, words, slower)
            return run

        return made


MAX_LETTERS = 20_000
"""A sentence for a person, however much somebody sent, is no longer than what was sent and this."""


def check_sentence(error: Exception) -> None:
    """What is raised says something, and can be shown."""
    said = str(error)
    assert said, f"{type(error).__name__} says nothing"
    assert len(said) < MAX_LETTERS, f"a sentence of {len(said)} letters"
    said.encode()


def parts_of(data: bytes) -> list[bytes]:
    """Bytes as the parts of a message."""
    return data.split(SEPARATOR)


def joined(parts: Iterable[bytes | memoryview]) -> bytes:
    """The other way round."""
    return SEPARATOR.join(map(bytes, parts))


def text_of(data: bytes) -> str:
    """Bytes as text; those that are none are halves of letters, as in the arguments of a program."""
    return data.decode("utf-8", "surrogateescape")


def value_of(data: bytes) -> object:
    """Bytes as a value: what JSON, Python's JSON (NaN, halves of letters, long numbers) or msgpack says."""
    for read in (orjson.loads, json.loads, unpack):
        try:
            return read(data)
        except (ValueError, RecursionError):
            continue
    return text_of(data)


def map_of(data: bytes) -> Mapping[str, object]:
    """The same; what is no map is one in a map."""
    value = value_of(data)
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return value
    return {"": value}


def is_same(one: object, other: object) -> bool:
    """Whether two values are the same, NaN being NaN."""
    return repr(one) == repr(other)
