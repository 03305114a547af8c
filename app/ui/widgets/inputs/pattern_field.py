"""Token field for topic patterns; the keyword "not" precedes an excluded pattern."""

from __future__ import annotations

from collections.abc import Sequence

from app.core.recording.choice import EXCLUDE_KEYWORD, parse_patterns
from app.ui.widgets.inputs.token_field import Token, TokenField
from nep.i18n import _


class PatternField(TokenField):
    """Token field for topic patterns.

    `changed` is emitted on every change, and `settled` when no text is being typed.
    """

    def patterns(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the included and the excluded patterns, including the text being typed."""
        wanted = [each.entry for each in self._tokens if not each.is_left_out]
        unwanted = [each.entry for each in self._tokens if each.is_left_out]
        more, less = parse_patterns(self.edit.text())
        return tuple(dict.fromkeys((*wanted, *more))), tuple(dict.fromkeys((*unwanted, *less)))

    def show_patterns(self, wanted: Sequence[str], unwanted: Sequence[str]) -> None:
        """Set the tokens to the given patterns.

        Args:
            wanted: Included patterns.
            unwanted: Excluded patterns.
        """
        if (tuple(wanted), tuple(unwanted)) == self.patterns():
            return
        for each in list(self._tokens):
            self._delete_token(each)
        self.edit.clear()
        self._add(wanted, unwanted)

    def _on_edited(self, text: str) -> None:
        # A space completes a pattern; "not" is combined with the pattern that follows.
        plain = text.replace(",", " ")
        finished, blank, rest = plain.rpartition(" ")
        words = finished.split()
        if words and words[-1].casefold() in {EXCLUDE_KEYWORD, _(EXCLUDE_KEYWORD).casefold()}:
            rest = f"{words.pop()} {rest}"
        if blank and words:
            self._add(*parse_patterns(" ".join(words)))
            self.edit.setText(rest)
        self.changed.emit()
        if not self.edit.text().strip():
            self.editing_finished.emit()

    def _end_typing(self) -> None:
        text = self.edit.text()
        if not text.strip():
            return
        wanted, unwanted = parse_patterns(text)
        self.edit.clear()
        self._add(wanted, unwanted)
        self.changed.emit()
        self.editing_finished.emit()

    def _add(self, wanted: Sequence[str], unwanted: Sequence[str]) -> None:
        there = {(each.entry, each.is_left_out) for each in self._tokens}
        for is_left_out, patterns in ((False, wanted), (True, unwanted)):
            for pattern in patterns:
                if (pattern, is_left_out) not in there:
                    self._add_token(Token(self._theme, pattern, is_left_out=is_left_out))
        self._arrange()
