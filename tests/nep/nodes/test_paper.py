"""Test of the unmodified listings of the paper, run as processes."""

from __future__ import annotations

import pytest

from nep.masters.master import Master
from tests.nep.programs import Program, running

SENDER = """
import nep
node = nep.node('python_sender')
pub = node.new_pub('example', 'json')
pub.publish({'message': 'hello'})
"""

POLLING = """
import nep
node = nep.node('python_receiver', 'ZMQ')
conf = node.hybrid()
sub = node.new_sub('example', 'json', conf)
print('ready')
while True:
    ok, msg = sub.listen()
    if ok:
        print(msg)
        break
"""

CALLBACK = """
import nep

def callback(message):
    print(message)

node = nep.node('python_callback')
print('made')
sub = node.new_callback('example', 'json', callback)
print('ready')
node.spin()
"""


@pytest.mark.parametrize("receiver", [POLLING, "CALLBACK"])
def test_paper_listings_exchange_a_message(master: Master, receiver: str) -> None:
    with running(CALLBACK if receiver == "CALLBACK" else receiver) as program:
        while program.line() != "ready":
            pass
        sender = Program(SENDER)
        assert program.line() == "{'message': 'hello'}"
        assert sender.end() == ("", "")
        assert sender.process.returncode == 0
