"""One end of a ping-pong with the original NEP, `nep` 0.5.3.5 in Python 2.7, as in the paper.

`END` is its program, a string because it runs in another Python. It uses the same protocol as
`paper_ends.py` and supports the kinds `string` and `json`. Each end binds a publisher of each kind
and subscribes to those of the other end, without a master (`one2many`), so that it also works between
two networks. The library does not report when a subscriber has connected, so each end waits for a
second.
"""

from __future__ import annotations

import subprocess
import tempfile

__all__ = ["END", "KINDS", "ROW", "why_missing"]

ROW = "nep 0.5.3.5"
KINDS = ("string", "json")
END = r"""
from __future__ import unicode_literals
import json, os, random, socket, sys, threading, time
own = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # what the library prints must not be taken for an answer
import nep
role, _, host, _ = [str(each) for each in sys.argv[1:]]
WAIT_S = 20.0
there, back = ("ping", "pong") if role == "ping" else ("pong", "ping")

def answer(said):
    own.write(json.dumps(said) + "\n")
    own.flush()

def free_port():
    free = socket.socket()
    free.bind((host, 0))
    port = free.getsockname()[1]
    free.close()
    return port

def payload(kind, size):
    mark = "".join(random.choice("abcdefghijklmnop") for _ in range(min(size, 16)))
    text = mark + "x" * (size - len(mark))
    return {"data": text} if kind == "json" else text

def give_up():
    answer({"not run": "a message did not come back"})
    os._exit(1)

def lines():
    while True:  # iterating reads ahead in Python 2
        line = sys.stdin.readline()
        if not line:
            return
        yield json.loads(line)

node = nep.node(role)
outs, ports = {}, []
for kind in ("string", "json"):
    port = free_port()
    conf = node.direct(host, str(port), str("one2many"))
    outs[kind] = node.new_pub(str(there + "_" + kind), str(kind), conf)
    ports.append(str(port))
asked = lines()
answer({"end": host + " " + " ".join(ports)})
its_host, string_port, json_port = next(asked).split()
ins = {}
for kind, port in (("string", string_port), ("json", json_port)):
    conf = node.direct(str(its_host), str(port), str("one2many"))
    ins[kind] = node.new_sub(str(back + "_" + kind), str(kind), conf)
time.sleep(1)
answer({"ready": True})
for kind, size, count in asked:
    taken = []
    for _ in range(count):
        value = payload(kind, size) if role == "ping" else None
        watch = threading.Timer(WAIT_S, give_up)
        watch.start()
        began = time.time()
        if role == "ping":
            outs[kind].publish(value)
        came = ins[kind].listen(True)[1]
        if role == "ping":
            taken.append(time.time() - began)
            if came != value:
                answer({"not run": "another message came back"})
                os._exit(1)
        else:
            outs[kind].publish(came if kind == "json" else came.decode("utf-8"))
        watch.cancel()
    answer({"taken": taken})
os._exit(0)
"""


def why_missing(python2: str) -> str:
    """Return why the row can't run with this interpreter, or an empty string."""
    asked = "import sys, nep, zmq; print(sys.version_info[0], hasattr(nep.node, 'direct'))"
    try:
        done = subprocess.run(
            [python2, "-E", "-c", asked],
            cwd=tempfile.gettempdir(),  # outside the repository, which contains our nep package
            capture_output=True,
            text=True,
            check=False,
            timeout=30,
        )
    except (OSError, subprocess.TimeoutExpired):
        return f"there is no '{python2}'; give a Python 2.7 that has nep 0.5.3.5 with --python2"
    if done.stdout.strip() != "(2, True)":
        return f"'{python2}' is no Python 2.7 with the package nep 0.5.3.5"
    return ""
