"""A layout as a file that others can open: its name, what it arranges, and where its panels are."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import orjson

from app.core.storage import deep_json
from app.errors import AppError
from app.ui.shell.docking.dock import kind_of
from app.ui.shell.docking.layouts import LAYOUTS
from app.ui.shell.docking.saved_layouts import LONGEST
from nep.i18n import _
from nep.version import __version__

FORMAT, VERSION = "nep-studio layout", 1
MOST_BYTES = 1_000_000


class LayoutFileError(AppError):
    """Why a file is no layout that can be shown, in words without a full stop."""


@dataclass(frozen=True, slots=True)
class LayoutFile:
    """A layout of a file. ``unknown`` are the panels that this Studio does not have: they are left out."""

    name: str
    base: str
    saved: Mapping[str, object]
    unknown: tuple[str, ...] = ()


def layout_bytes(name: str, base: str, saved: Mapping[str, object]) -> bytes:
    """The file of an arrangement, as `Workbench.save` tells it."""
    plain = {
        "format": FORMAT,
        "version": VERSION,
        "studio": __version__,
        "name": name,
        "base": base,
        "arrangement": dict(saved),
        "sum": _sum(saved),
    }
    return orjson.dumps(plain, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def _sum(saved: Mapping[str, object]) -> str:
    """Of an arrangement: Qt takes its own part as it is, and may crash on one that is damaged."""
    plain = orjson.dumps(dict(saved), option=orjson.OPT_SORT_KEYS | orjson.OPT_NON_STR_KEYS)
    return hashlib.sha256(plain).hexdigest()


def read_layout(data: bytes, stem: str, panels: Collection[str]) -> LayoutFile:
    """What is in a file; ``stem`` names a layout that has no name, ``panels`` are those that there are.

    Raises `LayoutFileError`.
    """
    try:
        told = deep_json.loads(data)
    except (ValueError, RecursionError) as error:
        raise LayoutFileError(_("it is damaged or not a layout of Studio")) from error
    if not isinstance(told, dict) or told.get("format") != FORMAT:
        raise LayoutFileError(_("it is not a layout of Studio"))
    version = told.get("version")
    if type(version) is not int or version < 1:
        raise LayoutFileError(_("it is damaged"))
    if version > VERSION:
        raise LayoutFileError(_("it was made by a newer Studio; update this one"))
    base, saved = told.get("base"), told.get("arrangement")
    if not isinstance(base, str) or base not in {layout.name for layout in LAYOUTS}:
        raise LayoutFileError(_("it is for a layout that this Studio doesn't have"))
    opened = saved.get("open") if isinstance(saved, dict) else None
    if not isinstance(saved, dict) or not isinstance(opened, list) or not isinstance(saved.get("docks"), str):
        raise LayoutFileError(_("it is damaged"))
    if told.get("sum") != _sum(saved):
        raise LayoutFileError(_("it is damaged"))
    keys = list(dict.fromkeys(key for key in opened if isinstance(key, str)))
    known = [key for key in keys if kind_of(key)[0] in panels]
    unknown = tuple(dict.fromkeys(kind_of(key)[0] for key in keys if key not in known))
    about = saved.get("panels")
    kept = {
        key: each
        for key, each in (about if isinstance(about, dict) else {}).items()
        if kind_of(key)[0] in panels and isinstance(each, dict)
    }
    return LayoutFile(_name(told.get("name"), stem), base, {**saved, "open": known, "panels": kept}, unknown)


def _name(told: object, stem: str) -> str:
    """The layout's name as a menu can show it."""
    for each in (told, stem):
        letters = (
            letter if letter.isprintable() else " " for letter in (each if isinstance(each, str) else "")
        )
        plain = " ".join("".join(letters).split())[:LONGEST].strip()
        if plain:
            return plain
    return _("Layout")
