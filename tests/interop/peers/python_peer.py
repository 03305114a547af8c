"""Program of the original NEP (any Python version) that a test controls through pipes.

Arguments: ROLE TOPIC TYPE MODE NAME. A publisher publishes each line of JSON that it reads. A
subscriber writes each message as a line of JSON. A client calls with each line and writes the reply. A
server replies. `client_at` and `server_at` do the same without a master: TOPIC is the port. An image is
represented by the colour that fills it: {"bgr": [b, g, r], "shape": [height, width, 3]}.
"""

import json
import sys
import threading

import nep

role, topic, msg_type, mode, name = sys.argv[1:6]


def say(value):
    sys.stdout.write("\x1e" + json.dumps(value) + "\n")
    sys.stdout.flush()


def painted(told):
    """Return the value that a line of JSON represents; for image types, an image filled with its colour."""
    if not msg_type.startswith("image"):
        return told
    import numpy as np

    picture = np.zeros(told["shape"], np.uint8)
    picture[:] = told["bgr"]
    return picture


def seen(value):
    """Return the JSON representation of a value; for images, the mean colour and the shape."""
    if not msg_type.startswith("image"):
        return value
    return {"bgr": [round(float(each)) for each in value.mean(axis=(0, 1))], "shape": list(value.shape)}


node = nep.node(name)
pause = threading.Event()  # `listen` never blocks for "image" in the original nep
if role == "publisher":
    pub = node.new_pub(topic, msg_type, node.hybrid(mode=mode))
    say("ready")
    for line in sys.stdin:
        pub.publish(painted(json.loads(line)))
elif role == "subscriber":
    sub = node.new_sub(topic, msg_type, node.hybrid(mode=mode))
    say("ready")
    while True:
        ok, message = sub.listen(True)
        if ok:
            say({"got": seen(message)})
        elif msg_type == "image":
            pause.wait(0.01)
elif role in ("client", "client_at"):
    client = node.new_client(topic) if role == "client" else nep.client("127.0.0.1", int(topic))
    say("ready")
    for line in sys.stdin:
        client.send_info(json.loads(line))
        say({"got": client.listen_info()})
elif role in ("server", "server_at"):
    server = node.new_server(topic) if role == "server" else nep.server("127.0.0.1", int(topic))
    say("ready")
    while True:
        asked = server.listen_info()
        server.send_info({"echo": asked})
