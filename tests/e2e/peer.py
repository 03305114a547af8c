# ruff: noqa: T201
"""Program outside Studio for the end-to-end tests: ``python peer.py publish|hear TOPIC``.

`publish` sends {"n": 0}, {"n": 1}, … a hundred times per second until its input is closed, then prints
their number. `hear` prints each received number as a line until it is killed.
"""

from __future__ import annotations

import sys
import threading

import nep

what, topic = sys.argv[1:]
with nep.node(f"{what}er", wait_s=20) as node:
    if what == "publish":
        publisher = node.new_pub(topic, "json")
        ended = threading.Event()
        threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
        number = 0
        print("ready", flush=True)
        while not ended.wait(0.01):
            publisher.publish({"n": number})
            number += 1
        print(number, flush=True)
    else:
        subscriber = node.new_sub(topic, "json")
        print("ready", flush=True)
        while True:
            message = subscriber.receive(30.0)
            if message is not None:
                print(message.payload["n"], flush=True)
