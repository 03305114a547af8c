"""A program that forks while its client calls its server, where servers have threads of their own."""

from __future__ import annotations

from tests.nep.programs import running

CODE = """
import os, sys, nep
def say(it):
    os.write(1, (str(it) + "\\n").encode())
node = {node}
at = {at}
server = node.new_server("/x", lambda request: node.stop_spin() or request, at)
client = node.new_client("/x", at, timeout_s=30.0)
waiting = client.call_async(2)
while not node._services.queues[0]._calls:
    pass
child = os.fork()
if child == 0:
    try:
        client.call(1)
    except nep.ClosedError as error:
        say(error)
    server.close()
    node.close()
    sys.exit(7)
say(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
node.spin(30.0)
say(waiting.result(30.0))
node.close()
"""


def check_fork(node: str, at: str = "None") -> None:
    """The child is told that what it has is its parent's, and ends; in the parent the call is answered.

    `node` and `at` are Python for the node, and for where its server and client meet.
    """
    with running(CODE.format(node=node, at=at)) as program:
        assert "client of '/x' belongs to the parent process" in program.line()
        assert [program.line() for _ in range(2)] == ["7", "2"]
