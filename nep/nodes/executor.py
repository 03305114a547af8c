"""Executor: callbacks and timers of several nodes in one thread, also of different back ends.

The nodes take turns: in each round every timer that is due is called, and every callback that has a message
gets one. What comes on one topic comes in order; nobody notes what came first on two of them, so of those
that have something at the same time none is before its turn, and none waits for more than one round.
"""

from __future__ import annotations

from collections.abc import Sequence

from nep.backends.services import CallQueue
from nep.nodes.shared_wait import SharedWait
from nep.nodes.subscriber import SLICE_S
from nep.nodes.work import Work

__all__ = ["spin_all"]


def spin_all(works: Sequence[Work], timeout_s: float | None) -> None:
    """Do this work until all nodes are stopped or closed, or for `timeout_s` seconds, in this thread.

    A node that is stopped leaves; the others go on. What a callback raises comes out here. In a child that is
    forked it raises `ClosedError`. Raises `TooManyFilesError`.
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
        while running := _still_running(running):
            left = SLICE_S if deadline is None else min(SLICE_S, deadline - clock())
            if left <= 0.0:
                return
            if any([each.run() for each in running if each.is_running]):  # noqa: C419 - all of them
                continue
            left = min(left, *(each.due_s for each in running))
            if left > 0.0:
                _wait(waits, running, left)
        for each in works:
            each.check_not_forked()
    finally:
        for each in works:
            each.unwatch(waits)
            each.begin_anew()
        waits.close()


def _still_running(works: Sequence[Work]) -> list[Work]:
    """Those that go on; one that was stopped may be spun by somebody else from now on."""
    running = [each for each in works if each.is_running]
    for each in works:
        if each not in running:
            each.begin_anew()
    return running


def _wait(waits: SharedWait, works: Sequence[Work], timeout_s: float) -> None:
    """Until one of them has something to do. Nothing stays armed: who reads nothing keeps nobody waiting."""
    entered: list[CallQueue] = []
    try:
        for each in (queue for work in works for queue in work.services.queues):
            if not each.enter_wait(waits.wake):
                return
            entered.append(each)
        if all(waits.arm(each) for work in works for each in work.waiting):
            waits.wait(timeout_s)
    finally:
        waits.disarm_all()
        for each in entered:
            each.leave_wait(waits.wake)
