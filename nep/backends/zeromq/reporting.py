"""Reporting: what an inlet counts, and what is wrong with what came."""

from __future__ import annotations

from typing import Generic, TypeVar

from nep.backends.base import SubscriberSpec
from nep.backends.zeromq.readable import Readable
from nep.protocol.records import SubscriberCount, as_count

__all__ = ["R", "Reporting"]

R = TypeVar("R", bound=Readable)


class Reporting(Generic[R]):
    """The part of an inlet that tells of `readable`."""

    def __init__(self, readable: R, spec: SubscriberSpec) -> None:
        self.spec = spec
        self._readable = readable
        self._problem = ""

    @property
    def received(self) -> int:
        """Messages that arrived."""
        return self._readable.received

    @property
    def lost(self) -> int | None:
        """Messages that did not arrive, or were dropped here for lack of room."""
        return self._readable.lost

    @property
    def refused(self) -> int:
        """What came and was no message at all."""
        return self._readable.refusals.count

    def report(self, problem: str) -> None:
        """The reader's trouble with a message, for the next renewal."""
        self._problem = problem

    def counts(self) -> SubscriberCount:
        """The statistics for a renewal."""
        problem = self._problem or self._readable.refusals.told() or self._readable.problem
        lost = None if self.lost is None else as_count(self.lost)
        return SubscriberCount(self.spec.id, as_count(self.received), lost, problem)
