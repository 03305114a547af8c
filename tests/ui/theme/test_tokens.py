"""Tests of the design tokens: contrast, edges and colours distinguishable with colour vision deficiencies."""

from __future__ import annotations

import itertools
import math

import pytest

from app.ui.theme import tokens

TOKENS = tokens.load()
RAW = TOKENS.raw
# Machado, Oliveira and Fernandes 2009, severity 1, on linear RGB
SEEN = {
    "normal": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "protanopia": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "deuteranopia": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.01182, 0.04294, 0.968881),
    ),
    "tritanopia": (
        (1.255528, -0.076749, -0.178779),
        (-0.078411, 0.930809, 0.147602),
        (0.004733, 0.691367, 0.3039),
    ),
}  # fmt: skip
XYZ = (
    (0.4124564, 0.3575761, 0.1804375),
    (0.2126729, 0.7151522, 0.0721750),
    (0.0193339, 0.1191920, 0.9503041),
)
WHITE = (0.95047, 1.0, 1.08883)
MODES = ("light", "dark")


def dot(matrix, vector):
    return [sum(a * b for a, b in zip(row, vector, strict=True)) for row in matrix]


def linear(colour: str) -> list[float]:
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    return [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]


def contrast(one: str, other: str) -> float:
    dark, bright = sorted(dot(XYZ, linear(colour))[1] for colour in (one, other))
    return (bright + 0.05) / (dark + 0.05)


def lab(colour: str, eyes: str) -> tuple[float, float, float]:
    seen = [min(1.0, max(0.0, part)) for part in dot(SEEN[eyes], linear(colour))]
    ratios = [value / white for value, white in zip(dot(XYZ, seen), WHITE, strict=True)]
    x, y, z = (r ** (1 / 3) if r > (6 / 29) ** 3 else r / (3 * (6 / 29) ** 2) + 4 / 29 for r in ratios)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def ciede2000(one, other) -> float:
    (l1, a1, b1), (l2, a2, b2) = one, other
    chroma = (math.hypot(a1, b1) + math.hypot(a2, b2)) / 2
    stretch = 1.5 - 0.5 * math.sqrt(chroma**7 / (chroma**7 + 25**7))
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = math.hypot(a1, b1), math.hypot(a2, b2)
    h1, h2 = math.degrees(math.atan2(b1, a1)) % 360, math.degrees(math.atan2(b2, a2)) % 360
    turn = (h2 - h1 + 180) % 360 - 180 if c1 * c2 else 0.0
    hue = 2 * math.sqrt(c1 * c2) * math.sin(math.radians(turn / 2))
    light, mean = (l1 + l2) / 2, (c1 + c2) / 2
    angle = (h1 + turn / 2) % 360 if c1 * c2 else h1 + h2
    t = 1.0
    for factor, times, shift in ((-0.17, 1, -30), (0.24, 2, 0), (0.32, 3, 6), (-0.2, 4, -63)):
        t += factor * math.cos(math.radians(times * angle + shift))
    weight_l = 1 + 0.015 * (light - 50) ** 2 / math.sqrt(20 + (light - 50) ** 2)
    weight_c, weight_h = 1 + 0.045 * mean, 1 + 0.015 * mean * t
    rotation = 60 * math.exp(-(((angle - 275) / 25) ** 2))
    cross = -2 * math.sqrt(mean**7 / (mean**7 + 25**7)) * math.sin(math.radians(rotation))
    dl, dc, dh = (l2 - l1) / weight_l, (c2 - c1) / weight_c, hue / weight_h
    return math.sqrt(dl**2 + dc**2 + dh**2 + cross * dc * dh)


def test_contrast_and_colour_distance_match_reference_values() -> None:
    assert contrast("#000000", "#FFFFFF") == pytest.approx(21.0)
    # the first pair of the published CIEDE2000 test data
    assert ciede2000((50, 2.6772, -79.7751), (50, 0, -82.7485)) == pytest.approx(2.0425, abs=1e-4)


@pytest.mark.parametrize("mode", MODES)
def test_every_listed_colour_pair_has_its_required_contrast(mode: str) -> None:
    roles = TOKENS.colours[mode]
    pairs = RAW["contrast"]["pairs"]
    assert len(pairs) > 40
    wrong = [pair for pair in pairs if contrast(roles[pair[0]], roles[pair[1]]) < pair[2]]
    assert wrong == []


@pytest.mark.parametrize("mode", MODES)
def test_curve_colours_contrast_with_the_panel(mode: str) -> None:
    panel = TOKENS.colours[mode]["panel"]
    assert all(contrast(colour, panel) >= 3 for colour in TOKENS.series[mode])


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", sorted(TOKENS.blocks))
def test_block_texts_and_edges_have_enough_contrast(mode: str, name: str) -> None:
    block, roles = TOKENS.blocks[name][mode], TOKENS.colours[mode]
    assert contrast(TOKENS.block_text[name], block["primary"]) >= 4.5
    assert max(contrast(block[part], roles["workspace"]) for part in ("primary", "tertiary")) >= 3
    assert contrast(block["primary"], roles["running"]) >= 2


@pytest.mark.parametrize("eyes", sorted(SEEN))
def test_block_colours_are_distinguishable_with_colour_vision_deficiencies(eyes: str) -> None:
    wanted = RAW["colourBlind"]["least"][eyes]
    colours = [lab(block["light"]["primary"], eyes) for block in TOKENS.blocks.values()]
    assert min(ciede2000(one, other) for one, other in itertools.combinations(colours, 2)) >= wanted


def test_both_themes_have_the_same_roles() -> None:
    assert TOKENS.colours["light"].keys() == TOKENS.colours["dark"].keys()
    for status in TOKENS.status.values():
        assert status.colour in TOKENS.colours["light"]
        assert status.tint is None or status.tint in TOKENS.colours["light"]
