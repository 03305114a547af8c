"""Maintain the translations in nep/locale; docs/translate.md describes the process.

    python tools/words.py update   after a change of texts: update .pot, .po and .mo from the sources
    python tools/words.py extract  only the template nep/locale/nep-studio.pot
    python tools/words.py compile  only generated files: .mo, languages.json and the pseudo-language
    python tools/words.py add fr   add a language
    python tools/words.py check    print inconsistencies; exit with 1 if there are any

An update keeps all translations whose English text still exists. Only this tool and translators write to
nep/locale.
"""

from __future__ import annotations

import argparse
import datetime as dt
import io
import json
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from babel import Locale
from babel.messages import Catalog
from babel.messages.extract import extract_from_file
from babel.messages.mofile import read_mo, write_mo
from babel.messages.pofile import read_po, write_po

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from nep.i18n import DOMAIN, EDITOR_CATALOGUE, ENGLISH, LOCALE_FOLDER, PSEUDO_LANGUAGE, placeholders  # noqa: E402 - started by its path
from tools.pseudo import MARKUP, pseudo, sentences_of_blocks, sentences_of_examples  # noqa: E402

KEYWORDS = {
    "_": None,
    "gettext": None,
    "lazy": None,
    "plazy": ((1, "c"), 2),
    "t": None,
    "ngettext": (1, 2),
    "pgettext": ((1, "c"), 2),
}
SOURCES = (
    ("nep", "*.py", "python"),
    ("app", "*.py", "python"),
    ("app/blocks/editor/src", "*.ts", "javascript"),
)
FOREIGN = (
    "Aborted!", "Aborted.", "Arguments", "Commands", "Error", "Missing command.",
    "Options", "Try [blue]'{command_path} {help_option}'[/] for help.",
    "[default: {}]", "[env var: {}]", "[required]",
    "options", "positional arguments", "show program's version number and exit",
    "show this help message and exit",
)  # fmt: skip
"""Texts of typer and argparse, which are translated with gettext, too."""
FORMATS = {"es": "es_419"}
"""Locales whose number and date formats are used for a language."""
_MADE = dt.datetime(2026, 11, 22, tzinfo=dt.timezone.utc)
"""Fixed date for file headers, so that unchanged texts produce unchanged files."""
_HEADER = "# All sentences of NEP Studio; made by tools/words.py (docs/translate.md)."


class Key(NamedTuple):
    """Key of a catalogue entry.

    Attributes:
        context: Translation context, or None.
        ids: English text, or singular and plural.
    """

    context: str | None
    ids: tuple[str, ...]


def template(root: Path = ROOT) -> Catalog:
    """Create a catalogue of all texts in the sources."""
    # imported here because hatch_build.py runs with only the build requirements installed
    from nep.cli.app import docstrings  # noqa: PLC0415

    catalog = Catalog(project="NEP Studio", creation_date=_MADE, header_comment=_HEADER, fuzzy=False)
    for folder, pattern, method in SOURCES:
        for path in sorted((root / folder).rglob(pattern)):
            if "node_modules" in path.parts or path == root / "nep" / "i18n.py":
                continue
            for messages, comments, context in _marked(method, path, path.stat().st_mtime_ns):
                ids = tuple(messages) if isinstance(messages, (list, tuple)) else (messages,)
                file = path.relative_to(root).as_posix()
                catalog.add(_id(ids), locations=[(file, 0)], auto_comments=comments, context=context)
    for english in FOREIGN:
        catalog.add(english, locations=[("typer", 0)])
    for _command, english in docstrings():
        catalog.add(english, locations=[("nep/cli", 0)])
    for english, file in sentences_of_robots(root):
        catalog.add(english, locations=[(file, 0)], context="robot")
    for context, english, file in (*sentences_of_blocks(), *sentences_of_examples()):
        catalog.add(english, locations=[(file, 0)], context=context)
    return catalog


@cache
def _marked(
    method: str, path: Path, _changed_ns: int
) -> list[tuple[str | tuple[str, ...], list[str], str | None]]:
    # (texts, comments for translators, context) of the marked texts in a file; cached by modification time.
    extracted = extract_from_file(
        method, path, keywords=KEYWORDS, comment_tags=("Translators:",), strip_comment_tags=True
    )
    return [(texts, comments, context) for _line, texts, comments, context in extracted]


def sentences_of_robots(root: Path) -> Iterator[tuple[str, str]]:
    """Yield (English text, file) for the robot descriptions shipped with Studio."""
    from app.blocks.toolbox.catalogue import is_translatable  # noqa: PLC0415 - as above

    for path in sorted((root / "resources" / "robots").glob("*.tm.jsonld")):
        file = path.relative_to(root).as_posix()
        for english in _of_description(json.loads(path.read_text(encoding="utf-8")), is_inside=False):
            if is_translatable(english):
                yield english, file


def _of_description(value: object, *, is_inside: bool) -> Iterator[str]:
    # Titles, descriptions and block texts; names and choices where these are missing.
    if isinstance(value, list):
        for item in value:
            yield from _of_description(item, is_inside=is_inside)
    if not isinstance(value, dict):
        return
    for key, item in value.items():
        if isinstance(item, str) and is_inside and key in {"title", "description"}:
            yield item
        elif key == "enum":
            yield from (str(choice).replace("_", " ") for choice in item)
        elif key == "rb:block":
            yield from (item[kind]["en"] for kind in ("text", "says") if "en" in item.get(kind, {}))
        elif key in {"actions", "properties", "events"}:
            yield from (name.replace("_", " ") for name, member in item.items() if "title" not in member)
            yield from _of_description(list(item.values()), is_inside=True)
        elif not key.startswith("rb:") or key == "rb:feedback":
            yield from _of_description(item, is_inside=is_inside)


def keys(catalog: Catalog) -> set[Key]:
    """Return the keys of a catalogue's entries, without the header."""
    return {Key(each.context or None, _ids(each.id)) for each in catalog if each.id}


def _id(ids: Sequence[str]) -> str | tuple[str, ...]:
    return ids[0] if len(ids) == 1 else tuple(ids)


def _ids(id: str | Sequence[str] | None) -> tuple[str, ...]:
    return (id or "",) if id is None or isinstance(id, str) else tuple(id)


def pot_file(folder: Path) -> Path:
    """Return the path of the template."""
    return folder / f"{DOMAIN}.pot"


def po_file(folder: Path, language: str) -> Path:
    """Return the path of a language's translations."""
    return folder / language / "LC_MESSAGES" / f"{DOMAIN}.po"


def languages(folder: Path) -> list[str]:
    """Return the sorted codes of languages that have a .po file."""
    return sorted(path.parents[1].name for path in folder.glob(f"*/LC_MESSAGES/{DOMAIN}.po"))


def read(path: Path, language: str | None = None) -> Catalog:
    """Read a .po or .pot file."""
    with path.open("rb") as stream:
        catalog: Catalog = read_po(stream, locale=language, domain=DOMAIN)
    return catalog


def write(catalog: Catalog, path: Path) -> None:
    """Write a .po or .pot file sorted by the English text, which keeps diffs small."""
    catalog.creation_date = _MADE
    for entry in catalog:
        entry.flags.discard("python-format")  # Babel misinterprets texts such as "%A is known"
    buffer = io.BytesIO()
    write_po(buffer, catalog, width=100, sort_output=True, ignore_obsolete=True, include_lineno=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(buffer.getvalue())


def extract(folder: Path = LOCALE_FOLDER) -> Catalog:
    """Write the template with all texts and return it."""
    catalog = template()
    write(catalog, pot_file(folder))
    return catalog


def update(folder: Path = LOCALE_FOLDER) -> None:
    """Update the template and all translations from the sources, and compile them."""
    pot = extract(folder)
    for language in languages(folder):
        catalog = read(po_file(folder, language), language)
        catalog.update(pot, no_fuzzy_matching=True)
        write(catalog, po_file(folder, language))
    compile_all(folder)


def add(language: str, folder: Path = LOCALE_FOLDER) -> None:
    """Create the .po file of a new language, with all texts untranslated."""
    about = f"# NEP Studio in '{language}'; see docs/translate.md."
    catalog = Catalog(
        locale=language, header_comment=about, project="NEP Studio", creation_date=_MADE, fuzzy=False
    )
    catalog.update(read(pot_file(folder)))
    write(catalog, po_file(folder, language))


def compile_all(folder: Path = LOCALE_FOLDER) -> None:
    """Write the generated files: compiled languages, the pseudo-language, and languages.json."""
    info_by_language: dict[str, Mapping[str, object]] = {ENGLISH: {"name": "English", "share": 1.0}}
    for language in languages(folder):
        catalog = read(po_file(folder, language), language)
        info_by_language[language] = language_info(language, catalog)
        _write_mo(catalog, po_file(folder, language).with_suffix(".mo"))
    compile_pseudo(folder)
    (folder / "languages.json").write_text(_json(info_by_language), encoding="utf-8")


def compile_pseudo(folder: Path = LOCALE_FOLDER) -> None:
    """Write the pseudo-language, which is not part of a release."""
    _write_mo(pseudo_catalog(read(pot_file(folder))), po_file(folder, PSEUDO_LANGUAGE).with_suffix(".mo"))


def _write_mo(catalog: Catalog, path: Path) -> None:
    catalog.creation_date = _MADE
    for entry in catalog:
        if not is_done(entry.string):
            entry.string = ""  # Babel would use English for untranslated plurals
    buffer = io.BytesIO()
    write_mo(buffer, catalog)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(
        f"{path.name}.{os.getpid()}"
    )  # so that programs starting meanwhile read either the old or the new file
    temporary.write_bytes(buffer.getvalue())
    temporary.replace(path)
    path.with_name(EDITOR_CATALOGUE).write_text(_json(_for_editor(catalog)), encoding="utf-8")


def _for_editor(catalog: Catalog) -> dict[str, str]:
    # Texts of the block editor's page, which can't read .mo files.
    return {
        str(each.id): str(each.string)
        for each in catalog
        if each.string and any(location.endswith(".ts") for location, _line in each.locations)
    }


def _json(value: Mapping[str, object]) -> str:
    return json.dumps(value, ensure_ascii=False, indent=1, sort_keys=True) + "\n"


def language_info(language: str, catalog: Catalog) -> dict[str, object]:
    """Return the native name of a language, its share of translated messages, and its formats.

    The formats are taken from Unicode's CLDR and stored in languages.json, so that programs don't need
    Babel.

    Args:
        language: Code of the language, such as "es".
        catalog: Catalogue of the language.
    """
    locale = Locale.parse(FORMATS.get(language, language))
    entries = [each for each in catalog if each.id]
    signs = locale.number_symbols["latn"]
    day = locale.datetime_skeletons["MMMMd"].pattern
    with_year = locale.date_formats["long"].pattern
    return {
        "name": (locale.get_language_name() or language).capitalize(),
        "share": round(sum(is_done(each.string) for each in entries) / max(1, len(entries)), 3),
        "decimal": signs["decimal"],
        "group": signs["group"],
        "and": _pattern(locale, "standard"),
        "or": _pattern(locale, "or"),
        "months": [locale.months["format"]["wide"][number] for number in range(1, 13)],
        "day": _date(day),
        "day_of_year": _date(with_year),
    }


def _pattern(locale: Locale, kind: str) -> dict[str, str]:
    return {name: locale.list_patterns[kind][name] for name in ("2", "start", "middle", "end")}


def _date(pattern: str) -> str:
    # `d 'de' MMMM` becomes "{day} de {month}", `M月d日` becomes "{month_number}月{day}日".
    return re.sub(r"'([^']*)'|(y+)|(MMM+)|(M+)|(d+)", _date_part, pattern)


def _date_part(match: re.Match[str]) -> str:
    if match[1] is not None:
        return str(match[1])
    names = ("{year}", "{month}", "{month_number}", "{day}")
    return next(name for name, part in zip(names, match.groups()[1:], strict=True) if part)


def is_done(string: str | Sequence[str] | None) -> bool:
    """Return True if a catalogue entry is translated, including all plural forms."""
    return all(_ids(string)) and bool(string)


def pseudo_catalog(pot: Catalog) -> Catalog:
    """Create a catalogue with all texts in the pseudo-language."""
    catalog = Catalog(project="NEP Studio", creation_date=_MADE, fuzzy=False)
    for entry in pot:
        if entry.id:
            forms = tuple(pseudo(each) for each in _ids(entry.id))
            catalog.add(entry.id, _id(forms), locations=entry.locations, context=entry.context)
    return catalog


def check(folder: Path = LOCALE_FOLDER) -> list[str]:
    """Return a sentence for each inconsistency between sources, template and translations."""
    current, pot = template(), read(pot_file(folder))
    problems = [
        f"'{_shown(key)}' is {difference}; run 'python tools/words.py update'"
        for difference, differing_keys in (
            (f"not in {DOMAIN}.pot", keys(current) - keys(pot)),
            (f"in {DOMAIN}.pot, but no longer in the sources", keys(pot) - keys(current)),
        )
        for key in sorted(differing_keys, key=str)
    ]
    info_by_language = _read_json(folder / "languages.json")
    for language in languages(folder):
        path = po_file(folder, language)
        catalog = read(path, language)
        problems += [f"{language}: {problem}" for problem in _wrong_entries(catalog)]
        if keys(catalog) != keys(pot):
            problems.append(
                f"{language}: its sentences are not those of the .pot; run 'tools/words.py update'"
            )
        made_of_it = (_translations_of(catalog), _for_editor(catalog), language_info(language, catalog))
        existing = (
            _compiled(path),
            _read_json(path.with_name(EDITOR_CATALOGUE)),
            info_by_language.get(language),
        )
        if made_of_it != existing:
            problems.append(f"{language}: compiled from other words; run 'python tools/words.py compile'")
    return problems


def _wrong_entries(catalog: Catalog) -> Iterator[str]:
    for entry in catalog:
        if not entry.id:
            continue
        key = Key(entry.context, _ids(entry.id))
        if entry.fuzzy:
            yield f"'{_shown(key)}' is marked as fuzzy"
        for form in filter(None, _ids(entry.string)):
            if placeholders(form) not in [placeholders(each) for each in key.ids]:
                yield f"'{form}' has not the holes of '{_shown(key)}'"
            if sorted(MARKUP.findall(form)) not in [sorted(MARKUP.findall(each)) for each in key.ids]:
                yield f"'{form}' has not the markup of '{_shown(key)}'"


def _translations_of(catalog: Catalog) -> dict[Key, tuple[str, ...]]:
    return {
        Key(_context(each.context), _ids(each.id)): _ids(each.string)
        for each in catalog
        if each.id and is_done(each.string)
    }


def _context(context: str | bytes | None) -> str | None:
    # Babel returns the contexts of a .mo as bytes.
    return (context.decode() if isinstance(context, bytes) else context) or None


def _compiled(po: Path) -> dict[Key, tuple[str, ...]]:
    path = po.with_suffix(".mo")
    if not path.is_file():
        return {}
    with path.open("rb") as stream:
        return _translations_of(read_mo(stream))


def _read_json(path: Path) -> Mapping[str, object]:
    content: Mapping[str, object] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return content


def _shown(key: Key) -> str:
    return key.ids[0] if len(key.ids[0]) <= 60 else f"{key.ids[0][:60]}…"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return 1 if the check failed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=["update", "extract", "compile", "add", "check"])
    parser.add_argument("language", nargs="?", help="for add: such as fr or pt_BR")
    options = parser.parse_args(arguments)
    if options.command == "add":
        if not options.language:
            parser.error("add needs a language")
        add(options.language)
    problems = check() if options.command == "check" else []
    if options.command in {"update", "add"}:
        update()
    elif options.command == "extract":
        extract()
    elif options.command == "compile":
        compile_all()
    for problem in problems:
        print(f"words: {problem}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
