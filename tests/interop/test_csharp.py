"""Tests of the C# client with programs of the original NEP through the gateway of `nep master`.

The programs of the original NEP are nep-js 0.1.1 and sockets that act as programs with `Nep.dll`
0.0.0.5. Related tests: the three languages with each other in tests/clients/test_directions.py; Python
with nep-js 0.1.1 in test_matrix.py; nep-js 0.2 with nep-js 0.1.1 in test_javascript.py.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from nep.masters.process import view
from tests.clients import mono_programs
from tests.clients.node_programs import NEEDS_NODE, build_package
from tests.clients.test_directions import LANGUAGES, LISTENERS, TALKERS, Programs, listing
from tests.interop.gateway.conftest import Original
from tests.nep.programs import eventually

pytestmark = [
    *NEEDS_NODE,
    pytest.mark.ports,
    pytest.mark.interop,
    pytest.mark.skipif(not mono_programs.HAS_MONO, reason=mono_programs.WITHOUT),
]
COUNT = 20


@pytest.fixture
def start(peers, master):
    """Function that starts the C# program of tests/clients/test_directions.py."""
    source = mono_programs.CSHARP / "tests" / "peer" / "Directions.cs"
    program = mono_programs.program("Directions.exe", source)

    def run(*arguments: str):
        return peers.run(["mono", str(program), *arguments], MONO_PATH=str(mono_programs.BUILD))

    return run


def test_csharp_and_the_original_nep_js_exchange_messages(peers, start):
    subscriber = peers.start("nep-js", "subscriber", "from_csharp").wait_ready()
    publisher = peers.start("nep-js", "publisher", "to_csharp").wait_ready()
    start("talk", str(COUNT), "from_csharp")
    last = {"number": COUNT - 1, "message": "x" * (COUNT - 1) * 2000 + 'grüß\n"🤖"'}
    assert subscriber.hears(last)
    assert [each["number"] for each in subscriber.got] == list(range(COUNT))

    listener = start("listen", "1", "to_csharp")
    message = {"text": "grüß dich", "list": [1, None]}

    def has_ended() -> bool:
        publisher.tell(message)
        publisher.settle(0.1)
        return listener.process.poll() is not None

    eventually(has_ended)
    eventually(lambda: listener.printed.endswith("\n"))
    assert json.loads(listener.printed) == ["to_csharp", message]


@pytest.fixture
def original() -> Iterator[Original]:
    program = Original()
    yield program
    program.context.destroy(linger=0)


def read_by_nep_dll(frame: bytes) -> object:
    """Return the value that `Nep.dll` delivers: the text between the first and the second space."""
    return json.loads(frame.decode().split(" ")[1])


@pytest.fixture
def listings(master, tmp_path: Path) -> Iterator[Programs]:
    build_package()
    with closing(Programs(tmp_path)) as made:
        yield made


def test_listings_exchange_messages_with_programs_of_the_original_csharp_library(
    peers, nep_home, listings, original, tmp_path
):
    about = {"node": "original", "pid": str(os.getpid())}  # pid as text, which only Nep.dll sends
    port = original.ask("test", "subscriber", **about)["port"]
    assert original.ask("test", "publisher", **about)["port"] == port
    with original.subscriber(port + 1, b"test") as subscriber, original.publisher(port) as publisher:
        original.publish_until(publisher, b'test {"message":"own"}', lambda: subscriber.poll(0))
        eventually(lambda: len(view(nep_home).topics["test"].subscribers) == 2)  # original node and gateway
        for language, message in zip(LANGUAGES, ("hello", "hello world", "hello"), strict=True):
            listings.start(f"{language}_talker", listing(language, TALKERS, "Listing9", tmp_path))
            while (heard := read_by_nep_dll(subscriber.recv())) == {"message": "own"}:
                pass
            assert heard == {"message": message}, language
        for language in LANGUAGES:
            listings.start(language, listing(language, LISTENERS, "Listing10", tmp_path))

        def all_have_heard() -> bool:
            return all("hello" in " ".join(listings.lines(language)) for language in LANGUAGES)

        original.publish_until(publisher, b'test {"message":"hello"}', all_have_heard)
