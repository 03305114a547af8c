"""A workspace between the page of the block editor, a document and its journal: the text as it came.

Whoever needs the blocks themselves (the compiler, a file) gets them parsed, once and in its own thread.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.core.storage import deep_json

LONG_CHARACTERS = 20_000
"""To parse or compile a text of this length takes longer than the window should wait for."""
EMPTY: Mapping[str, object] = {"blocks": {"languageVersion": 0, "blocks": []}}


class WorkspaceJson:
    """The JSON of one workspace, as text, as blocks, or both: each is made of the other when it is asked for.

    It never changes, and works in any thread.
    """

    __slots__ = ("_blocks", "_text", "_was_told")

    def __init__(self, text: str | None, blocks: Mapping[str, object] | None = None) -> None:
        """``text`` as the page wrote it. ValueError or RecursionError when it can't ever be parsed.

        Text is parsed at once only where it could be nested too deep, which a few brackets can't.
        """
        self._text, self._blocks, self._was_told = text, blocks, text is not None
        if text is not None and blocks is None and text.count("{") + text.count("[") > deep_json.SHALLOW:
            _ = self.blocks

    @classmethod
    def of(cls, blocks: Mapping[str, object]) -> WorkspaceJson:
        """Of blocks that are parsed already, and that nobody changes any more."""
        return cls(None, blocks)

    @property
    def text(self) -> str:
        """Its JSON text. RecursionError beyond 9000 levels."""
        if self._text is None:
            self._text = deep_json.dumps(self._blocks)
        return self._text

    @property
    def blocks(self) -> Mapping[str, object]:
        """Blockly's JSON; empty when the text holds no object."""
        if self._blocks is None:
            made = deep_json.loads(self._text or "{}")
            self._blocks = made if isinstance(made, dict) else {}
        return self._blocks

    @property
    def has_blocks(self) -> bool:
        """Whether there is any block; a long text has some."""
        if self._blocks is None and self.is_longer_than(LONG_CHARACTERS):
            return True
        inner = self.blocks.get("blocks")
        return isinstance(inner, Mapping) and bool(inner.get("blocks"))

    def same_as(self, other: WorkspaceJson) -> bool:
        """Whether both say the same; two texts of the page are compared as they are, too deep ones differ."""
        if self._was_told and other._was_told:
            return self._text == other._text
        try:
            return deep_json.same(self.blocks, other.blocks)
        except RecursionError:
            return False

    def is_longer_than(self, characters: int) -> bool:
        """Whether its text is longer than this, or too deep to be one."""
        try:
            return len(self.text) > characters
        except RecursionError:
            return True
