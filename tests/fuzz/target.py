"""Fuzz targets: a parser, the exceptions that it may raise, and its seed inputs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import orjson

from nep.messages.packing import unpack

SEPARATOR = b"\xff|\xff"
"""Separator between the parts of a multipart message."""


@dataclass(frozen=True)
class Target:
    """Fuzz target that passes bytes to a parser.

    `run` may raise `errors` and nothing else; it can also check the result. `seeds` returns valid
    inputs, encoded by the library where possible. `slower` is the factor by which one run may take
    longer than for other targets.
    """

    name: str
    run: Callable[[bytes], object]
    errors: tuple[type[Exception], ...]
    seeds: Callable[[], Iterable[bytes]]
    words: tuple[bytes, ...] = ()
    slower: int = 1

    def try_bytes(self, data: bytes) -> None:
        """Run the target; raise every exception that the parser must not raise."""
        try:
            self.run(data)
        except self.errors as error:
            check_sentence(error)


@dataclass(frozen=True)
class Targets:
    """Registry of fuzz targets by name."""

    known: dict[str, Target] = field(default_factory=dict)

    def add(
        self,
        *errors: type[Exception],
        seeds: Callable[[], Iterable[bytes]],
        words: tuple[bytes, ...] = (),
        slower: int = 1,
    ) -> Callable[[Callable[[bytes], object]], Callable[[bytes], object]]:
        """Return a decorator that registers a function as the target with the function's name."""

        def made(run: Callable[[bytes], object]) -> Callable[[bytes], object]:
            name = run.__name__
            assert name not in self.known, name
            self.known[name] = Target(name, run, errors, seeds, words, slower)
            return run

        return made


MAX_LETTERS = 20_000
"""Maximum length of an error message in characters, for inputs of any size."""


def check_sentence(error: Exception) -> None:
    """Check that an error message is not empty, not too long and can be encoded."""
    said = str(error)
    assert said, f"{type(error).__name__} says nothing"
    assert len(said) < MAX_LETTERS, f"a sentence of {len(said)} letters"
    said.encode()


def parts_of(data: bytes) -> list[bytes]:
    """Split bytes into the parts of a multipart message."""
    return data.split(SEPARATOR)


def joined(parts: Iterable[bytes | memoryview]) -> bytes:
    """Join the parts of a multipart message; the inverse of `parts_of`."""
    return SEPARATOR.join(map(bytes, parts))


def text_of(data: bytes) -> str:
    """Decode bytes as UTF-8; invalid bytes become lone surrogates, as in command-line arguments."""
    return data.decode("utf-8", "surrogateescape")


def value_of(data: bytes) -> object:
    """Decode bytes as JSON (strict, then Python's dialect) or msgpack, otherwise as text."""
    for read in (orjson.loads, json.loads, unpack):
        try:
            return read(data)
        except (ValueError, RecursionError):
            continue
    return text_of(data)


def map_of(data: bytes) -> Mapping[str, object]:
    """Decode bytes to a mapping; any other value becomes the only item of one."""
    value = value_of(data)
    if isinstance(value, Mapping) and all(isinstance(key, str) for key in value):
        return value
    return {"": value}


def is_same(one: object, other: object) -> bool:
    """Return whether two values are equal, with NaN equal to NaN."""
    return repr(one) == repr(other)
