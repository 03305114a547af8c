"""Bundled fonts: Inter for text, M PLUS 1p for Japanese, JetBrains Mono for topics and values."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QFont, QFontDatabase

from app import resources

REJECTED_PROPERTY = "fontsRefused"
"""Application property with the names of the font files that Qt rejected; set by `load`."""
FONT_FILES = (
    "Inter-Regular.otf",
    "Inter-Medium.otf",
    "Inter-SemiBold.otf",
    "Inter-Bold.otf",
    "JetBrainsMono-Regular.ttf",
    "JetBrainsMono-Medium.ttf",
    "JetBrainsMono-SemiBold.ttf",
    "JetBrainsMono-Bold.ttf",
    "MPLUS1p-Regular.ttf",
    "MPLUS1p-Bold.ttf",
)


def load() -> tuple[str, ...]:
    """Register the bundled fonts with Qt and return the names of the files that Qt rejected.

    Requires a QGuiApplication. Repeated calls have no effect, because each registration clears Qt's
    cache of text sizes.
    """
    application = QCoreApplication.instance()
    if application is not None and application.property(REJECTED_PROPERTY) is not None:
        return tuple(application.property(REJECTED_PROPERTY))
    rejected: list[str] = []
    for name in FONT_FILES:
        font_id = QFontDatabase.addApplicationFont(str(resources.path("fonts", name)))
        if font_id < 0:
            rejected.append(name)
    if application is not None:
        application.setProperty(REJECTED_PROPERTY, rejected)
    return tuple(rejected)


def make_font(families: Sequence[str], size_px: float, weight: int, *, spacing_em: float = 0.0) -> QFont:
    """Return a font with tabular digits.

    Args:
        families: Font families in order of preference.
        size_px: Size in px.
        weight: Weight, 100 to 900.
        spacing_em: Letter spacing in em.
    """
    font = QFont(list(families))
    font.setPixelSize(max(1, round(size_px)))
    font.setWeight(QFont.Weight(weight))
    font.setFeature(QFont.Tag("tnum"), 1)
    font.setHintingPreference(QFont.HintingPreference.PreferNoHinting)
    if spacing_em:
        font.setLetterSpacing(QFont.SpacingType.PercentageSpacing, 100.0 + 100.0 * spacing_em)
    return font
