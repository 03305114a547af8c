"""Escaping of names from the network, so that tooltips and menus show them as plain text.

Qt interprets a tooltip that looks like HTML as HTML. A node named ``<img src="//server/share">`` could
therefore show a file of this computer, or reveal the user to a server, when the mouse is over its name.
"""

from __future__ import annotations

import html
import unicodedata

from PySide6.QtGui import Qt

LONG_WORD, PIECE = 20, 4
ZERO_WIDTH_SPACE = "\u200b"  # zero-width space, at which a line may break


def make_breakable(words: str) -> str:
    """Insert line break opportunities into very long words, which a label would otherwise cut off."""
    return " ".join(_pieces(word) if len(word) > LONG_WORD else word for word in words.split(" "))


def _pieces(word: str) -> str:
    # Combining characters are not separated from their letter.
    result, since = "", 0
    for letter in word:
        if since >= PIECE and not unicodedata.combining(letter) and unicodedata.category(letter)[0] in "LN":
            result, since = result + ZERO_WIDTH_SPACE, 0
        result, since = result + letter, since + 1
    return result


def tip(words: str) -> str:
    """Escape a text for a tooltip that shows exactly this text."""
    if not Qt.mightBeRichText(words):
        return words
    return f'<span style="white-space: pre-wrap">{html.escape(words)}</span>'


def escape_menu_text(name: str) -> str:
    """Escape a name for a menu entry: an ampersand makes no mnemonic, and a tab no shortcut."""
    return name.replace("&", "&&").replace("\t", " ")
