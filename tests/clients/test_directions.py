"""Tests of the exchange between Python, JavaScript and C# in all nine directions.

The programs use the calls of the listings in the paper.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path

import pytest

import nep
from nep.masters.master import Master
from tests.clients import mono_programs
from tests.clients.node_programs import NEEDS_NODE, build_package, prepared
from tests.nep.programs import ROOT, eventually

pytestmark = [
    *NEEDS_NODE,
    pytest.mark.skipif(not mono_programs.HAS_MONO, reason=mono_programs.WITHOUT),
]
LANGUAGES = ("python", "javascript", "csharp")
COUNT = 40
LONG_S = 60.0

PYTHON = r"""
import json, sys, nep
do, count, *topics = sys.argv[1:]
if do == "talk":
    node = nep.node("python_sender")
    pub = node.new_pub(topics[0], "json")
    for number in range(int(count)):
        pub.publish({"number": number, "message": "x" * number * 2000 + 'grüß\n"🤖"'})
else:
    node = nep.node("python_receiver")
    subscribers = {topic: node.new_sub(topic, "json") for topic in topics}
    for topic, sub in subscribers.items():
        for _ in range(int(count)):
            is_there, msg = sub.listen(True)
            print(json.dumps([topic, msg]))
    node.close()
"""
JAVASCRIPT = r"""
const nep = require("nep-js");

const [what, count, ...topics] = process.argv.slice(2);
if (what === "talk") {
  var node = new nep.Node("javascript_sender");
  var publisher = node.new_pub(topics[0], "json");
  for (let number = 0; number < Number(count); number++) {
    publisher.publish({ number, message: "x".repeat(number * 2000) + 'grüß\n"🤖"' });
  }
} else {
  var node = new nep.Node("javascript_receiver");
  let left = topics.length * Number(count);
  for (const topic of topics) {
    var callback = function (message) {
      console.log(JSON.stringify([topic, message]));
      left -= 1;
      if (left === 0) node.close();
    };
    node.new_callback(topic, "json", callback);
  }
}
"""

TALKERS = {
    "python": """
import nep
node = nep.node('python_sender')
pub = node.new_pub('test', 'json')
pub.publish({'message': 'hello'})
""",
    "javascript": """
const nep = require("nep-js");
var node = new nep.Node("publisher_sample");
var publisher = node.new_pub("test", "json");
var message = { message: "hello world" };
publisher.publish(message);
""",
}
LISTENERS = {
    "python": """
import nep
def callback(message):
    print(message)
node = nep.node('python_callback')
sub = node.new_callback('test', 'json', callback)
node.spin()
""",
    "javascript": """
const nep = require("nep-js");
var node = new nep.Node("subscriber_sample");
var callback = function (message) {
  console.log(message);
};
var subscriber = node.new_callback("test", "json", callback);
""",
}


@pytest.fixture
def commands(tmp_path: Path) -> dict[str, list[str]]:
    """Return the command of the program in each language."""
    build_package()
    compiled = mono_programs.program(
        "Directions.exe", mono_programs.CSHARP / "tests" / "peer" / "Directions.cs"
    )
    return {
        "python": [sys.executable, "-c", PYTHON],
        "javascript": prepared(JAVASCRIPT, tmp_path),
        "csharp": ["mono", str(compiled)],
    }


@pytest.fixture
def python(master: Master, patient: None) -> Iterator[nep.node]:
    with nep.node("python") as own:
        yield own


def subscriber_count(node: nep.node) -> int:
    return sum(len(topic.subscribers) for topic in node.graph().topics.values())


class Programs:
    """Running programs with output files in a folder; killed by `close`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._stack = ExitStack()
        paths = {"PYTHONPATH": str(ROOT), "MONO_PATH": str(mono_programs.BUILD), "PYTHONUNBUFFERED": "1"}
        self._environment = {**os.environ, **paths}

    def start(self, name: str, command: list[str]) -> subprocess.Popen[bytes]:
        output = self._stack.enter_context((self._folder / name).open("wb"))
        process = subprocess.Popen(command, cwd=self._folder, env=self._environment, stdout=output)
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        return process

    def lines(self, name: str) -> list[str]:
        return (self._folder / name).read_text("utf-8").splitlines()

    def close(self) -> None:
        self._stack.close()


@pytest.fixture
def programs(tmp_path: Path, master: Master) -> Iterator[Programs]:
    made = Programs(tmp_path)
    yield made
    made.close()


def listing(language: str, scripts: Mapping[str, str], compiled: str, folder: Path) -> list[str]:
    """Return the command that runs a listing of the paper."""
    if language == "python":
        return [sys.executable, "-c", scripts[language]]
    if language == "javascript":
        return prepared(scripts[language], folder, f"{compiled}.cjs")
    example = mono_programs.CSHARP / "examples" / f"{compiled}.cs"
    return ["mono", str(mono_programs.program(f"{compiled}.exe", example))]


def test_listings_exchange_messages_in_all_nine_directions(
    programs: Programs, python: nep.node, tmp_path: Path
) -> None:
    build_package()
    for language in LANGUAGES:
        programs.start(language, listing(language, LISTENERS, "Listing10", tmp_path))
    eventually(lambda: subscriber_count(python) == len(LANGUAGES))
    for count, language in enumerate(LANGUAGES, start=1):
        talker = programs.start(f"{language}_talker", listing(language, TALKERS, "Listing9", tmp_path))
        assert talker.wait(LONG_S) == 0
        for listener in LANGUAGES:
            eventually(lambda listener=listener, count=count: len(programs.lines(listener)) == count)
            assert "hello" in programs.lines(listener)[-1], (language, listener)


def test_messages_are_received_complete_and_in_order_in_all_nine_directions(
    commands: dict[str, list[str]], programs: Programs, python: nep.node
) -> None:
    topics = [f"from_{language}" for language in LANGUAGES]
    listeners = [
        programs.start(language, [*commands[language], "listen", str(COUNT), *topics])
        for language in LANGUAGES
    ]
    eventually(lambda: subscriber_count(python) == len(LANGUAGES) ** 2)
    talkers = [
        programs.start(f"{language}_talker", [*commands[language], "talk", str(COUNT), f"from_{language}"])
        for language in LANGUAGES
    ]
    assert [process.wait(LONG_S) for process in (*talkers, *listeners)] == [0] * 6
    messages = [{"number": number, "message": "x" * number * 2000 + 'grüß\n"🤖"'} for number in range(COUNT)]
    for listener in LANGUAGES:
        received = [json.loads(line) for line in programs.lines(listener)]
        for talker in LANGUAGES:
            heard = [message for topic, message in received if topic == f"from_{talker}"]
            assert [each["number"] for each in heard] == list(range(COUNT)), (talker, listener)
            assert heard == messages, (talker, listener)
