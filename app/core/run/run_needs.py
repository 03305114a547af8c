"""What a run needs of the rest of Studio."""

from __future__ import annotations

from typing import Protocol

from app.core.documents.document import Document
from app.core.robots.stop import RobotStopper


class Network(Protocol):
    """What a run needs of the network."""

    address: str
    stopper: RobotStopper | None


class Behaviours(Protocol):
    """What a run needs of the behaviours that are open."""

    @property
    def current(self) -> Document:
        """The one that shows; Run runs it."""
        ...
