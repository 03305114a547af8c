"""Qt's state of a window's docks as text for the settings, and back."""

from __future__ import annotations

import base64
import binascii

from PySide6.QtCore import QByteArray

VERSION = 1


def written(state: QByteArray) -> str:
    """The state as text."""
    return base64.b64encode(state.data()).decode("ascii")


def read(text: object) -> QByteArray:
    """What `written` made; empty when it is something else."""
    if not isinstance(text, str):
        return QByteArray()
    try:
        return QByteArray(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError):
        return QByteArray()
