"""Topics as a tree by the slashes in their names: folders with the sums of what is below them."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
from fnmatch import translate
from typing import TypeVar

from app.core.network.topics import Topic, key_of

Number = TypeVar("Number", int, float)
DEEPEST = 12
"""Slashes below this do not make folders any more: no window is wide enough to indent them."""


def parts_of_name(name: str) -> tuple[str, ...]:
    """What stands between the slashes of a topic's name, `DEEPEST` folders at most; never nothing."""
    parts = [part for part in name.split("/") if part]
    if not parts:
        return (name,)
    return (*parts[:DEEPEST], "/".join(parts[DEEPEST:])) if len(parts) > DEEPEST else tuple(parts)


def folder_key(network: str, path: str) -> str:
    """The key of the folder of this path; as a pattern it fits every topic in it."""
    return key_of(network, f"{path}*")


@dataclass(frozen=True, slots=True)
class FolderFigures:
    """The figures of all topics below a folder that are there; None where none of them tells one.

    ``rate_hz`` and ``bandwidth_Bps`` are sums, ``lost`` too; ``age_s`` is that of the newest message.
    """

    rate_hz: float | None = None
    bandwidth_Bps: float | None = None  # noqa: N815  bytes a second, as the vocabulary spells it
    age_s: float | None = None
    lost: int | None = None


@dataclass(slots=True, eq=False)
class TopicFolder:
    """A folder: its last ``name``, its whole ``path`` ("/robot/arm/"), how ``deep`` it is, what is in it.

    ``topics`` are all topics below, in deeper folders too; ``key`` tells it from every topic and from folders
    of other networks. ``is_open`` says whether what is in it is shown.
    """

    name: str
    path: str
    network: str
    deep: int
    is_open: bool = True
    topics: list[Topic] = field(default_factory=list)
    inside: list[TopicFolder | Topic] = field(default_factory=list)
    _figures: FolderFigures | None = None

    @property
    def key(self) -> str:
        """Its name among the folders and topics of all networks: "/robot/*", which is no topic's name."""
        return folder_key(self.network, self.path)

    @property
    def figures(self) -> FolderFigures:
        """The sums as they were when `renew` was called last, or at the first question after it."""
        if self._figures is None:
            there = [topic for topic in self.topics if topic.gone_s is None]
            self._figures = FolderFigures(
                _sum(topic.rate_hz for topic in there),
                _sum(topic.bandwidth_Bps for topic in there),
                min((topic.age_s for topic in there if topic.age_s is not None), default=None),
                _sum(topic.lost for topic in there),
            )
        return self._figures

    def renew(self) -> None:
        """The figures of the topics may have changed: add them up again when somebody asks."""
        self._figures = None


TreeRow = TopicFolder | Topic


def _sum(values: Iterable[Number | None]) -> Number | None:
    known = [value for value in values if value is not None]
    return sum(known) if known else None


class TopicTree:
    """Topics in the folders that their names make; a topic may have the name of a folder beside it."""

    def __init__(self, topics: Iterable[Topic], closed: Collection[str] = ()) -> None:
        """``closed`` are the keys of the folders that are closed; all others are open."""
        self._closed = closed
        self._folders: dict[str, TopicFolder] = {}
        self._top: list[TreeRow] = []
        for topic in topics:
            self._put(topic)

    def __contains__(self, key: object) -> bool:
        """Whether there is a folder of that key."""
        return key in self._folders

    def __getitem__(self, key: str) -> TopicFolder:
        """The folder of that key; KeyError when there is none."""
        return self._folders[key]

    def __iter__(self) -> Iterator[TopicFolder]:
        """All folders."""
        return iter(self._folders.values())

    def rows(self, ordered: Callable[[list[TreeRow]], list[TreeRow]]) -> list[TreeRow]:
        """What is shown from top to bottom: folders, and below each open one what is in it.

        ``ordered`` puts the rows of one folder into their order.
        """
        rows: list[TreeRow] = []
        waiting = ordered(self._top)[::-1]
        while waiting:
            row = waiting.pop()
            rows.append(row)
            if isinstance(row, TopicFolder) and row.is_open:
                waiting += ordered(row.inside)[::-1]
        return rows

    def renew(self) -> None:
        """The figures of topics may have changed."""
        for folder in self._folders.values():
            folder.renew()

    def _put(self, topic: Topic) -> None:
        inside, path = self._top, "/"
        for deep, part in enumerate(parts_of_name(topic.name)[:-1]):
            path = f"{path}{part}/"
            folder = self._folders.get(folder_key(topic.network, path))
            if folder is None:
                folder = TopicFolder(part, path, topic.network, deep)
                folder.is_open = folder.key not in self._closed
                self._folders[folder.key] = folder
                inside.append(folder)
            folder.topics.append(topic)
            inside = folder.inside
        inside.append(topic)


def folders_above(topic: str, network: str = "") -> list[str]:
    """The keys of the folders that a topic is in, the outermost first."""
    parts = parts_of_name(topic)[:-1]
    return [folder_key(network, f"/{'/'.join(parts[: count + 1])}/") for count in range(len(parts))]


def fits(words: Iterable[str]) -> Callable[[str, str], bool]:
    """Whether a topic fits every one of these words; asked with its name and with all that is told of it.

    A word with ``*`` or ``?`` is a pattern for the whole name (``*`` is any text, slashes too), ``!`` before
    a word leaves out what fits it; other words are found anywhere. Case does not matter.
    """
    wanted: list[tuple[bool, re.Pattern[str] | str]] = []
    for word in words:
        leaves_out = word.startswith("!") and len(word) > 1
        text = (word[1:] if leaves_out else word).casefold()
        is_pattern = "*" in text or "?" in text
        wanted.append((leaves_out, re.compile(translate(text)) if is_pattern else text))

    def fit(name: str, told: str) -> bool:
        name, told = name.casefold(), told.casefold()
        for leaves_out, what in wanted:
            found = what in told if isinstance(what, str) else what.match(name) is not None
            if found is leaves_out:
                return False
        return True

    return fit
