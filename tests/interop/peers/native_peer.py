"""A native program, driven by a test over its pipes: see python_peer.py."""

import json
import sys

import nep

role, topic, msg_type, mode, name = sys.argv[1:6]


def say(value):
    sys.stdout.write("\x1e" + json.dumps(value) + "\n")
    sys.stdout.flush()


node = nep.node(name)
conf = node.hybrid(mode=mode)
if role == "publisher":
    pub = node.new_pub(topic, msg_type, conf)
    say("ready")
    for line in sys.stdin:
        pub.publish(json.loads(line))
else:
    sub = node.new_sub(topic, msg_type, conf)
    say("ready")
    while True:
        ok, message = sub.listen(True)
        if ok:
            say({"got": message})
