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
    shared_wait = SharedWait()
    for work in works:
        work.watch(shared_wait)
    try:
        running = list(works)
        while running := _running_works(running):
            remaining_s = WAIT_SLICE_S if deadline is None else min(WAIT_SLICE_S, deadline - clock())
            if remaining_s <= 0.0:
                return
            # a generator would stop at the first
            has_run = any([work.run() for work in running if work.is_running])  # noqa: C419
            if has_run or any(work.is_closed for work in running):
                continue
            remaining_s = min(remaining_s, *(work.next_timer_delay_s for work in running))
            if remaining_s > 0.0:
                _wait(shared_wait, running, remaining_s)
        for work in works:
            work.check_not_forked()
    finally:
        for work in works:
            work.unwatch(shared_wait)
            work.reset_stop()
        shared_wait.close()


def _running_works(works: Sequence[Work]) -> list[Work]:
    # Another thread may now spin the stopped node.
    running = [work for work in works if work.is_running]
    for work in works:
        if work not in running:
            work.reset_stop()
    return running


def _wait(shared_wait: SharedWait, works: Sequence[Work], timeout_s: float) -> None:
    # Disarms everything at the end: a subscriber that stays armed but is not read would block its publisher.
    entered_queues: list[CallQueue] = []
    try:
        for call_queue in (queue for work in works for queue in work.services.queues):
            if not call_queue.enter_wait(shared_wait.wake):
                return
            entered_queues.append(call_queue)
        if all(shared_wait.arm(subscriber) for work in works for subscriber in work.waiting_subscribers):
            shared_wait.wait(timeout_s)
    finally:
        shared_wait.disarm_all()
        for call_queue in entered_queues:
            call_queue.leave_wait(shared_wait.wake)
