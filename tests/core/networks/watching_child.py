"""Program in which Studio observes ROS 1 or ROS 2.

It is a separate process because rospy can be initialized only once per process, and because the test of
ROS 2 needs a network namespace. The argument is the kind of network. The program prints as JSON what
Studio observed while the other node was running and after it had ended.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
from contextlib import ExitStack
from pathlib import Path

from app.core.network.topics import Topic
from app.core.networks import networks, source
from app.core.networks.source import OtherSource
from app.core.session import Session
from app.core.storage.settings import Settings
from nep.masters.master import Master
from tests.core.waiting import tick_until
from tests.nep.backends.ros_programs import ros_master, told
from tests.nep.programs import running

TALKER = """
import nep, sys, threading
kind, address = sys.argv[1:]
twist = "geometry_msgs/Twist" if kind == "ros" else "geometry_msgs/msg/Twist"
with nep.node("robot", kind, master=address) as node:
    fast = node.new_pub("/fast", twist, qos="" if kind == "ros" else "best_effort")
    text = node.new_pub("/chatter", "string")
    print("ready", flush=True)
    ended = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    while not ended.wait(0.02):
        fast.publish({"linear": {"x": 1.5}})
        text.publish("hello")
"""


def look(kind: str, folder: Path) -> dict[str, object]:
    with Master("127.0.0.1:0") as master, ExitStack() as ends:
        address = ends.enter_context(ros_master(folder)) if kind == "ros" else "7"
        os.environ.update(told(address) if kind == "ros" else {})
        session = Session(
            Settings(folder), address=master.address, journal_folder=folder / "journal", start_processes=False
        )
        session.start()
        try:
            return seen_by(session, kind, address, ends)
        finally:
            session.close()


def seen_by(session: Session, kind: str, address: str, ends: ExitStack) -> dict[str, object]:
    network = session.live.networks.get(kind)
    assert network is not None
    keys = [f"{kind} /fast", f"{kind} /chatter"]

    def topic(key: str) -> Topic:
        return session.shown.topic(key) or Topic(key)

    with running(TALKER, kind, address) as talker:
        assert talker.line() == "ready"
        session.live.networks.select(kind, address)
        for key in keys:
            session.live.watch(key)
        tick_until(session, lambda: all(topic(key).newest for key in keys))
        tick_until(session, lambda: topic(keys[0]).measured_rates is not None and topic(keys[0]).rate_hz)
        tick_until(session, lambda: any("robot" in node.name for node in network.nodes))
        newest = [topic(key).newest for key in keys]
        seen: dict[str, object] = {
            "payloads": [each.payload for each in newest if each is not None],
            "seq": [each.seq for each in newest if each is not None],
            "types": [topic(key).msg_type for key in keys],
            "nodes": sorted(node.name for node in network.nodes),
            "generations": sorted({node.generation for node in network.nodes}),
            "cpu": [node.cpu_ratio for node in network.nodes if "robot" in node.name],
            "native": [each.name for each in session.live.topics if each.name in {"/fast", "/chatter"}],
        }
        talker.end()
    tick_until(session, lambda: topic(keys[0]).gone_s is not None)
    seen["gone"] = [topic(key).gone_s is not None for key in keys]
    if kind == "ros":
        ends.close()  # also kills the master
        tick_until(session, lambda: network.state == "lost")
        seen["lost"] = network.sentence
    session.live.networks.deselect(kind)
    seen["left"] = [network.state, len(session.live.networks.topics)]
    return seen


if __name__ == "__main__":
    OtherSource.poll_interval_s = 0.1
    networks.COUNT_INTERVAL_S, source.RESPONSE_TIMEOUT_S = 0.3, 0.5  # shorter than in the window
    with tempfile.TemporaryDirectory() as made:
        sys.stdout.write(json.dumps(look(sys.argv[1], Path(made))))
    threads = [each.name for each in threading.enumerate() if each.name.startswith("studio-")]
    assert not threads, threads
