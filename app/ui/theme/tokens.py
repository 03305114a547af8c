"""Design tokens, loaded once into typed, immutable values.

Colours have the format of the file, ``#RRGGBB`` or ``#RRGGBBAA``; `app.ui.theme.theme` converts them to
Qt values.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import cast

from app import resources

Numbers = Mapping[str, "int | float | Numbers | list[int]"]
# Statuses whose icon the tokens describe in words, because it is a painted dot.
_DRAWN_ICONS = MappingProxyType({"a filled dot 10 px": "dot"})


@dataclass(frozen=True)
class Status:
    """Style of a status.

    Attributes:
        colour: Colour role of text and icon.
        tint: Colour role of the background, or None for none.
        icon: Name of the icon.
    """

    colour: str
    tint: str | None
    icon: str


@dataclass(frozen=True)
class TextKind:
    """Style of a kind of text.

    Attributes:
        size_px: Font size.
        line_px: Line height.
        weight: Font weight, 400 to 700.
    """

    size_px: int
    line_px: int
    weight: int


@dataclass(frozen=True)
class Tokens:
    """Design tokens of ``resources/theme/tokens.json``.

    Attributes:
        raw: Parsed file.
        colours: Colours by theme ("light", "dark") and role.
        series: Colours of curves by theme.
        status: Styles of statuses by name.
        blocks: Colours of blocks by category, theme and part.
        block_icons: Icon names by block category.
        block_text: Colours of text on blocks by category.
        sizes: Lengths in px as nested mappings; a pair is a width and height.
        radii: Corner radii in px by name.
        texts: Kinds of text by name.
        motion_ms: Durations by name.
        icons: Icon names by use.
        families: Font families by "text" and "mono".
        fallback: Fallback font families.
    """

    raw: Mapping[str, object]
    colours: Mapping[str, Mapping[str, str]]
    series: Mapping[str, tuple[str, ...]]
    status: Mapping[str, Status]
    blocks: Mapping[str, Mapping[str, Mapping[str, str]]]
    block_icons: Mapping[str, str]
    block_text: Mapping[str, str]
    sizes: Numbers
    radii: Mapping[str, int]
    texts: Mapping[str, TextKind]
    motion_ms: Mapping[str, int]
    icons: Mapping[str, str]
    families: Mapping[str, str]
    fallback: tuple[str, ...]


def load(path: Path | None = None) -> Tokens:
    """Load the design tokens.

    Args:
        path: File to load, by default the one shipped with Studio.

    Raises:
        KeyError: A token is missing.
        ValueError: The file isn't valid JSON.
    """
    source = path if path is not None else resources.path("theme", "tokens.json")
    return parse(json.loads(source.read_text("utf-8")))


def parse(raw: Mapping[str, object]) -> Tokens:
    """Convert the parsed contents of ``tokens.json`` to typed tokens.

    Raises:
        KeyError: A token is missing.
    """
    colours = cast("Mapping[str, Mapping[str, str | list[str]]]", raw["colour"])
    blocks = cast("Mapping[str, Mapping[str, object]]", raw["block"])
    font = cast("Mapping[str, object]", raw["font"])
    icons = cast("Mapping[str, Mapping[str, str]]", raw["icons"])["uses"]
    return Tokens(
        raw=raw,
        colours={
            theme: {name: value for name, value in roles.items() if isinstance(value, str)}
            for theme, roles in colours.items()
        },
        series={theme: tuple(roles["series"]) for theme, roles in colours.items()},
        status=_parse_statuses(cast("Mapping[str, object]", raw["status"])),
        blocks={
            name: cast("Mapping[str, Mapping[str, str]]", {mode: block[mode] for mode in ("light", "dark")})
            for name, block in blocks.items()
        },
        block_icons={name: str(block["icon"]) for name, block in blocks.items()},
        block_text={name: str(block["text"]) for name, block in blocks.items()},
        sizes=cast("Numbers", raw["size_px"]),
        radii=cast("Mapping[str, int]", raw["radius_px"]),
        texts=_parse_text_kinds(cast("Mapping[str, Mapping[str, int]]", raw["type"])),
        motion_ms={
            name: value
            for name, value in cast("Mapping[str, int | str]", raw["motion_ms"]).items()
            if isinstance(value, int)
        },
        icons={use: name.split(" ")[0] for use, name in icons.items()},
        families={"text": str(font["text"]), "mono": str(font["mono"])},
        fallback=tuple(cast("list[str]", font["fallback"])),
    )


def _parse_statuses(raw: Mapping[str, object]) -> Mapping[str, Status]:
    statuses: dict[str, Status] = {}
    for name, value in raw.items():
        if isinstance(value, dict):
            icon = str(value["icon"])
            tint = value["tint"]
            statuses[name] = Status(
                str(value["colour"]), None if tint is None else str(tint), _DRAWN_ICONS.get(icon, icon)
            )
    return statuses


def _parse_text_kinds(raw: Mapping[str, Mapping[str, int]]) -> Mapping[str, TextKind]:
    return {name: TextKind(kind["size_px"], kind["line_px"], kind["weight"]) for name, kind in raw.items()}


def tokens_for_page(
    tokens: Tokens, colour: Callable[[str], str], *, is_dark: bool, is_motion_reduced: bool, text_percent: int
) -> dict[str, object]:
    """Return the values for the page of the block editor, as a JSON-serializable dict.

    Args:
        tokens: Design tokens.
        colour: Returns the colour of a role in the current mode.
        is_dark: True for the dark theme.
        is_motion_reduced: True to reduce motion.
        text_percent: Text size in percent.
    """
    scheme = "dark" if is_dark else "light"
    return {
        "dark": is_dark,
        "colour": {role: colour(role) for role in tokens.colours[scheme]},
        "block": {
            name: {
                **parts[scheme],
                "text": tokens.block_text[name],
                "icon": tokens.block_icons[name],
            }
            for name, parts in tokens.blocks.items()
        },
        "glow": tokens.raw.get("blockGlow", {}),
        "font": {"text": tokens.families["text"], "mono": tokens.families["mono"]},
        "reducedMotion": is_motion_reduced,
        "textPercent": text_percent,
    }
