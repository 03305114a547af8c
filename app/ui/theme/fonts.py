"""The bundled fonts: Inter for text, JetBrains Mono for topics, paths, values and programs."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtGui import QFont, QFontDatabase

from app import resources

FILES = (
    "Inter-Regular.otf",
    "Inter-Medium.otf",
    "Inter-SemiBold.otf",
    "Inter-Bold.otf",
    "JetBrainsMono-Regular.ttf",
    "JetBrainsMono-Medium.ttf",
    "JetBrainsMono-SemiBold.ttf",
    "JetBrainsMono-Bold.ttf",
)


def load() -> tuple[str, ...]:
    """Register the bundled fonts with Qt; the files that Qt refused (an empty tuple when all is well).

    Needs a QGuiApplication. Calling it again is harmless: Qt keeps one copy of a file.
    """
    refused: list[str] = []
    for name in FILES:
        number = QFontDatabase.addApplicationFont(str(resources.path("fonts", name)))
        if number < 0:
            refused.append(name)
    return tuple(refused)


def make(families: Sequence[str], size_px: float, weight: int, *, spacing_em: float = 0.0) -> QFont:
    """A font with figures of one width (``tnum``); letter spacing in em."""
    font = QFont(list(families))
    font.setPixelSize(max(1, round(size_px)))
    font.setWeight(QFont.Weight(weight))
    font.setFeature(QFont.Tag("tnum"), 1)
    font.setHintingPreference(QFont.HintingPreference.PreferNoHinting)
    if spacing_em:
        font.setLetterSpacing(QFont.SpacingType.PercentageSpacing, 100.0 + 100.0 * spacing_em)
    return font
