"""The words that people read, in their language: standard gettext, which a wrong translation can't break.

    from nep.i18n import _, ngettext

    _("no topic '{topic}' yet").format(topic=name)
    ngettext("{count} message", "{count} messages", count).format(count=count)

Sentences are whole, with named holes; they are never put together from pieces. A constant of a module is
marked with `lazy` and given to `_` when it is shown, so that the language that is chosen later still counts.

A program with a window or a command line chooses its language by `begin`. Everywhere else NEP_LANG decides,
or nobody: a library speaks English. The catalogue, one for everything, is in ``nep/locale``;
docs/translate.md tells the way of a word.
"""

from __future__ import annotations

import json
import logging
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from string import Formatter
from types import ModuleType
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from gettext import GNUTranslations

    from typing_extensions import Self

__all__ = [
    "DOMAIN",
    "EDITOR_WORDS",
    "ENGLISH",
    "LANG_VARIABLE",
    "LEAST_SHARE",
    "LOCALE",
    "PSEUDO",
    "_",
    "begin",
    "best_match",
    "day_text",
    "editor_words",
    "gettext",
    "holes",
    "install",
    "known_languages",
    "language",
    "lazy",
    "listed",
    "ngettext",
    "number",
    "offered",
    "pgettext",
    "plazy",
    "system_language",
    "translate",
]

DOMAIN = "nep-studio"
ENGLISH = "en"
PSEUDO = "qps"
"""The pseudo-language, made by ``tools/words.py compile``: every string longer, in brackets."""
EDITOR_WORDS = "editor.json"
LANG_VARIABLE = "NEP_LANG"
LEAST_SHARE = 0.9
"""How much of a language is translated when it can be chosen."""
LOCALE = Path(__file__).with_name("locale")

_BLOCK_HOLE = re.compile(r"%[A-Za-z_]\w*")
_PRINTF_HOLE = re.compile(r"%(?:\(\w+\)[sdr]|\d)")
_LISTS = {
    "and": {"2": "{0} and {1}", "start": "{0}, {1}", "middle": "{0}, {1}", "end": "{0} and {1}"},
    "or": {"2": "{0} or {1}", "start": "{0}, {1}", "middle": "{0}, {1}", "end": "{0} or {1}"},
}
_MONTHS = (
    "January", "February", "March", "April", "May", "June",
    "July", "August", "September", "October", "November", "December",
)  # fmt: skip
_log = logging.getLogger(__name__)


class _Meant(str):
    """English that `_` looks up with its context."""

    __slots__ = ("context",)

    def __new__(cls, context: str, message: str) -> Self:
        made = super().__new__(cls, message)
        made.context = context
        return made

    context: str


class _Words:
    """One language: what was translated already, each with the holes of its English."""

    def __init__(self, language: str, found: GNUTranslations | None, facts: Mapping[str, object]) -> None:
        self.language = language
        self._found = found
        self._facts = facts
        self._checked: dict[tuple[str | None, str], str] = {}
        self._is_wrong: set[str] = set()

    def one(self, context: str | None, english: str) -> str:
        if self._found is None or not english:
            return english
        key = context, english
        if key not in self._checked:
            told = self._found.gettext(english) if context is None else self._found.pgettext(context, english)
            self._checked[key] = told if self._fits(told, (english,)) else english
        return self._checked[key]

    def many(self, singular: str, plural: str, count: int) -> str:
        if self._found is not None:
            told = self._found.ngettext(singular, plural, count)
            if self._fits(told, (singular, plural)):
                return told
        return singular if count == 1 else plural

    def _fits(self, told: str, english: Sequence[str]) -> bool:
        """Whether a translation has the very holes of one of these; tells of each that has not, once."""
        if told in english or holes(told) in [holes(each) for each in english]:
            return True
        if told not in self._is_wrong:
            self._is_wrong.add(told)
            _log.warning("the translation '%s' has not the holes of '%s'; English is shown", told, english[0])
        return False

    def fact(self, name: str, default: str) -> str:
        found = self._facts.get(name)
        return found if isinstance(found, str) else default

    def months(self) -> Sequence[str]:
        found = self._facts.get("months")
        return found if isinstance(found, list) else _MONTHS

    def list_pattern(self, kind: str) -> Mapping[str, str]:
        found = self._facts.get(kind)
        return found if isinstance(found, dict) else _LISTS[kind]


_now: _Words | None = None


def _standard() -> ModuleType:
    """Python's own gettext; English needs none of it, so nobody waits for its import."""
    return import_module("gettext")


def _words() -> _Words:
    return _now if _now is not None else install(os.environ.get(LANG_VARIABLE, ENGLISH))


def install(wanted: str, folder: Path = LOCALE) -> _Words:
    """Use this language from now on, or English when it is not there or can't be read."""
    global _now  # noqa: PLW0603 - a process has one language, as it has one environment
    chosen = best_match(wanted, folder)
    found = None
    if chosen != ENGLISH:
        file = folder / chosen / "LC_MESSAGES" / f"{DOMAIN}.mo"
        try:
            with file.open("rb") as stream:
                found = _standard().GNUTranslations(stream)
        except Exception as error:  # noqa: BLE001 - a damaged catalogue may raise anything
            _log.warning("the words of '%s' can't be read from '%s': %s", chosen, file, error)
            chosen = ENGLISH
    facts = known_languages(folder).get(chosen, {}) if chosen != ENGLISH else {}
    _now = _Words(chosen, found, facts)
    return _now


def begin(chosen: str = "") -> None:
    """At the start of a program: use NEP_LANG, else what a person has `chosen`, else the computer's language.

    The computer's counts only when it is offered: nobody gets a half translated program unasked. The
    programs that this one starts follow it; so do the words of Python's own command lines.
    """
    install(os.environ.get(LANG_VARIABLE) or chosen or _computers_language())
    os.environ[LANG_VARIABLE] = language()
    if language() != ENGLISH:
        os.environ["LANGUAGE"] = language()
        _standard().bindtextdomain(DOMAIN, str(LOCALE))
        _standard().textdomain(DOMAIN)


def _computers_language() -> str:
    found = best_match(system_language())
    return found if found in dict(offered()) else ENGLISH


def editor_words(folder: Path = LOCALE) -> Mapping[str, str]:
    """The words of the block editor's page, by their English; empty for English."""
    file = folder / language() / "LC_MESSAGES" / EDITOR_WORDS
    if language() == ENGLISH or not file.is_file():
        return {}
    return {str(english): str(told) for english, told in json.loads(file.read_text(encoding="utf-8")).items()}


def offered(folder: Path = LOCALE) -> list[tuple[str, str]]:
    """(language, its own name) of each that can be chosen; the pseudo-language only while it is in use."""
    found = [
        (name, str(known.get("name", name)))
        for name, known in known_languages(folder).items()
        if isinstance(share := known.get("share"), float) and share >= LEAST_SHARE
    ]
    return [*found, (PSEUDO, "[Pseudo]")] if language() == PSEUDO else found


def language() -> str:
    """The language that is used now, such as "es"."""
    return _words().language


def gettext(message: str) -> str:
    """This sentence in the language that is used now; fill its holes afterwards with ``format``."""
    return _words().one(message.context if isinstance(message, _Meant) else None, message)


_ = gettext


def pgettext(context: str, message: str) -> str:
    """The same for a word that means several things: `context` tells a translator which one."""
    return _words().one(context, message)


def translate(context: str | None, message: str) -> str:
    """`gettext` or `pgettext`, for words of data: `tools/words.py` does not find them by this call."""
    return _words().one(context, message)


def ngettext(singular: str, plural: str, count: int) -> str:
    """The form that goes with `count`; fill the holes afterwards."""
    return _words().many(singular, plural, count)


def lazy(message: str) -> str:
    """Mark a constant for translators. It stays English: give it to `_` when it is shown."""
    return message


def plazy(context: str, message: str) -> str:
    """The same for a word that means several things, as with `pgettext`; it, too, is given to `_`."""
    return _Meant(context, message)


def listed(items: Sequence[str], kind: Literal["and", "or"] = "and") -> str:
    """Several as one: "a, b and c", or "a, b or c"."""
    if len(items) < 2:
        return "".join(items)
    pattern = _words().list_pattern(kind)
    if len(items) == 2:
        return pattern["2"].format(*items)
    text = pattern["end"].format(items[-2], items[-1])
    for item in reversed(items[1:-2]):
        text = pattern["middle"].format(item, text)
    return pattern["start"].format(items[0], text)


def number(value: float, spec: str = "g") -> str:
    """A number for people: ``format(value, spec)`` with the signs of the language that is used now."""
    words = _words()
    text = format(value, spec)
    signs = {".": words.fact("decimal", "."), ",": words.fact("group", ",")}
    return text if signs == {".": ".", ",": ","} else "".join(signs.get(each, each) for each in text)


def day_text(day: int, month: int, year: int | None = None) -> str:
    """A day as people say it: "17 November", "17 November 2025"."""
    words = _words()
    pattern = (
        words.fact("day", "{day} {month}")
        if year is None
        else words.fact("day_of_year", "{day} {month} {year}")
    )
    return pattern.format(day=day, month=words.months()[month - 1], year=year)


def holes(text: str) -> frozenset[str]:
    """What stands for something else in a sentence: ``{name}``, ``%NAME`` of a block, ``%(name)s``.

    Braces that are no holes count as they stand.
    """
    try:
        fields = {
            f"{{{name}!{conversion or ''}:{spec}}}"
            for _text, name, spec, conversion in Formatter().parse(text)
            if name is not None
        }
    except ValueError:
        fields = {each for each in text if each in "{}"}
    return frozenset((*fields, *_BLOCK_HOLE.findall(text), *_PRINTF_HOLE.findall(text)))


@lru_cache(maxsize=4)
def known_languages(folder: Path = LOCALE) -> Mapping[str, Mapping[str, object]]:
    """What is known of each language: its own ``name``, the translated ``share``, how it writes numbers.

    The file is made by ``tools/words.py compile``; empty when it is not there.
    """
    try:
        found = json.loads((folder / "languages.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def best_match(wanted: str, folder: Path = LOCALE) -> str:
    """The language that there is for a name such as "es_MX.UTF-8": "es"; English when there is none."""
    plain = re.split(r"[.@]", wanted.replace("-", "_"))[0].lower()
    if plain == PSEUDO:
        return PSEUDO
    there = {name.lower(): name for name in known_languages(folder)}
    return there.get(plain) or there.get(plain.partition("_")[0]) or ENGLISH


def system_language(environ: Mapping[str, str] = os.environ, platform: str = sys.platform) -> str:
    """What the computer is set to, such as "es_MX"; English when it does not tell."""
    for name in ("LANGUAGE", "LC_ALL", "LC_MESSAGES", "LANG"):
        told = environ.get(name, "").partition(":")[0]
        if told:
            return ENGLISH if told.partition(".")[0] in {"C", "POSIX"} else told
    ask = _ASK.get(platform)
    try:
        return (ask() if ask is not None else "") or ENGLISH
    except (OSError, ValueError, AttributeError, LookupError):
        return ENGLISH


def _ask_windows() -> str:
    kernel = import_module("ctypes").windll.kernel32
    return str(import_module("locale").windows_locale.get(int(kernel.GetUserDefaultUILanguage()), ""))


def _ask_macos() -> str:
    file = Path.home() / "Library" / "Preferences" / ".GlobalPreferences.plist"
    return str(import_module("plistlib").loads(file.read_bytes())["AppleLanguages"][0])


_ASK: Mapping[str, Callable[[], str]] = {"win32": _ask_windows, "darwin": _ask_macos}
