"""Tests of the pseudo-language, which makes untranslated texts visible in tests."""

from __future__ import annotations

import pytest

from nep.i18n import _, format_list, ngettext, number
from tests import pseudo as shown
from tests.pseudo import marked, untranslated


@pytest.fixture
def one_sentence(pseudo, monkeypatch) -> None:
    found = frozenset({(None, "{robot} waits"), ("{count} robot", "{count} robots")})
    monkeypatch.setattr(shown, "marked", lambda: found)


def test_untranslated_words_are_detected(one_sentence) -> None:
    forgotten = "a word that nobody marked"
    assert untranslated(_(forgotten)) == ["word", "that", "nobody", "marked"]
    told = _("{robot} waits").format(robot="Pepper's friend")
    assert untranslated(told) == ["Pepper's", "friend"]
    assert untranslated(told, "Pepper's friend") == []
    assert untranslated(ngettext("{count} robot", "{count} robots", 2).format(count=2)) == []
    assert untranslated(ngettext("{count} word", "{count} words", 1).format(count=1)) == ["word"]


def test_lists_numbers_and_markup_are_recognized_as_translated(pseudo) -> None:
    assert untranslated(format_list(["Pepper", "ana", "ben"], "or"), "ana", "ben") == []
    assert number(0.5) == "0,5"
    assert untranslated("<b>3 ms</b> `nep topic list` Ctrl+Enter") == []


def test_translatable_texts_are_collected_from_sources_and_blocks() -> None:
    assert (None, "a word that nobody marked") not in marked()
    assert any(context == "block" for context, _english in marked())
    assert any(context is None for context, _english in marked())
