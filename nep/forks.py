"""Forks: what a child that this process forks is told to forget (Linux, macOS).

A child has a copy of the memory, but no other thread than the one that forked: the threads that serve
sockets are missing, locks stay as they were held, and every descriptor is the parent's too. So nothing that
serves sockets can be used or even closed in a child: one byte to an inherited descriptor would reach the
parent's threads. Objects that own such things are watched here, and told when they are in a child.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from typing import Protocol
from weakref import WeakSet

__all__ = ["Inherited", "in_child", "watch"]


class Inherited(Protocol):
    """Something that a forked child inherits and cannot use."""

    def forked(self) -> None:
        """This is a child now: be closed, without taking a lock or touching a socket of ZeroMQ's."""


_watched: WeakSet[Inherited] = WeakSet()
_calls: list[Callable[[], None]] = []


def watch(owner: Inherited) -> None:
    """Tell `owner` in every child; it is not kept alive."""
    _watched.add(owner)


def in_child(call: Callable[[], None]) -> None:
    """Call this in every child, after all owners were told. For modules."""
    _calls.append(call)


def _tell() -> None:
    owners = list(_watched)
    _watched.clear()
    for tell in (*(owner.forked for owner in owners), *_calls):
        with contextlib.suppress(Exception):  # one that fails must not leave the others as they were
            tell()


if sys.platform != "win32":
    os.register_at_fork(after_in_child=_tell)
