"""What a program file calls: ``from app.blocks.commands import robot, run, wait``.

The same functions as in Studio, for the one program of this process. ``run("Greeting")`` at the end of the
file finds the robots, runs all scripts and tells the robots to stop when it ends, also at Ctrl+C.
"""

from __future__ import annotations

import sys

from app.blocks.runtime import lists, values
from app.blocks.runtime.find_robots import find_robots
from app.blocks.runtime.interrupts import without_interrupts
from app.blocks.runtime.network import Network
from app.blocks.runtime.runtime import Runtime, stop_script
from nep import node as new_node
from nep.i18n import _
from nep.system.streams import prepare_streams

__all__ = [
    "add_item", "contains", "each", "fail", "insert_item", "is_known", "item", "join", "join_items", "length",
    "new_list", "newest", "on_message", "on_start", "on_true", "part", "position", "publish",
    "random_number", "remove_item", "repeat", "robot", "rounded", "rounded_down", "rounded_up", "run",
    "set_item", "split_text", "stop_program", "stop_script", "wait", "wait_until", "write",
]  # fmt: skip


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")


_runtime = Runtime(_say)

fail = _runtime.fail
newest = _runtime.newest
on_message = _runtime.on_message
on_start = _runtime.on_start
on_true = _runtime.on_true
publish = _runtime.publish
robot = _runtime.robot
stop_program = _runtime.stop_program
wait = _runtime.wait
wait_until = _runtime.wait_until
write = _runtime.write

is_known = values.is_known
join = values.join
length = values.length
part = values.part
random_number = values.random_number
repeat = values.repeat
rounded = values.rounded
rounded_down = values.rounded_down
rounded_up = values.rounded_up

add_item = lists.add_item
contains = lists.contains
each = lists.each
insert_item = lists.insert_item
item = lists.item
join_items = lists.join_items
new_list = lists.new_list
position = lists.position
remove_item = lists.remove_item
set_item = lists.set_item
split_text = lists.split_text

LOOK_S = 3.0
STOP_ANSWER_S = 1.0


def run(name: str) -> None:
    """Run all scripts until they end or Ctrl+C; SystemExit with a sentence when a block fails."""
    prepare_streams()  # what a script writes may have letters that a pipe of Windows has not
    with new_node(f"program {name}") as node:
        found = find_robots(node, LOOK_S)
        for claim in found.claims:
            _say(claim)
        owners = {robot: owner.node_id for robot, owner in found.owners.items()}
        network = Network(node, f"program {name}", found.robots, owners=owners)
        try:
            _runtime.start(network, found.robots)
            while not _runtime.finished.wait(0.1):
                pass
        except KeyboardInterrupt:
            pass
        finally:
            with without_interrupts():
                _runtime.scheduler.stop()
                moving = network.stop_robots(STOP_ANSWER_S)
                wrong = [network.stop_words(robot) for robot in moving]
                network.close()
    for words in wrong:
        _say(_("{words}. Switch it off by hand.").format(words=words))
    if _runtime.error is not None:
        sys.exit(_runtime.error.sentence)
