"""Tree of topics by the slashes in their names. Folders show the totals of their topics."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from fnmatch import translate
from typing import TypeVar

from app.core.network.topics import Topic, key_of

Number = TypeVar("Number", int, float)
MAX_DEPTH = 12
"""Maximum depth of folders.

Deeper levels remain part of the topic's name, because no window is wide enough.
"""


def split_name(name: str) -> tuple[str, ...]:
    """Split the name of a topic at its slashes into at most `MAX_DEPTH` folders and a non-empty rest."""
    parts = [part for part in name.split("/") if part]
    if not parts:
        return (name,)
    return (*parts[:MAX_DEPTH], "/".join(parts[MAX_DEPTH:])) if len(parts) > MAX_DEPTH else tuple(parts)


def folder_key(network: str, path: str) -> str:
    """Return the key of the folder with this path.

    The key is a pattern that matches every topic in the folder.
    """
    return key_of(network, f"{path}*")


@dataclass(frozen=True, slots=True)
class FolderStats:
    """Statistics of all existing topics in a folder. Each value is None if no topic reports it.

    Attributes:
        rate_hz: Total message rate.
        bandwidth_Bps: Total bandwidth in bytes per second.
        age_s: Age of the newest message in seconds.
        lost: Total number of lost messages.
    """

    rate_hz: float | None = None
    bandwidth_Bps: float | None = None  # noqa: N815  unit: bytes per second
    age_s: float | None = None
    lost: int | None = None


@dataclass(slots=True, eq=False)
class TopicFolder:
    """Folder of topics.

    Attributes:
        name: Last part of the path.
        path: Whole path, such as "/robot/arm/".
        depth: Depth in the tree, 0 for a top-level folder.
        is_expanded: True if the folder is expanded.
        topics: All topics in the folder and its subfolders.
        children: Topics and subfolders directly in the folder.
    """

    name: str
    path: str
    network: str
    depth: int
    is_expanded: bool = True
    topics: list[Topic] = field(default_factory=list)
    children: list[TopicFolder | Topic] = field(default_factory=list)
    _stats: FolderStats | None = None

    @property
    def key(self) -> str:
        """Key that is unique among the folders and topics of all networks, such as "/robot/*"."""
        return folder_key(self.network, self.path)

    @property
    def stats(self) -> FolderStats:
        """Statistics, computed at the first access after `invalidate_stats`."""
        if self._stats is None:
            existing_topics = [topic for topic in self.topics if topic.gone_s is None]
            self._stats = FolderStats(
                _sum(topic.rate_hz for topic in existing_topics),
                _sum(topic.bandwidth_Bps for topic in existing_topics),
                min((topic.age_s for topic in existing_topics if topic.age_s is not None), default=None),
                _sum(topic.lost for topic in existing_topics),
            )
        return self._stats

    def invalidate_stats(self) -> None:
        """Invalidate the statistics."""
        self._stats = None


TreeRow = TopicFolder | Topic


def _sum(values: Iterable[Number | None]) -> Number | None:
    known_values = [value for value in values if value is not None]
    return sum(known_values) if known_values else None


class TopicTree:
    """Topics arranged in folders by their names. A topic and a folder may have the same name."""

    def __init__(self, topics: Iterable[Topic], collapsed_keys: Collection[str] = ()) -> None:
        # `collapsed_keys` are the keys of collapsed folders.
        self._collapsed_keys = collapsed_keys
        self._folders: dict[str, TopicFolder] = {}
        self._top_rows: list[TreeRow] = []
        for topic in topics:
            self._insert(topic)

    def __contains__(self, key: object) -> bool:
        return key in self._folders

    def __getitem__(self, key: str) -> TopicFolder:
        return self._folders[key]

    def __iter__(self) -> Iterator[TopicFolder]:
        return iter(self._folders.values())

    def rows(self, sort_rows: Callable[[list[TreeRow]], list[TreeRow]]) -> list[TreeRow]:
        """Return the visible rows from top to bottom.

        Args:
            sort_rows: Sorts the rows of one folder.
        """
        rows: list[TreeRow] = []
        pending_rows = sort_rows(self._top_rows)[::-1]
        while pending_rows:
            row = pending_rows.pop()
            rows.append(row)
            if isinstance(row, TopicFolder) and row.is_expanded:
                pending_rows += sort_rows(row.children)[::-1]
        return rows

    def invalidate_stats(self) -> None:
        """Invalidate the statistics of all folders."""
        for folder in self._folders.values():
            folder.invalidate_stats()

    def _insert(self, topic: Topic) -> None:
        siblings, path = self._top_rows, "/"
        for depth, part in enumerate(split_name(topic.name)[:-1]):
            path = f"{path}{part}/"
            folder = self._folders.get(folder_key(topic.network, path))
            if folder is None:
                folder = TopicFolder(part, path, topic.network, depth)
                folder.is_expanded = folder.key not in self._collapsed_keys
                self._folders[folder.key] = folder
                siblings.append(folder)
            folder.topics.append(topic)
            siblings = folder.children
        siblings.append(topic)


def folders_above(topic: str, network: str = "") -> list[str]:
    """Return the keys of the folders that contain a topic, outermost first."""
    parts = split_name(topic)[:-1]
    return [folder_key(network, f"/{'/'.join(parts[: count + 1])}/") for count in range(len(parts))]


def topic_filter(words: Iterable[str]) -> Callable[[str, str], bool]:
    """Return a predicate (name, details) that is True for topics that match all words, ignoring case.

    A word with ``*`` or ``?`` is a pattern for the whole name (``*`` also matches slashes). A word that
    starts with ``!`` excludes the topics that match the rest of the word. Any other word may occur
    anywhere in the details.
    """
    conditions: list[tuple[bool, re.Pattern[str] | str]] = []
    for word in words:
        is_exclusion = word.startswith("!") and len(word) > 1
        text = (word[1:] if is_exclusion else word).casefold()
        is_pattern = "*" in text or "?" in text
        conditions.append((is_exclusion, re.compile(translate(text)) if is_pattern else text))

    def matches(name: str, details: str) -> bool:
        name, details = name.casefold(), details.casefold()
        for is_exclusion, condition in conditions:
            is_match = (
                condition in details if isinstance(condition, str) else condition.match(name) is not None
            )
            if is_match is is_exclusion:
                return False
        return True

    return matches
