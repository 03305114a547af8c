"""Token field for topic patterns; the keyword "not" precedes an excluded pattern."""

from __future__ import annotations

from collections.abc import Sequence

from app.core.recording.topic_choice import EXCLUDE_KEYWORD, parse_patterns
from app.ui.widgets.inputs.token_field import Token, TokenField
from nep.i18n import _


class PatternField(TokenField):
    """Token field for topic patterns.

    `changed` is emitted on every change, and `editing_finished` when no text is being typed.
    """

    def patterns(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the included and the excluded patterns, including the text being typed."""
        included = [each.entry for each in self._tokens if not each.is_excluded]
        excluded = [each.entry for each in self._tokens if each.is_excluded]
        typed_included, typed_excluded = parse_patterns(self.edit.text())
        all_included = dict.fromkeys((*included, *typed_included))
        all_excluded = dict.fromkeys((*excluded, *typed_excluded))
        return tuple(all_included), tuple(all_excluded)

    def show_patterns(self, included: Sequence[str], excluded: Sequence[str]) -> None:
        """Set the tokens to the given patterns.

        Args:
            included: Included patterns.
            excluded: Excluded patterns.
        """
        if (tuple(included), tuple(excluded)) == self.patterns():
            return
        for token in list(self._tokens):
            self._delete_token(token)
        self.edit.clear()
        self._add(included, excluded)

    def _on_edited(self, text: str) -> None:
        # A space completes a pattern; "not" is combined with the pattern that follows.
        normalised = text.replace(",", " ")
        completed, separator, rest = normalised.rpartition(" ")
        words = completed.split()
        if words and words[-1].casefold() in {EXCLUDE_KEYWORD, _(EXCLUDE_KEYWORD).casefold()}:
            rest = f"{words.pop()} {rest}"
        if separator and words:
            self._add(*parse_patterns(" ".join(words)))
            self.edit.setText(rest)
        self.changed.emit()
        if not self.edit.text().strip():
            self.editing_finished.emit()

    def _end_typing(self) -> None:
        text = self.edit.text()
        if not text.strip():
            return
        included, excluded = parse_patterns(text)
        self.edit.clear()
        self._add(included, excluded)
        self.changed.emit()
        self.editing_finished.emit()

    def _add(self, included: Sequence[str], excluded: Sequence[str]) -> None:
        existing = {(each.entry, each.is_excluded) for each in self._tokens}
        for is_excluded, patterns in ((False, included), (True, excluded)):
            for pattern in patterns:
                if (pattern, is_excluded) not in existing:
                    self._add_token(Token(self._theme, pattern, is_excluded=is_excluded))
        self._arrange()
