"""Commands of an exported program: ``from app.blocks.commands import robot, run, wait``.

The commands are the functions that programs in Studio use, bound to the single program of this process.
``run("Greeting")`` at the end of the file connects to the robots, runs all scripts, and finally stops the
robots, also after Ctrl+C.

Example::

    from app.blocks.commands import on_start, robot, run, wait

    @on_start
    def greet():
        robot("Pepper").do("say", text="Hello")
        wait(2)

    run("Greeting")
"""

from __future__ import annotations

import sys

from app.blocks.interrupts import without_interrupts
from app.blocks.runtime.network import Network
from app.blocks.runtime.pure.calculation import (
    absolute,
    arc_cosine,
    arc_sine,
    arc_tangent,
    cosine,
    counting,
    e_to_the,
    is_divisible,
    is_even,
    is_negative,
    is_odd,
    is_positive,
    is_whole,
    larger,
    limited,
    logarithm,
    mapped,
    natural_logarithm,
    rounded_to,
    sign,
    sine,
    smaller,
    square_root,
    tangent,
    ten_to_the,
)  # fmt: skip
from app.blocks.runtime.pure.clock import (
    now,
    seconds_since,
)  # fmt: skip
from app.blocks.runtime.pure.lists import (
    add_item,
    average_of,
    clear_list,
    contains,
    copy_of,
    each,
    insert_item,
    is_empty_list,
    item,
    join_items,
    largest_of,
    middle_of,
    new_list,
    part_of_list,
    position,
    remove_item,
    set_item,
    shuffled,
    smallest_of,
    sorted_down,
    sorted_up,
    split_text,
    sum_of,
    turned_round,
)  # fmt: skip
from app.blocks.runtime.pure.texts import (
    backwards,
    ends_with,
    has_in_it,
    has_number,
    in_capitals,
    in_small_letters,
    is_empty,
    letter,
    number_in,
    part_of_text,
    position_in_text,
    replaced,
    same_words,
    starts_with,
    without_spaces_around,
)  # fmt: skip
from app.blocks.runtime.runtime import Runtime, stop_script
from app.blocks.runtime.values import (
    is_known,
    join,
    length,
    part,
    random_number,
    repeat,
    rounded,
    rounded_down,
    rounded_up,
)  # fmt: skip
from app.robots.client.discovery import find_robots
from app.robots.client.limits import DISCOVERY_TIMEOUT_S
from nep import node as new_node
from nep.i18n import _
from nep.system.streams import prepare_streams

__all__ = [
    "absolute", "add_item", "answer", "arc_cosine", "arc_sine", "arc_tangent", "ask", "ask_with_choices",
    "average_of", "backwards", "broadcast", "broadcast_and_wait", "clear_list", "contains", "copy_of",
    "cosine", "counting", "e_to_the", "each", "ends_with", "fail", "has_in_it", "has_number", "in_capitals",
    "in_small_letters", "insert_item", "is_divisible", "is_empty", "is_empty_list", "is_even", "is_known",
    "is_negative", "is_odd", "is_positive", "is_whole", "item", "join", "join_items", "larger",
    "largest_of", "length", "letter", "limited", "logarithm", "mapped", "middle_of", "natural_logarithm",
    "new_list", "newest", "now", "number_in", "on_broadcast", "on_message", "on_start", "on_true", "part",
    "part_of_list", "part_of_text", "position", "position_in_text", "publish", "random_number",
    "remove_item", "repeat", "replaced", "reset_timer", "robot", "rounded", "rounded_down", "rounded_to",
    "rounded_up", "run", "same_words", "seconds_since", "set_item", "shuffled", "sign", "sine", "smaller",
    "smallest_of", "sorted_down", "sorted_up", "split_text", "square_root", "starts_with", "stop_others",
    "stop_program", "stop_script", "sum_of", "tangent", "ten_to_the", "timer", "turned_round", "wait",
    "wait_until", "without_spaces_around", "write",
]  # fmt: skip


def _print(line: str) -> None:
    sys.stdout.write(line + "\n")


_runtime = Runtime(_print)

answer = _runtime.answer
ask = _runtime.ask
ask_with_choices = _runtime.ask_with_choices
broadcast = _runtime.broadcast
broadcast_and_wait = _runtime.broadcast_and_wait
fail = _runtime.fail
newest = _runtime.newest
on_broadcast = _runtime.on_broadcast
on_message = _runtime.on_message
on_start = _runtime.on_start
on_true = _runtime.on_true
publish = _runtime.publish
reset_timer = _runtime.reset_timer
robot = _runtime.robot
stop_others = _runtime.stop_others
stop_program = _runtime.stop_program
timer = _runtime.timer
wait = _runtime.wait
wait_until = _runtime.wait_until
write = _runtime.write


def run(name: str) -> None:
    """Run all scripts until they end or Ctrl+C is pressed, then stop the robots.

    Args:
        name: Name of the program on the network.

    Raises:
        SystemExit: A block failed; the message is an error message for the user.
    """
    prepare_streams()  # scripts may write characters that a Windows pipe can't encode
    with new_node(f"program {name}") as node:
        discovery = find_robots(node, DISCOVERY_TIMEOUT_S)
        for claim in discovery.rejected_claims:
            _print(claim)
        owners = {robot: owner.node_id for robot, owner in discovery.owners.items()}
        network = Network(
            node, f"program {name}", discovery.robots, owners=owners, clock=_runtime.scheduler.clock
        )
        try:
            _runtime.start(network, discovery.robots)
            while not _runtime.finished.wait(0.1):
                pass
        except KeyboardInterrupt:
            pass
        finally:
            with without_interrupts():
                _runtime.scheduler.stop()
                moving = network.stop_robots()
                stop_errors = [network.stop_error(robot) for robot in moving]
                network.close()
    for stop_error in stop_errors:
        _print(_("{words}. Switch it off by hand.").format(words=stop_error))
    if _runtime.error is not None:
        sys.exit(_runtime.error.sentence)
