"""Tests of nep-js with its original version 0.1.1: the same program runs with both packages."""

from __future__ import annotations

import pytest

import nep
from tests.clients.node_programs import NEEDS_NODE, build_package, prepared
from tests.interop.conftest import SCRIPTS
from tests.nep.programs import eventually

pytestmark = [*NEEDS_NODE, pytest.mark.ports, pytest.mark.interop]

CLASSES = """\
const nep = require("nep-js");
const zmq = require("zeromq/v5-compat");
const say = (value) => process.stdout.write("\\x1e" + JSON.stringify(value) + "\\n");

const conf = { transport: "ZMQ", network: "broker", mode: "many2many", master_ip: "127.0.0.1" };
const publisher = new nep.publisher("classes", "answers", "json", conf);
new nep.subscriber("classes", "questions", "json", (message) => publisher.publish(message), conf);
const client = new nep.client("/double", "classes", (answer) => say({ got: answer }));
client.send_info(21);
function register(requester) {
  const registered = (answer) => say({ got: typeof answer.port });
  const [socket, mode] = ["publisher", "many2many"];
  nep.masterRegister("old", "t", "127.0.0.1", 7000, socket, mode, process.pid, registered, "json", requester);
}
register(zmq.socket("req"));
try {
  register({});
} catch (error) {
  say({ got: error.name });
}
say("ready");
"""


@pytest.fixture
def start(peers, master, tmp_path):
    """Function that starts a program with the nep-js of this repository."""
    build_package()

    def run(script: str, *arguments: str):
        node, program = prepared(script, tmp_path)
        return peers.run([node, str(tmp_path / program), *arguments])

    return run


def test_program_written_for_the_original_package_exchanges_messages_with_the_original(peers, start):
    program = (SCRIPTS / "javascript_peer.js").read_text(encoding="utf-8")
    subscribers = [
        peers.start("nep-js", "subscriber", "to_old"),
        start(program, "subscriber", "to_new", "json", "", "new_receiver"),
    ]
    publishers = [
        start(program, "publisher", "to_old", "json", "", "new_sender"),
        peers.start("nep-js", "publisher", "to_new"),
    ]
    for each in (*subscribers, *publishers):
        each.wait_ready()
    for publisher, subscriber in zip(publishers, subscribers, strict=True):
        message = {"text": "grüß dich", "list": [1, None]}

        def is_heard(publisher=publisher, subscriber=subscriber, message=message) -> bool:
            publisher.tell(message)
            return subscriber.hears(message, 0.1)

        eventually(is_heard)


def test_classes_of_the_original_package_call_services_and_exchange_messages(start):
    with nep.node("python") as python:
        python.new_server("/double", lambda request: 2 * request, threads=1)
        answers = python.new_sub("answers", "json")
        program = start(CLASSES).wait_ready()
        for value in (42, "number", "NepError"):
            assert program.hears(value), program.printed
        python.new_pub("questions", "json").publish({"n": 1})
        assert answers.listen(True) == (True, {"n": 1})
