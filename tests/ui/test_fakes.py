"""What stands for the core in tests of panels offers what the core offers, in the same way, and no more.

Topics, watches, robots, tries, the fleet and the doctor are the real ones there. These are not: the session
that holds them, documents with a program that a test tells, and pictures without a thread.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.blocks import Program
from app.core.messages.picture import Picture
from app.core.session import Session
from app.core.storage.settings import Settings
from tests.ui import fakes

ONLY_FOR_TESTS: Mapping[str, set[str]] = {
    "session": {"calls", "watches", "watched", "ticks", "send", "full"},
    "document": {"calls", "found", "sensors", "known", "source", "compiled", "told", "absent_blocks"},
    "documents": {"them"},
    "images": {"streams", "source"},
    "stream": {"painted", "wishes"},
    "runs": set(),
    "launcher": set(),
}
"""What tests tell a fake, and ask it, beside what stands in the core."""


class NoNetwork:
    """A source of which nothing comes."""

    address = "127.0.0.1:7780"

    def start(self) -> None:
        """Nothing begins."""

    def watch(self, topic: str) -> None:
        """Nothing comes."""

    def unwatch(self, topic: str) -> None:
        """Nothing came."""

    def submit(self, what: str, job: object) -> None:
        """Nobody is there."""

    def missed(self) -> Mapping[str, int]:
        return {}

    def close(self) -> None:
        """Nothing ends."""


@pytest.fixture
def real(tmp_path: Path) -> Iterator[Session]:
    made = Session(
        Settings(tmp_path),
        address="127.0.0.1:7780",
        source=NoNetwork(),
        journal_folder=tmp_path / "journal",
        start_companions=False,
    )
    yield made
    made.close()


@pytest.fixture
def pairs(real: Session) -> Iterator[dict[str, tuple[Any, Any]]]:
    """Each fake, and what it stands for."""
    fake = fakes.Session()
    stream = real.images.stream("/cam")
    yield {
        "session": (fake, real),
        "document": (fake.document, real.document),
        "documents": (fake.documents, real.documents),
        "images": (fake.images, real.images),
        "stream": (fake.images.stream("/cam"), stream),
        "runs": (fake.runs, real.runs),
        "launcher": (fake.launcher, real.launcher),
    }
    stream.close()


def public(thing: object) -> set[str]:
    return {name for name in dir(thing) if not name.startswith("_")}


def parameters(method: object) -> list[tuple[str, object]]:
    """Names and kinds; what has a default may be left out by a fake."""
    found = inspect.signature(method).parameters.values()  # type: ignore[arg-type]
    return [(each.name.lstrip("_"), each.kind) for each in found]


@pytest.mark.parametrize("name", ONLY_FOR_TESTS)
def test_it_has_nothing_that_the_core_does_not_have(pairs: dict[str, tuple[Any, Any]], name: str) -> None:
    fake, real = pairs[name]
    assert public(fake) - public(real) - ONLY_FOR_TESTS[name] == set()
    assert ONLY_FOR_TESTS[name] <= public(fake)


@pytest.mark.parametrize("name", ONLY_FOR_TESTS)
def test_it_is_called_as_the_core_is(pairs: dict[str, tuple[Any, Any]], name: str) -> None:
    fake, real = pairs[name]
    shared = (public(fake) & public(real)) - ONLY_FOR_TESTS[name]
    differ = {
        each: (parameters(getattr(fake, each)), parameters(getattr(real, each)))
        for each in shared
        if callable(getattr(fake, each))
        and parameters(getattr(fake, each)) != parameters(getattr(real, each))
    }
    assert differ == {}


SAME_AT_FIRST = {
    "document": ["path", "name", "dirty", "saved_at", "absent", "workspace", "robots", "edits", "mends"],
    "stream": ["topic", "picture", "arriving_hz", "shown_hz", "silent_s", "age_s", "error", "held", "resting",
               "closed", "awaits_picture"],
    "runs": ["running_blocks", "stopped_blocks", "block_errors", "active"],
    "launcher": ["virtual_robots"],
    "session": ["graph", "tick_ms"],
}  # fmt: skip


@pytest.mark.parametrize("name", SAME_AT_FIRST)
def test_it_begins_as_the_core_does(pairs: dict[str, tuple[Any, Any]], name: str) -> None:
    fake, real = pairs[name]
    told = {each: (getattr(fake, each), getattr(real, each)) for each in SAME_AT_FIRST[name]}
    assert {
        each: two for each, two in told.items() if two[0] != two[1] or type(two[0]) is not type(two[1])
    } == {}


def test_streams_rest_hold_and_close_alike(pairs: dict[str, tuple[Any, Any]]) -> None:
    def story(stream: Any) -> list[object]:
        told: list[object] = []
        for step in ("rest", "rest", "wake", "wake", "close", "close", "wake"):
            getattr(stream, step)()
            told.append((step, stream.resting, stream.closed, stream.awaits_picture))
        return told

    fake, real = pairs["stream"]
    for each in (fake, real):
        each.hold(True)
        assert each.held
        each.hold(False)
        each.want((10, 10))
        each.shown()  # nothing is there to be shown: no harm
        each.picture = Picture(np.zeros((2, 2, 4), np.uint8), 2, 2, 1, 1, 0.0)
        each.shown()
    assert story(fake) == story(real)


def test_edits_count_alike(pairs: dict[str, tuple[Any, Any]]) -> None:
    def story(document: Any) -> list[object]:
        told: list[object] = []
        for workspace in ({"blocks": {"blocks": [{"type": "events_started", "id": "a"}]}}, fakes.WORKSPACE):
            for _ in range(2):  # the same once more is no edit
                document.edited(workspace)
                told.append((document.edits, document.dirty, document.workspace == workspace))
        return told

    fake, real = pairs["document"]
    assert story(fake) == story(real)


def test_a_told_program_is_a_program(pairs: dict[str, tuple[Any, Any]]) -> None:
    fake, real = pairs["document"]
    assert type(fake.program()) is type(real.program()) is Program
    assert type(fake.newest()) is Program
    assert fake.definitions().keys() == real.definitions().keys()
    assert fake.newest() is fake.newest()
    assert real.newest() is real.newest()
