"""Exchange between Python, JavaScript and C# in all nine directions, with the calls of the listings."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

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
LONG_S = 30.0

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


@pytest.fixture
def commands(tmp_path: Path) -> dict[str, list[str]]:
    """Commands that start the program of each language."""
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
def python(master: Master) -> Iterator[nep.node]:
    with nep.node("python") as own:
        yield own


def subscriber_count(node: nep.node) -> int:
    return sum(len(topic.subscribers) for topic in node.graph().topics.values())


def received(printed: Path, talker: str) -> list[Any]:
    lines = printed.read_text("utf-8").splitlines()
    return [message for topic, message in map(json.loads, lines) if topic == f"from_{talker}"]


def test_messages_arrive_whole_and_in_order_in_all_nine_directions(
    commands: dict[str, list[str]], python: nep.node, tmp_path: Path
) -> None:
    topics = [f"from_{language}" for language in LANGUAGES]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MONO_PATH": str(mono_programs.BUILD)}
    with ExitStack() as stack:

        def started(language: str, *arguments: str) -> subprocess.Popen[bytes]:
            output = stack.enter_context((tmp_path / f"{arguments[0]}_{language}").open("wb"))
            command = [*commands[language], *arguments]
            process = subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=output)
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        listeners = [started(language, "listen", str(COUNT), *topics) for language in LANGUAGES]
        eventually(lambda: subscriber_count(python) == len(LANGUAGES) ** 2)
        talkers = [started(language, "talk", str(COUNT), f"from_{language}") for language in LANGUAGES]
        exit_codes = [process.wait(LONG_S) for process in (*talkers, *listeners)]
    assert exit_codes == [0] * 6
    messages = [{"number": number, "message": "x" * number * 2000 + 'grüß\n"🤖"'} for number in range(COUNT)]
    for listener in LANGUAGES:
        for talker in LANGUAGES:
            heard = received(tmp_path / f"listen_{listener}", talker)
            assert [each["number"] for each in heard] == list(range(COUNT)), (talker, listener)
            assert heard == messages, (talker, listener)
