"""The backpack: blocks that a person keeps for other files, other Studios and the next start.

One JSON file beside the settings. Several Studios share it: each change is made to what the file says at that
moment, under its lock, so that none undoes another's. What is in it and not understood is never thrown away.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

from app.core.storage import deep_json
from app.core.storage.atomic_file import make_private, read_whole, write_atomically
from app.core.storage.file_lock import locked
from app.core.storage.settings import home
from app.errors import BackpackError
from nep.i18n import _, lazy, ngettext, number
from nep.system.replace_file import replace_file

VERSION = 1
MOST = 100
"""So many stacks of blocks."""
MOST_BYTES = 4_000_000
"""So large is the file at most, in bytes of JSON."""
FULL = lazy("the backpack can hold at most {most} stacks; remove something first")
_APART_S = 0.001
_SPARE = 1_000_000  # what another Studio's file may have more and is read all the same

Json = Mapping[str, object]
Stamp = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Packed:
    """A stack of blocks as Blockly saves it, with its variables' names; ``at`` is when it was put in."""

    id: str
    at: float
    block: Json

    def to_json(self) -> dict[str, object]:
        """As the file and the page have it."""
        return {"id": self.id, "at": self.at, "block": self.block}


class _Found(NamedTuple):
    """What the file says; ``unknown`` is what in it nobody here understands, kept as it is."""

    items: tuple[Packed, ...] = ()
    unknown: tuple[object, ...] = ()


class Backpack:
    """What is in the backpack, the newest first. Every change is written at once, or is a BackpackError."""

    def __init__(self, folder: Path | None = None, clock: Callable[[], float] = time.time) -> None:
        """It is ``backpack.json`` in ``folder`` (default: Studio's own); none yet is an empty one."""
        self.path = (folder if folder is not None else home()) / "backpack.json"
        self.revision = 0
        """Another number whenever there are other things in it."""
        self._clock = clock
        self._known = _Found()
        self._stamp: Stamp | None = None
        self._trouble = ""
        self._told = ""
        make_private(self.path.parent, "backpack*.json")

    @property
    def items(self) -> tuple[Packed, ...]:
        """What is in it as far as is known, the newest first."""
        return self._known.items

    def take_trouble(self) -> str:
        """What was wrong with its file, as a sentence, once; "" for nothing."""
        trouble, self._trouble = self._trouble, ""
        return trouble

    def look(self) -> None:
        """Read the file if it is another one by now: another Studio has written it."""
        if _stamp(self.path) == self._stamp:
            return
        try:
            self._take(self._read())
        except BackpackError as error:
            self._tell(str(error))

    def put(self, blocks: Sequence[Json]) -> list[Packed]:
        """Put in stacks of blocks, the first of them on top. Raises BackpackError when there is no room."""
        # Newer than all that is there, whatever the clock says.
        newest = max([self._clock(), *(item.at + len(blocks) * _APART_S for item in self.items[:1])])
        made = [Packed(uuid4().hex, newest - place * _APART_S, each) for place, each in enumerate(blocks)]
        self.restore(made)
        return made

    def restore(self, items: Sequence[Packed]) -> None:
        """Put in again what was taken out, where it was. Raises BackpackError when there is no room."""
        ids = {item.id for item in items}
        self._change(lambda found: (*(item for item in found if item.id not in ids), *items))

    def remove(self, ids: Sequence[str]) -> list[Packed]:
        """Take these out; what was there of them. Raises BackpackError."""
        gone: list[Packed] = []

        def without(found: tuple[Packed, ...]) -> tuple[Packed, ...]:
            gone.extend(item for item in found if item.id in ids)
            return tuple(item for item in found if item.id not in ids)

        self._change(without)
        return gone

    def empty(self) -> list[Packed]:
        """Take out everything that is known to be in it; what it was. Raises BackpackError."""
        return self.remove([item.id for item in self.items])

    # -- the file -----------------------------------------------------------------------------------------

    def _change(self, change: Callable[[tuple[Packed, ...]], tuple[Packed, ...]]) -> None:
        with locked(self.path):
            found = self._read()
            now = _Found(_sorted(change(found.items)), found.unknown)
            if _ids(now) != _ids(found):
                self._write(now, grows=len(now.items) > len(found.items))
            self._take(now)

    def _take(self, found: _Found) -> None:
        if _ids(found) != _ids(self._known):
            self.revision += 1
        self._known = found
        self._stamp = _stamp(self.path)

    def _write(self, found: _Found, *, grows: bool) -> None:
        if grows and len(found.items) > MOST:
            raise BackpackError(
                _("the backpack can hold at most {most} stacks; remove something first").format(most=MOST)
            )
        whole = {
            "backpack": VERSION,
            "items": [*(item.to_json() for item in found.items), *found.unknown],
        }
        data = deep_json.dumps(whole, ascii=True).encode()
        if grows and len(data) > MOST_BYTES:
            raise BackpackError(
                _("the backpack can hold at most {most} MB; remove something first").format(
                    most=number(MOST_BYTES / 1e6, ".0f")
                )
            )
        try:
            write_atomically(self.path, data, durable=False, private=True)
        except OSError as error:
            raise BackpackError(
                _("can't save the backpack in '{path}': {reason}").format(
                    path=self.path, reason=error.strerror or str(error)
                )
            ) from error

    def _read(self) -> _Found:
        """What the file says. BackpackError when it can't be read now; one that is damaged is set aside."""
        try:
            data = read_whole(self.path, MOST_BYTES + _SPARE)
        except (FileNotFoundError, NotADirectoryError):
            return _Found()
        except OSError as error:
            raise BackpackError(
                _("can't read the backpack from '{path}': {reason}").format(
                    path=self.path, reason=error.strerror or str(error)
                )
            ) from error
        try:
            whole = deep_json.loads(data)
        except (ValueError, RecursionError):
            return self._set_aside()
        if isinstance(whole, dict) and _is_newer(whole.get("backpack")):
            return self._beside()
        if not isinstance(whole, dict) or whole.get("backpack") != VERSION:
            return self._set_aside()
        entries = whole.get("items")
        if not isinstance(entries, list):
            return self._set_aside()
        made = [(entry, _packed(entry)) for entry in entries]
        unknown = tuple(entry for entry, item in made if item is None)
        if unknown:
            self._tell(
                ngettext(
                    "{count} item in the backpack can't be read here; it was saved in '{path}'",
                    "{count} items in the backpack can't be read here; they were saved in '{path}'",
                    len(unknown),
                ).format(count=len(unknown), path=self.path)
            )
        return _Found(_sorted(item for _entry, item in made if item is not None), unknown)

    def _beside(self) -> _Found:
        """Leave the file of a newer Studio alone; from now on there is one of our own beside it."""
        newer = self.path
        self.path = newer.with_name(f"backpack.format-{VERSION}.json")
        if self.path == newer:
            return self._set_aside()
        if not self.path.exists():
            self._tell(
                _(
                    "the backpack in “{file}” belongs to a newer NEP Studio and is unchanged; blocks you add "
                    "here are saved separately"
                ).format(file=newer.name)
            )
        return self._read()

    def _set_aside(self) -> _Found:
        """Begin with an empty one: the file that is no backpack is kept under another name."""
        place = self.path.with_name(f"{self.path.stem}.damaged.json")
        again = 2
        while place.exists():
            place = self.path.with_name(f"{self.path.stem}.damaged-{again}.json")
            again += 1
        try:
            replace_file(self.path, place)
        except OSError as error:
            raise BackpackError(
                _("can't read the backpack from '{path}': {reason}").format(
                    path=self.path, reason=_("it is damaged")
                )
            ) from error
        self._tell(
            _("the backpack is damaged, so a new one was created; the old one is in '{path}'").format(
                path=place
            )
        )
        return _Found()

    def _tell(self, sentence: str) -> None:
        """Once: what stays wrong is not said with every look."""
        if sentence != self._told:
            self._trouble = self._told = sentence


def _is_newer(version: object) -> bool:
    return isinstance(version, int) and not isinstance(version, bool) and version > VERSION


def _sorted(items: Iterable[Packed]) -> tuple[Packed, ...]:
    return tuple(sorted(items, key=lambda item: (-item.at, item.id)))


def _ids(found: _Found) -> list[str]:
    """What tells one content from another: a stack that is in the backpack is never changed."""
    return [item.id for item in found.items]


def _packed(entry: object) -> Packed | None:
    """An entry of the file; None for what is no stack of blocks."""
    if not isinstance(entry, Mapping):
        return None
    id, at, block = entry.get("id"), entry.get("at"), entry.get("block")
    if not isinstance(id, str) or not id or not isinstance(at, int | float) or not math.isfinite(at):
        return None
    if not isinstance(block, Mapping) or not isinstance(block.get("type"), str):
        return None
    return Packed(id, float(at), block)


def _stamp(path: Path) -> Stamp | None:
    """What tells one state of a file from another; None when there is none."""
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_mtime_ns, about.st_size, about.st_ino
