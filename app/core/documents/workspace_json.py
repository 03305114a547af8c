"""Workspace JSON between the editor's page, a document and its journal: text, parsed on demand.

Code that needs the blocks (compiler, file) gets them parsed, once and in its own thread.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.core.storage import deep_json

LONG_CHARACTERS = 20_000
"""Text length above which parsing or compiling takes too long for the window's thread."""
EMPTY: Mapping[str, object] = {"blocks": {"languageVersion": 0, "blocks": []}}


class WorkspaceJson:
    """JSON of one workspace as text, blocks, or both; each is created from the other on demand.

    Immutable and thread-safe.
    """

    __slots__ = ("_blocks", "_text", "_was_told")

    def __init__(self, text: str | None, blocks: Mapping[str, object] | None = None) -> None:
        # Raises ValueError or RecursionError if `text` can't be parsed. It is parsed immediately only where
        # it could be nested too deep, which needs many brackets.
        self._text, self._blocks, self._was_told = text, blocks, text is not None
        if text is not None and blocks is None and text.count("{") + text.count("[") > deep_json.SHALLOW:
            _ = self.blocks

    @classmethod
    def of(cls, blocks: Mapping[str, object]) -> WorkspaceJson:
        """Return the JSON of parsed blocks, which must not be changed any more."""
        return cls(None, blocks)

    @property
    def text(self) -> str:
        """JSON text. Raises RecursionError beyond 9000 levels."""
        if self._text is None:
            self._text = deep_json.dumps(self._blocks)
        return self._text

    @property
    def blocks(self) -> Mapping[str, object]:
        """Blocks in Blockly's JSON; empty when the text is not an object."""
        if self._blocks is None:
            parsed = deep_json.loads(self._text or "{}")
            self._blocks = parsed if isinstance(parsed, dict) else {}
        return self._blocks

    @property
    def has_blocks(self) -> bool:
        """True if there is any block; assumed for a long text."""
        if self._blocks is None and self.is_longer_than(LONG_CHARACTERS):
            return True
        inner = self.blocks.get("blocks")
        return isinstance(inner, Mapping) and bool(inner.get("blocks"))

    def same_as(self, other: WorkspaceJson) -> bool:
        """Return whether both are equal; two texts of the page are compared as text, too deep ones differ."""
        if self._was_told and other._was_told:
            return self._text == other._text
        try:
            return deep_json.same(self.blocks, other.blocks)
        except RecursionError:
            return False

    def is_longer_than(self, characters: int) -> bool:
        """Return whether the text is longer than this, or too deep."""
        try:
            return len(self.text) > characters
        except RecursionError:
            return True
