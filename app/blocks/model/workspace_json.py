"""JSON of a workspace, as passed between the editor's page, a document and its journal.

The JSON is passed as text. Code that needs the blocks (compiler, file) parses the text at the first
access, in the thread of that code.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.blocks.model import deep_json

LONG_TEXT_LENGTH = 20_000
"""Text length in characters above which parsing or compiling is too slow for the main thread."""
EMPTY_WORKSPACE: Mapping[str, object] = {"blocks": {"languageVersion": 0, "blocks": []}}


class WorkspaceJson:
    """JSON of one workspace, as text, as blocks, or both. The missing form is created at the first access.

    Immutable and thread-safe.
    """

    __slots__ = ("_blocks", "_is_from_text", "_text")

    def __init__(self, text: str | None, blocks: Mapping[str, object] | None = None) -> None:
        # Raises ValueError or RecursionError if `text` can't be parsed. It is parsed immediately only where
        # the nesting could be too deep, which requires many brackets.
        self._text, self._blocks, self._is_from_text = text, blocks, text is not None
        if (
            text is not None
            and blocks is None
            and text.count("{") + text.count("[") > deep_json.MAX_SHALLOW_LEVELS
        ):
            _ = self.blocks

    @classmethod
    def from_blocks(cls, blocks: Mapping[str, object]) -> WorkspaceJson:
        """Wrap parsed blocks. The caller must not change the blocks afterwards."""
        return cls(None, blocks)

    @property
    def text(self) -> str:
        """JSON text. Raises RecursionError for more than 9000 levels of nesting."""
        if self._text is None:
            self._text = deep_json.dumps(self._blocks)
        return self._text

    @property
    def blocks(self) -> Mapping[str, object]:
        """Blocks in Blockly's JSON format; empty if the text is not a JSON object."""
        if self._blocks is None:
            parsed = deep_json.loads(self._text or "{}")
            self._blocks = parsed if isinstance(parsed, dict) else {}
        return self._blocks

    @property
    def has_blocks(self) -> bool:
        """True if the workspace contains a block; also True for a long text that isn't parsed yet."""
        if self._blocks is None and self.is_longer_than(LONG_TEXT_LENGTH):
            return True
        inner = self.blocks.get("blocks")
        return isinstance(inner, Mapping) and bool(inner.get("blocks"))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, WorkspaceJson) and self.is_equal_to(other)

    __hash__ = None  # type: ignore[assignment]  # equal workspaces may have different texts

    def is_equal_to(self, other: WorkspaceJson) -> bool:
        """Return True if both workspaces are equal.

        Two texts from the editor's page are compared as text. Workspaces that are nested too deeply to
        be compared count as different.
        """
        if self._is_from_text and other._is_from_text:
            return self._text == other._text
        try:
            return deep_json.are_equal(self.blocks, other.blocks)
        except RecursionError:
            return False

    def is_longer_than(self, characters: int) -> bool:
        """Return True if the text is longer than ``characters``, or nested too deeply to be formatted."""
        try:
            return len(self.text) > characters
        except RecursionError:
            return True
