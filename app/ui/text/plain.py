"""Escaping of names from the network: plain text, never markup, in tooltips and menus.

Qt interprets a tooltip that looks like HTML as HTML. A node named ``<img src="//server/share">`` could then
show a file of this computer, or reveal this user to a server, when the mouse is on its name.
"""

from __future__ import annotations

import html
import unicodedata

from PySide6.QtGui import Qt

LONG_WORD, PIECE = 20, 4
MAY_BREAK = "\u200b"  # zero-width space, at which a line may break


def breakable(words: str) -> str:
    """Insert break opportunities into very long words, which a label would otherwise cut off."""
    return " ".join(_pieces(word) if len(word) > LONG_WORD else word for word in words.split(" "))


def _pieces(word: str) -> str:
    # Combining characters stay with their letter.
    result, since = "", 0
    for letter in word:
        if since >= PIECE and not unicodedata.combining(letter) and unicodedata.category(letter)[0] in "LN":
            result, since = result + MAY_BREAK, 0
        result, since = result + letter, since + 1
    return result


def tip(words: str) -> str:
    """Return a tooltip that shows exactly this text."""
    if not Qt.mightBeRichText(words):
        return words
    return f'<span style="white-space: pre-wrap">{html.escape(words)}</span>'


def entry(name: str) -> str:
    """Return a menu entry that shows exactly this name: no mnemonic by an ampersand, no shortcut by a tab."""
    return name.replace("&", "&&").replace("\t", " ")
