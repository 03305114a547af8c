"""Escaping of names that were received from the network, for tooltips and menus.

Qt renders a tooltip that looks like HTML as HTML. A tooltip with the node name ``<img
src="//server/share">`` could therefore load a local file, or contact a server.
"""

from __future__ import annotations

import html
import unicodedata

from PySide6.QtGui import Qt

MAX_WORD_LENGTH, PIECE_LENGTH = 20, 4
ZERO_WIDTH_SPACE = "\u200b"  # zero-width space, at which a line may break


def make_breakable(text: str) -> str:
    """Insert zero-width spaces into long words, so that a label can wrap instead of truncating them."""
    return " ".join(_break_word(word) if len(word) > MAX_WORD_LENGTH else word for word in text.split(" "))


def _break_word(word: str) -> str:
    # Combining characters are not separated from their letter.
    result, piece_length = "", 0
    for letter in word:
        if (
            piece_length >= PIECE_LENGTH
            and not unicodedata.combining(letter)
            and unicodedata.category(letter)[0] in "LN"
        ):
            result, piece_length = result + ZERO_WIDTH_SPACE, 0
        result, piece_length = result + letter, piece_length + 1
    return result


def tip(text: str) -> str:
    """Escape a text for a tooltip, so that Qt shows it as plain text."""
    if not Qt.mightBeRichText(text):
        return text
    return f'<span style="white-space: pre-wrap">{html.escape(text)}</span>'


def escape_menu_text(name: str) -> str:
    """Escape a name for a menu entry: "&" doesn't mark a mnemonic, and a tab doesn't start a shortcut."""
    return name.replace("&", "&&").replace("\t", " ")
