"""What is wrong with files, in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from app.core.documents.file_format import SUFFIX
from app.errors import DocumentError


def sentence_of(error: Exception) -> str:
    """What is wrong with a file, beginning with its name."""
    if isinstance(error, DocumentError) and error.path is not None:
        return f"{error.path.name} {error.reason}"
    words = str(error)
    return words[:1].upper() + words[1:]


def strange_words(paths: Sequence[Path]) -> str:
    """What is wrong with files that are no behaviours."""
    names = [path.name or str(path) for path in paths]
    shown = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} more"
    are = "is no behaviour" if len(names) == 1 else "are no behaviours"
    return f"{shown} {are}; behaviours are files ending in {SUFFIX}"
