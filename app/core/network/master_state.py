"""Whether a master is there, and whether it knows everybody yet."""

from __future__ import annotations

from dataclasses import dataclass

from nep.protocol.graph_view import GraphView

LEARNING_S = 1.5
"""How long a master that has just started may not know everybody yet (it learns for one second)."""


@dataclass(frozen=True, slots=True)
class MasterState:
    """Whether a master is there: ``searching``, ``connected`` or ``none``, its address, and a sentence."""

    kind: str
    address: str
    sentence: str = ""


class Learning:
    """Notices that another master has come. One thread uses it (the window's)."""

    def __init__(self) -> None:
        """Have seen no other master yet."""
        self._new_epoch = (0, 0.0)

    def still(self, known: GraphView | None, view: GraphView, now: float) -> bool:
        """Whether ``view`` is of another master than ``known`` and may lack people: they have not gone."""
        if known is None or view.epoch == known.epoch:
            return False
        if self._new_epoch[0] != view.epoch:
            self._new_epoch = (view.epoch, now)
        return now - self._new_epoch[1] < LEARNING_S
