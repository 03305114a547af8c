"""What happens now, in words: what a robot does for a block, else the block itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence


class StatusText:
    """Sentences for the run bar. Scripts tell, another thread reads."""

    def __init__(self, block: Callable[[], str | None], readings: Mapping[str, str]) -> None:
        """``block`` is where the calling script is, ``readings`` are the blocks in words."""
        self._block, self._readings = block, readings
        self._told: dict[str | None, str] = {}
        self._warned: dict[str | None, str] = {}

    def tell(self, sentence: str) -> None:
        """What a robot does now for the calling script's block; "" when it is done."""
        _keep(self._told, self._block(), sentence)

    def warn(self, sentence: str) -> None:
        """What a person should know while the calling script is held; "" when it goes on."""
        _keep(self._warned, self._block(), sentence)

    def says(self, blocks: Sequence[str]) -> str:
        """The sentence for the run bar: what a robot does now, else the first block in words."""
        return _first(self._told, blocks) or self.reading(blocks[0] if blocks else None)

    def warns(self, blocks: Sequence[str]) -> str:
        """What a person should know of one of these blocks; "" for nothing."""
        return _first(self._warned, blocks)

    def reading(self, block: str | None) -> str:
        """A block in words, "" for none."""
        return self._readings.get(block or "", "")


def _keep(sentences: dict[str | None, str], block: str | None, sentence: str) -> None:
    if sentence:
        sentences[block] = sentence
    else:
        sentences.pop(block, None)


def _first(sentences: Mapping[str | None, str], blocks: Sequence[str]) -> str:
    return next((sentences[block] for block in blocks if block in sentences), "")
