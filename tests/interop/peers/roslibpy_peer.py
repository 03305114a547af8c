"""Program that uses roslibpy as its examples do; a test controls it through pipes. See python_peer.py."""

import json
import sys

import roslibpy


def say(value):
    sys.stdout.write("\x1e" + json.dumps(value) + "\n")
    sys.stdout.flush()


def got(value):
    say({"got": dict(value) if hasattr(value, "items") else value})


def failed(reason):
    got({"failed": str(reason)})


def serve(name):
    def handle(request, response):
        response["success"] = request["data"]
        response["message"] = "set"
        return True

    services.append(roslibpy.Service(ros, name, "std_srvs/SetBool"))
    services[-1].advertise(handle)


def listen(name, kind, options=None):
    services.append(roslibpy.Topic(ros, name, kind, **(options or {})))
    services[-1].subscribe(got)


def talk(name, kind, message):
    services.append(roslibpy.Topic(ros, name, kind))
    services[-1].publish(roslibpy.Message(message))


def call(name, args):
    roslibpy.Service(ros, name, "").call(roslibpy.ServiceRequest(args), got, failed)


def ask(method, *given):
    getattr(ros, method)(*given, callback=got, errback=failed)


def get_param(name):
    roslibpy.Param(ros, name).get(got, failed)


services = []
address, port = sys.argv[1].removeprefix("ws://").split(":")
ros = roslibpy.Ros(address, int(port))
ros.run(timeout=60)
say("ready")
steps = {"serve": serve, "listen": listen, "talk": talk, "call": call, "ask": ask, "getParam": get_param}
for line in sys.stdin:
    step, *given = json.loads(line)
    steps[step](*given)
ros.terminate()
