"""Tests of the mnemonics of menu entries in every language."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.ui.shell.commands.table import MENUS
from app.ui.widgets.mnemonics import key_of, mnemonic_positions, strip_mnemonic, with_mnemonics
from nep import i18n
from tests.ui.shell_parts import COMMANDS


@pytest.fixture(params=["en", *sorted(i18n.known_languages())])
def language(request: pytest.FixtureRequest) -> Iterator[str]:
    i18n.set_initial_language(request.param)
    yield request.param
    i18n.set_initial_language("en")


def keys(texts: list[str]) -> list[str]:
    return [
        key_of(text[place])
        for text, place in zip(texts, mnemonic_positions(texts), strict=True)
        if place >= 0
    ]


def test_mnemonics_prefer_initial_letters_and_are_unique() -> None:
    assert keys(["Cut", "Copy", "Copy as image", "Paste", "Última", "42"]) == ["C", "O", "A", "P", "U"]
    assert mnemonic_positions(["aa", "aA", ""]) == [0, -1, -1]


def test_ampersand_and_shortcut_are_stripped_from_menu_texts() -> None:
    assert strip_mnemonic("C&ut\tCtrl+X") == "Cut"


def test_every_menu_of_the_menu_bar_has_a_unique_ascii_mnemonic(language: str) -> None:
    titles = with_mnemonics([i18n.gettext(name) for name in MENUS])
    chosen = [title[title.index("&") + 1].upper() for title in titles]
    assert len(set(chosen)) == len(MENUS), titles
    assert all(each.isascii() and each.isalpha() for each in chosen), titles


def test_mnemonics_are_unique_within_a_menu(language: str) -> None:
    for menu in MENUS:
        entries = [command.label for command in COMMANDS if command.menu == menu and not command.submenu]
        entries += {i18n.gettext(each.submenu) for each in COMMANDS if each.menu == menu and each.submenu}
        found = keys(entries)
        assert len(found) == len(set(found)) == len(entries), f"{menu}: {found}"
