"""Round-robin scheduler for callbacks and timers of several nodes and back ends in one thread.

In each round every due timer is called, and every callback that has a message gets one message.
Messages of one topic are delivered in order. The order across topics is unknown, so no callback is
served twice before the others, and none waits longer than one round.
"""

from __future__ import annotations

from collections.abc import Sequence

from nep.backends.services import CallQueue
from nep.nodes.shared_wait import SharedWait
from nep.nodes.subscriber import WAIT_SLICE_S
from nep.nodes.work import Work


def spin_all(works: Sequence[Work], timeout_s: float | None) -> None:
    """Run the work of several nodes in this thread until all nodes are stopped or closed.

    The other nodes continue when one is stopped. Exceptions of callbacks propagate.

    Args:
        works: Work of each node.
        timeout_s: Time limit in seconds; None for no limit.

    Raises:
        ClosedError: This is a forked child process.
        TooManyFilesError: The process has too many open files.
    """
    if len(works) == 1:
        works[0].spin(timeout_s)
        return
    clock = works[0].clock
    deadline = None if timeout_s is None else clock() + timeout_s
    waits = SharedWait()
    for each in works:
        each.watch(waits)
    try:
        running = list(works)
        while running := _running_works(running):
            left = WAIT_SLICE_S if deadline is None else min(WAIT_SLICE_S, deadline - clock())
            if left <= 0.0:
                return
            # a generator would stop at the first
            if any([each.run() for each in running if each.is_running]):  # noqa: C419
                continue
            left = min(left, *(each.next_timer_delay_s for each in running))
            if left > 0.0:
                _wait(waits, running, left)
        for each in works:
            each.check_not_forked()
    finally:
        for each in works:
            each.unwatch(waits)
            each.reset_stop()
        waits.close()


def _running_works(works: Sequence[Work]) -> list[Work]:
    # Another thread may now spin the stopped node.
    running = [each for each in works if each.is_running]
    for each in works:
        if each not in running:
            each.reset_stop()
    return running


def _wait(waits: SharedWait, works: Sequence[Work], timeout_s: float) -> None:
    # Disarms everything at the end: a subscriber that stays armed but is not read would block its publisher.
    entered: list[CallQueue] = []
    try:
        for each in (queue for work in works for queue in work.services.queues):
            if not each.enter_wait(waits.wake):
                return
            entered.append(each)
        if all(waits.arm(each) for work in works for each in work.waiting_subscribers):
            waits.wait(timeout_s)
    finally:
        waits.disarm_all()
        for each in entered:
            each.leave_wait(waits.wake)
