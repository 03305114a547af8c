"""JSON of a workspace as passed between the editor's page, a document and its journal.

The JSON is passed as text. Code that needs the blocks (compiler, file) parses it on demand, once and in its
own thread.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.core.storage import deep_json

LONG_TEXT_LENGTH = 20_000
"""Text length above which parsing or compiling is too slow for the window's thread."""
EMPTY: Mapping[str, object] = {"blocks": {"languageVersion": 0, "blocks": []}}


class WorkspaceJson:
    """JSON of one workspace as text, blocks, or both; each is created from the other on demand.

    Immutable and thread-safe.
    """

    __slots__ = ("_blocks", "_text", "_was_told")

    def __init__(self, text: str | None, blocks: Mapping[str, object] | None = None) -> None:
        # Raises ValueError or RecursionError if `text` can't be parsed. It is parsed immediately only where
        # the nesting could be too deep, which requires many brackets.
        self._text, self._blocks, self._was_told = text, blocks, text is not None
        if (
            text is not None
            and blocks is None
            and text.count("{") + text.count("[") > deep_json.MAX_SHALLOW_LEVELS
        ):
            _ = self.blocks

    @classmethod
    def from_blocks(cls, blocks: Mapping[str, object]) -> WorkspaceJson:
        """Wrap parsed blocks, which must not be changed afterwards."""
        return cls(None, blocks)

    @property
    def text(self) -> str:
        """JSON text. Raises RecursionError for more than 9000 levels of nesting."""
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
        """True if the workspace contains a block. For a long text that isn't parsed yet, True is assumed."""
        if self._blocks is None and self.is_longer_than(LONG_TEXT_LENGTH):
            return True
        inner = self.blocks.get("blocks")
        return isinstance(inner, Mapping) and bool(inner.get("blocks"))

    def is_equal_to(self, other: WorkspaceJson) -> bool:
        """Return True if both are equal. Texts from the page are compared as text.

        Too deeply nested ones differ.
        """
        if self._was_told and other._was_told:
            return self._text == other._text
        try:
            return deep_json.are_equal(self.blocks, other.blocks)
        except RecursionError:
            return False

    def is_longer_than(self, characters: int) -> bool:
        """Return True if the text is longer than this, or too deeply nested to be written."""
        try:
            return len(self.text) > characters
        except RecursionError:
            return True
