"""The C# client on the native wire and nep-js 0.1.1 on the original one, through the gateway of `nep master`.

Python with nep-js 0.1.1 is in test_matrix.py, nep-js 0.2 with it in test_javascript.py.
"""

from __future__ import annotations

import json

import pytest

from tests.clients import mono_programs
from tests.clients.node_programs import NEEDS_NODE
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
    """Starts the C# program of the nine directions."""
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
