"""Reassembly of fragmented operations within limits, and splitting of text. Performs no I/O."""

from __future__ import annotations

from nep.i18n import _
from nep.programs.web.limits import MAX_FRAGMENTED_OPERATIONS, MAX_MESSAGE_BYTES
from nep.programs.web.messages.operations import Fragment, OperationError, OperationId, Png


class FragmentBuffer:
    """Buffer for a page's incomplete operations. When it is full, the oldest operation is discarded."""

    def __init__(self) -> None:
        self._parts: dict[OperationId, dict[int, str]] = {}
        self._totals: dict[OperationId, int] = {}
        self._character_count = 0

    def __len__(self) -> int:
        return len(self._parts)

    def add(self, part: Fragment | Png) -> str | None:
        """Add a fragment; return the text of the operation once it is complete, else None.

        If too many fragments are waiting, those of the oldest other operations are discarded.

        Raises:
            OperationError: The fragment has no id, contradicts earlier fragments, or makes the text too
                long. The earlier fragments are then discarded.
        """
        if part.total == 1:
            return part.data
        if part.id is None:
            raise OperationError(_("a fragment needs an 'id'"))
        if self._totals.setdefault(part.id, part.total) != part.total:
            self._discard(part.id)
            raise OperationError(
                _("the fragments of '{id}' differ in 'total'; all were discarded").format(id=part.id), part.id
            )
        parts = self._parts.setdefault(part.id, {})
        self._character_count += len(part.data) - len(parts.get(part.number, ""))
        parts[part.number] = part.data
        while len(self._parts) > MAX_FRAGMENTED_OPERATIONS or (
            self._character_count > MAX_MESSAGE_BYTES and len(self._parts) > 1
        ):
            self._discard(next(each for each in self._parts if each != part.id))
        if self._character_count > MAX_MESSAGE_BYTES:
            self._discard(part.id)
            raise OperationError(
                _("the fragments of '{id}' have more than {most} characters; all were discarded").format(
                    id=part.id, most=MAX_MESSAGE_BYTES
                ),
                part.id,
            )
        if len(parts) < part.total:
            return None
        text = "".join(parts[number] for number in range(part.total))
        self._discard(part.id)
        return text

    def _discard(self, id_: OperationId) -> None:
        self._totals.pop(id_, None)
        self._character_count -= sum(map(len, self._parts.pop(id_, {}).values()))


def split_text(text: str, size: int) -> list[str]:
    """Split text into pieces of at most `size` characters."""
    return [text[offset : offset + size] for offset in range(0, len(text), size)] or [""]
