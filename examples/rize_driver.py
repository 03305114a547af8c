"""Robot driver for RIZE and blocks with the original nep: ``pip install nep==0.5.3.5 tornado simplejson``.

    python rize_driver.py Turtle

Receives commands on ``robot_action``, executes those for its robot, and replies on ``action_state``.
"""

import sys

import nep

name = sys.argv[1] if len(sys.argv) > 1 else "Turtle"


def say(text: str, options: dict) -> None:
    print(f"{name} says: {text} {options}", flush=True)


def walk(direction: str, options: dict) -> None:
    print(f"{name} walks {direction}: {options}", flush=True)


def listed(one_or_many: object) -> list:
    return one_or_many if isinstance(one_or_many, list) else [one_or_many]


does = {"say": say, "walk": walk}
node = nep.node(name + "_driver")
commands = node.new_sub("robot_action", "json")
answers = node.new_pub("action_state", "json")
node.new_pub("rize_event", "json").publish({"robot": "ready", "name": name})

while True:
    arrived, command = commands.listen(True)
    if not arrived or name not in listed(command["robots"]):
        continue
    if command["node"] == "cancel":  # Stop was pressed
        print(f"{name} stops", flush=True)
        continue
    parts = listed(command["primitives"])
    known = all(part["primitive"] in does for part in parts)
    for part in parts if known else []:
        does[part["primitive"]](part["input"], part["options"])
    command["state"] = "success" if known else "failure"
    answers.publish(command)
