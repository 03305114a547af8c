"""Native program that a test controls through pipes; see python_peer.py."""

import json
import sys

import numpy as np

import nep

role, topic, msg_type, mode, name = sys.argv[1:6]


def say(value):
    sys.stdout.write("\x1e" + json.dumps(value) + "\n")
    sys.stdout.flush()


def painted(told):
    if msg_type != "image":
        return told
    return np.full(told["shape"], told["bgr"], np.uint8)


def seen(value):
    if msg_type != "image":
        return value
    return {"bgr": [round(float(each)) for each in value.mean(axis=(0, 1))], "shape": list(value.shape)}


node = nep.node(name)
conf = node.hybrid(mode=mode)
if role == "publisher":
    pub = node.new_pub(topic, msg_type, conf)
    say("ready")
    for line in sys.stdin:
        pub.publish(painted(json.loads(line)))
else:
    sub = node.new_sub(topic, msg_type, conf)
    say("ready")
    while True:
        ok, message = sub.listen(True)
        if ok:
            say({"got": seen(message)})
