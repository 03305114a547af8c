"""Program that forks during a call, for back ends whose servers have their own threads."""

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
    """Check that the child's inherited client raises an error and that the parent's call gets its reply.

    `node` and `at` are Python expressions: the node, and the address where its server and client meet.
    """
    with running(CODE.format(node=node, at=at)) as program:
        assert "client of '/x' belongs to the parent process" in program.line()
        assert [program.line() for _ in range(2)] == ["7", "2"]
