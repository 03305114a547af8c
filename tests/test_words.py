"""Tests of translations: all texts can be translated, and invalid translations fall back to English."""

from __future__ import annotations

import json
import logging
import re
import subprocess
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from types import ModuleType

import click
import pytest
import typer
from babel.messages.pofile import read_po

from app import resources
from app.blocks.toolbox.catalogue import Catalogue, categories, is_translatable
from app.blocks.toolbox.definitions import editor_definitions
from app.blocks.toolbox.help import help_of
from nep import i18n
from nep.cli.app import app as nep_command
from nep.i18n import _, format_list, install, lazy, ngettext, number, pgettext, plazy
from tests.blocks.samples import robot
from tests.pseudo import marked

pytestmark = pytest.mark.usefixtures("syntax_trees")
PO = r"""
msgid ""
msgstr ""
"Language: es\n"
"MIME-Version: 1.0\n"
"Content-Type: text/plain; charset=utf-8\n"
"Plural-Forms: nplurals=2; plural=(n != 1);\n"

msgid "wait for {robot}"
msgstr "esperar a {robot}"

msgid "one hole is missing: {robot}"
msgstr "falta uno"

msgid "one is wrong: {robot}"
msgstr "{robto} está mal"

msgid "one has braces: {robot}"
msgstr "{robot} {"

msgid "{count} message from {who}"
msgid_plural "{count} messages from {who}"
msgstr[0] "un mensaje de {who}"
msgstr[1] "{count} mensajes de {who}"

msgid "a message"
msgid_plural "{count} messages"
msgstr[0] "un mensaje"
msgstr[1] "{count} mensajes"

msgctxt "block"
msgid "wait %SECONDS s"
msgstr "esperar %SEGUNDOS s"

msgctxt "verb"
msgid "record"
msgstr "grabar"

msgctxt "noun"
msgid "record"
msgstr "récord"
"""


@pytest.fixture
def words() -> ModuleType:
    """Module tools.words, imported late because it needs Babel, a dependency of developers only."""
    from tools import words as tool

    return tool


@pytest.fixture(autouse=True)
def _english_again() -> Iterator[None]:
    yield
    install("en")


@pytest.fixture
def spanish(words, tmp_path) -> None:
    """Folder with a Spanish translation that contains mistakes; the language is set to Spanish."""
    file = words.po_file(tmp_path, "es")
    file.parent.mkdir(parents=True)
    file.write_text(PO, encoding="utf-8")
    words.write(words.Catalog(), words.pot_file(tmp_path))
    words.compile_all(tmp_path)
    install("es_MX.UTF-8", tmp_path)


@pytest.fixture(scope="module")
def pseudo_folder(tmp_path_factory) -> Path:
    """Folder with the pseudo-language, generated from the current sources."""
    from tools import words as tool

    folder = tmp_path_factory.mktemp("pseudo")
    tool.extract(folder)
    tool.compile_all(folder)
    return folder


@pytest.fixture
def pseudo(pseudo_folder) -> None:
    install("qps", pseudo_folder)


def is_pseudo(text: str) -> bool:
    return not is_translatable(text) or (text.strip().startswith("[") and text.strip().endswith("]"))


def test_translation_template_is_up_to_date(words) -> None:
    """If it fails, run ``python tools/words.py update``."""
    assert words.check() == []


def test_outdated_translation_template_is_reported(words, tmp_path) -> None:
    made = words.template()
    made.delete("A number.")
    made.add("A word that was taken out again.")
    words.write(made, words.pot_file(tmp_path))
    told = words.check(tmp_path)
    assert any("'A number.' is not in nep-studio.pot" in sentence for sentence in told)
    assert any("'A word that was taken out again.' is in nep-studio.pot" in sentence for sentence in told)


def test_check_rejects_translations_with_wrong_placeholders(words, spanish, tmp_path) -> None:
    told = "\n".join(words.check(tmp_path))
    for wrong in ("falta uno", "{robto} está mal", "{robot} {", "un mensaje de {who}", "esperar %SEGUNDOS s"):
        assert f"es: '{wrong}' has other placeholders than" in told
    assert "'un mensaje'" not in told


def test_invalid_translation_falls_back_to_english_and_is_logged_once(spanish, caplog) -> None:
    assert _("wait for {robot}").format(robot="Pepper") == "esperar a Pepper"
    for english in ("one hole is missing: {robot}", "one is wrong: {robot}", "one has braces: {robot}"):
        with caplog.at_level(logging.WARNING):
            caplog.clear()
            assert _(english).format(robot="Pepper") == english.format(robot="Pepper")
            assert _(english) == english
        assert len(caplog.records) == 1
    assert pgettext("block", "wait %SECONDS s") == "wait %SECONDS s"


def test_translations_depend_on_plural_form_and_context(spanish) -> None:
    said = [ngettext("a message", "{count} messages", count).format(count=count) for count in (0, 1, 2)]
    assert said == ["0 mensajes", "un mensaje", "2 mensajes"]
    many = ngettext("{count} message from {who}", "{count} messages from {who}", 2)
    assert many.format(count=2, who="a") == "2 mensajes de a"
    assert pgettext("verb", "record") == "grabar"
    assert pgettext("noun", "record") == "récord"
    assert pgettext("neither", "record") == "record"


def test_lazy_constant_follows_a_later_language_change(words, tmp_path, spanish) -> None:
    constant = lazy("wait for {robot}")
    assert _(constant) == "esperar a {robot}"
    install("en", tmp_path)
    assert _(constant) == "wait for {robot}"


def test_lazy_constant_keeps_its_context(words, tmp_path, spanish) -> None:
    verb, noun = plazy("verb", "record"), plazy("noun", "record")
    assert (_(verb), _(noun)) == ("grabar", "récord")
    install("en", tmp_path)
    assert (_(verb), _(noun)) == ("record", "record")
    assert f"{verb}" == "record"


def test_lists_numbers_and_dates_are_localized(spanish) -> None:
    assert format_list(["a", "b", "c", "d"]) == "a, b, c y d"
    assert format_list(["a", "b"], "or") == "a o b"
    assert number(1234.5, ",.1f") == "1,234.5"  # as in most of Latin America
    assert i18n.day_text(3, 11) == "3 de noviembre"
    assert i18n.day_text(3, 11, 2026) == "3 de noviembre de 2026"
    install("en")
    assert [format_list(list(names)) for names in ("", "a", "ab", "abcd")] == [
        "",
        "a",
        "a and b",
        "a, b, c and d",
    ]
    assert i18n.day_text(3, 11, 2026) == "3 November 2026"


def test_numbers_use_the_separators_of_the_language(monkeypatch, tmp_path, words) -> None:
    monkeypatch.setattr(words, "FORMATS", {"es": "es_ES"})
    words.po_file(tmp_path, "es").parent.mkdir(parents=True)
    words.po_file(tmp_path, "es").write_text(PO, encoding="utf-8")
    words.write(words.Catalog(), words.pot_file(tmp_path))
    words.compile_all(tmp_path)
    install("es", tmp_path)
    assert number(1234.5, ",.1f") == "1.234,5"


@pytest.mark.parametrize(
    "data", [b"", b"\xde\x12\x04\x95", b"\xde\x12\x04\x95" + b"\xff" * 40, b"words" * 20]
)
def test_damaged_catalogue_falls_back_to_english(data, spanish, tmp_path, caplog) -> None:
    (tmp_path / "es" / "LC_MESSAGES" / "nep-studio.mo").write_bytes(data)
    install("es", tmp_path)
    assert i18n.language() == "en"
    assert _("wait for {robot}") == "wait for {robot}"
    assert "can't load" in caplog.text


def test_system_language_is_read_from_the_environment_and_matched_to_known_languages() -> None:
    assert i18n.system_language({"LANG": "es_MX.UTF-8"}) == "es_MX.UTF-8"
    assert i18n.system_language({"LANGUAGE": "es:en", "LANG": "C.UTF-8"}) == "es"
    assert i18n.system_language({"LC_ALL": "C.UTF-8", "LANG": "es_MX"}) == "en"
    assert i18n.system_language({}, "linux") == "en"
    assert [i18n.best_match(name) for name in ("es-419", "ES", "xx_YY", "", "qps")] == [
        "es",
        "es",
        "en",
        "en",
        "qps",
    ]


def test_nep_lang_overrides_the_language_setting(monkeypatch) -> None:
    monkeypatch.setenv("NEP_LANG", "en")
    i18n.set_initial_language("es")
    assert i18n.language() == "en"


@pytest.mark.parametrize(("share", "expected"), [(0.9, "es"), (0.89, "en")])
def test_system_language_is_used_if_90_per_cent_of_its_texts_are_translated(
    share, expected, spanish, monkeypatch
) -> None:
    monkeypatch.setenv("NEP_LANG", "")
    monkeypatch.setenv("LANGUAGE", "es_MX")
    known = {"en": {"share": 1.0}, "es": {"share": share}}
    monkeypatch.setattr(i18n, "known_languages", lambda _folder: known)
    i18n.set_initial_language()
    assert i18n.language() == expected
    monkeypatch.setenv("NEP_LANG", "")
    i18n.set_initial_language("es")
    assert i18n.language() == "es"
    monkeypatch.setenv("NEP_LANG", "es_MX")
    i18n.set_initial_language("en")
    assert i18n.language() == "es"


def test_pseudo_language_is_offered_only_while_in_use(pseudo, pseudo_folder) -> None:
    install("en")
    assert "qps" not in dict(i18n.selectable_languages())
    assert dict(i18n.selectable_languages())["en"] == "English"
    install("qps", pseudo_folder)
    assert "qps" in dict(i18n.selectable_languages())


def test_pseudo_text_is_longer_and_keeps_placeholders_and_code(words) -> None:
    made = words.pseudo("Run {robot} with `nep master`, %SECONDS s")
    assert made.startswith("[Řúñ {robot} ŵíťĥ `nep master`, %SECONDS š ~")
    assert made.endswith("~]")
    assert len(made) > 1.3 * len("Run {robot} with `nep master`, %SECONDS s")
    assert words.pseudo("{robot} waits")[:3] == "[~{"


def test_every_text_of_the_toolbox_is_translated(pseudo) -> None:
    for category in categories():
        assert is_pseudo(category.title)
        for described in category.blocks:
            for text in (described.text, described.tooltip, described.help):
                assert not text or is_pseudo(text), (described.type, text)
    told = editor_definitions([robot()])
    contents = told["toolbox"]["contents"]  # type: ignore[index]
    assert all(is_pseudo(each["name"]) for each in contents if each["kind"] != "robotHeading")


def test_every_block_help_is_translated(pseudo) -> None:
    for described in Catalogue([]).blocks.values():
        told = help_of(described)
        for text in (told["does"], told["more"], told["example"], *(words for _name, words in told["gaps"])):
            assert not text or is_pseudo(text) or "[" in text, (described.type, text)
        for name, _words in told["gaps"]:
            assert is_pseudo(name), (described.type, name)


def test_translated_block_is_found_by_its_english_words(pseudo) -> None:
    found = {described.type: described for category in categories() for described in category.blocks}
    assert "array" in found["lists_empty"].english_search_words
    assert found["lists_empty"].search_words.startswith("[")


def test_python_code_of_blocks_is_independent_of_the_language(pseudo) -> None:
    translated = {described.type: described.python for each in categories() for described in each.blocks}
    install("en")
    assert translated == {
        described.type: described.python for each in categories() for described in each.blocks
    }


def test_every_help_page_of_the_command_line_is_translated(pseudo) -> None:
    def pages(command: click.Command) -> Iterator[click.Command]:
        yield command
        for inner in getattr(command, "commands", {}).values():
            yield from pages(inner)

    found = list(pages(typer.main.get_command(nep_command)))
    assert len(found) > 8
    for page in found:
        assert is_pseudo(_(page.help or "")), page.name
        for parameter in page.params:
            words = getattr(parameter, "help", None) or ""
            ours = "completion" not in words and not words.startswith(
                ("Show this message", "Address of the master (default:")
            )
            assert not ours or is_pseudo(_(words)), (page.name, words)


def test_nep_import_does_not_load_gettext_in_english() -> None:
    """English needs neither the module gettext nor the list of languages."""
    code = "import sys, nep, nep.errors; from nep.i18n import _; _('x'); print('gettext' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_every_marked_text_is_in_the_template(words) -> None:
    """Babel does not find calls inside f-strings; Python's parser does."""
    ids = [(entry.context or None, words._ids(entry.id)) for entry in words.template()]
    found = {each if len(each) == 2 else (context, *each) for context, each in ids}
    assert [each for each in marked() if each not in found] == []


# Blockly messages requested by the editor's bundle but never shown or announced.
UNSEEN = {
    "SHORTCUTS_": "names for a list of keys that is not in the bundle: ours is F1",
    "ARIA_LABEL_TRASH": "our bin says it",
    "OPEN_TRASH": "our bin says it",
    "RESET_ZOOM": "our buttons say it",
    "ZOOM_": "our buttons say it",
}
BLOCKLY_WORDS = Path(__file__).resolve().parents[1] / "app/blocks/editor/src/blockly_words.ts"
# Names of keys that are the same in Spanish.
ALIKE = frozenset(
    {"ALT_KEY", "CONTEXT_MENU_KEY", "DELETE_KEY", "END_KEY", "ESCAPE", "HOME_KEY", "INSERT_KEY"}
    | {"BACKSPACE_KEY", "CAPS_LOCK_KEY", "PAGE_DOWN_KEY", "PAGE_UP_KEY", "PAUSE_KEY", "TAB_KEY"}
)


def test_texts_of_blockly_are_translated_to_spanish() -> None:
    folder = resources.path("blockly")
    english, spanish = (json.loads((folder / f"msg/{each}.json").read_text("utf-8")) for each in ("en", "es"))
    in_bundle = set(re.findall(r"\b[A-Z][A-Z_0-9]+\b", (folder / "editor.js").read_text("utf-8")))
    table = re.findall(r"^  (\w+): lazy\('(.+)'\),$", BLOCKLY_WORDS.read_text("utf-8"), re.MULTILINE)
    install("es")
    ours = {key: _(words) for key, words in table}
    asked = {key for key in english if key in in_bundle and not key.startswith(tuple(UNSEEN))} - ALIKE
    assert len(asked) > 100
    same = {key for key in asked if ours.get(key, spanish.get(key)) in (None, english[key])}
    assert not same


TWO_WORDS = {
    r"[«»]": "“ and ”, as everywhere",
    r"\b[Aa]ñad": "agregar",
    r"\b[Oo]rdenador": "computadora",
    r"\b[Ee]limin": "borrar, or quitar",
    r"\b[Gg]ui[oó]n": "programa",
    r"\b[Ll]ienzo": "página",
    r"\bEnter\b|\bEntrar\b": "Intro",
    r"\bShift\b": "Mayús",
    r"\b[Uu]sted|\b[Hh]aga clic": "tú: the words are for whoever sits there",
}
"""Patterns of rejected Spanish words, and the word to use instead."""


def test_spanish_terms_are_consistent() -> None:
    path = i18n.LOCALE_FOLDER / "es" / "LC_MESSAGES" / f"{i18n.DOMAIN}.po"
    catalogue = read_po(BytesIO(path.read_bytes()))
    said = [
        each for message in catalogue if not (message.context or "").startswith("words to find")
        for each in (message.string if isinstance(message.string, tuple) else (message.string,))
    ]  # fmt: skip
    assert len(said) > 2000
    wrong = [
        f"{each}: {instead}" for each in said for two, instead in TWO_WORDS.items() if re.search(two, each)
    ]
    assert wrong == []
