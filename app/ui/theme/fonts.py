"""The bundled fonts: Inter for text, JetBrains Mono for topics, paths, values and programs."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QFont, QFontDatabase

from app import resources

LOADED = "fontsRefused"
"""What the application remembers: that they were loaded, and what Qt refused of them."""
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

    Needs a QGuiApplication. Called again it does nothing: each file that Qt gets, also one that it has, makes
    it forget how wide and high all words are.
    """
    application = QCoreApplication.instance()
    if application is not None and application.property(LOADED) is not None:
        return tuple(application.property(LOADED))
    refused: list[str] = []
    for name in FILES:
        number = QFontDatabase.addApplicationFont(str(resources.path("fonts", name)))
        if number < 0:
            refused.append(name)
    if application is not None:
        application.setProperty(LOADED, refused)
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
