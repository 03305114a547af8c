"""Interface of the parts of a session."""

from __future__ import annotations

from typing import Protocol


class SessionPart:
    """Part of a session. All methods are called in the main thread and must not block, except `close`.

    A part that raises an exception is reported with its `task`; the other parts continue.

    Attributes:
        task: Translatable phrase that completes "Studio can't ..." when the part fails, such as "update the
            robots"; marked with `lazy`.
    """

    task = ""

    @property
    def name(self) -> str:
        """Name of the part in the log."""
        return type(self).__name__

    def start(self) -> None:
        """Start the part, with its threads and processes."""

    def tick(self) -> None:
        """Apply what has happened since the last tick. Called 30 times a second."""

    def check(self) -> None:
        """Look for problems and save changes. Called once a second."""

    def close(self) -> None:
        """Save changes, and stop the threads and processes of the part."""


class SupportsClose(Protocol):
    """Object that must be closed."""

    def close(self) -> None:
        """Stop the threads of the object."""


class Resource(SessionPart):
    """Part that only closes an object."""

    def __init__(self, resource: SupportsClose) -> None:
        self._resource = resource

    @property
    def name(self) -> str:
        """Name of the object's class."""
        return type(self._resource).__name__

    def close(self) -> None:
        """Close the object."""
        self._resource.close()
