"""Layout file for sharing: name, base layout and arrangement of the panels."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import orjson

from app.blocks.model import deep_json
from app.errors import AppError
from app.ui.shell.docking.dock import parse_key
from app.ui.shell.docking.layouts import LAYOUTS
from app.ui.shell.docking.saved_layouts import MAX_NAME_LENGTH
from nep.i18n import _
from nep.version import __version__

FORMAT, VERSION = "nep-studio layout", 1
MAX_BYTES = 1_000_000


class LayoutFileError(AppError):
    """Raised if a file isn't a valid layout. The message is a phrase without a full stop."""


@dataclass(frozen=True, slots=True)
class LayoutFile:
    """Contents of a layout file.

    Attributes:
        name: Name of the layout.
        base: Name of the built-in layout on which it is based.
        saved: Arrangement, as returned by `Workbench.save`, without unknown panels.
        unknown_panels: Names of panels in the file that aren't installed.
    """

    name: str
    base: str
    saved: Mapping[str, object]
    unknown_panels: tuple[str, ...] = ()


def encode_layout(name: str, base: str, saved: Mapping[str, object]) -> bytes:
    """Encode a layout file.

    Args:
        name: Name of the layout.
        base: Name of the built-in layout on which it is based.
        saved: Arrangement returned by `Workbench.save`.
    """
    document = {
        "format": FORMAT,
        "version": VERSION,
        "studio": __version__,
        "name": name,
        "base": base,
        "arrangement": dict(saved),
        "sum": _checksum(saved),
    }
    return orjson.dumps(document, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE)


def _checksum(saved: Mapping[str, object]) -> str:
    # A checksum is needed because Qt doesn't validate its part of the state and may crash if it is damaged.
    encoded = orjson.dumps(dict(saved), option=orjson.OPT_SORT_KEYS | orjson.OPT_NON_STR_KEYS)
    return hashlib.sha256(encoded).hexdigest()


def decode_layout(data: bytes, stem: str, panels: Collection[str]) -> LayoutFile:
    """Parse a layout file.

    Args:
        data: Contents of the file.
        stem: Name to use if the file contains none.
        panels: Names of the installed panels.

    Raises:
        LayoutFileError: The file isn't a valid layout.
    """
    try:
        content = deep_json.loads(data)
    except (ValueError, RecursionError) as error:
        raise LayoutFileError(_("it is damaged or not a Studio layout")) from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise LayoutFileError(_("it isn't a Studio layout"))
    version = content.get("version")
    if type(version) is not int or version < 1:
        raise LayoutFileError(_("the file is damaged"))
    if version > VERSION:
        raise LayoutFileError(_("it was saved by a newer version of Studio; update Studio to open it"))
    base, saved = content.get("base"), content.get("arrangement")
    if not isinstance(base, str) or base not in {layout.name for layout in LAYOUTS}:
        raise LayoutFileError(_("it is based on a layout that this version of Studio doesn't have"))
    open_keys = saved.get("open") if isinstance(saved, dict) else None
    if (
        not isinstance(saved, dict)
        or not isinstance(open_keys, list)
        or not isinstance(saved.get("docks"), str)
    ):
        raise LayoutFileError(_("the file is damaged"))
    if content.get("sum") != _checksum(saved):
        raise LayoutFileError(_("the file is damaged"))
    keys = list(dict.fromkeys(key for key in open_keys if isinstance(key, str)))
    known_keys = [key for key in keys if parse_key(key)[0] in panels]
    unknown_names = tuple(dict.fromkeys(parse_key(key)[0] for key in keys if key not in known_keys))
    states = saved.get("panels")
    panel_states = {
        key: each
        for key, each in (states if isinstance(states, dict) else {}).items()
        if parse_key(key)[0] in panels and isinstance(each, dict)
    }
    return LayoutFile(
        _layout_name(content.get("name"), stem),
        base,
        {**saved, "open": known_keys, "panels": panel_states},
        unknown_names,
    )


def _layout_name(name: object, stem: str) -> str:
    # Shortened to one line for menus.
    for candidate in (name, stem):
        letters = (
            letter if letter.isprintable() else " "
            for letter in (candidate if isinstance(candidate, str) else "")
        )
        cleaned = " ".join("".join(letters).split())[:MAX_NAME_LENGTH].strip()
        if cleaned:
            return cleaned
    return _("Layout")
