"""Write the reference in docs/api, one page per subject, from the docstrings of nep's public names.

    python tools/reference.py          write the pages
    python tools/reference.py --check  exit with 1 if a page is out of date

The sources are parsed without importing nep. Google style sections become tables of arguments and
attributes, followed by exceptions and results. Sentences that begin with the name of an argument or
with "Raises" are moved to these tables, too. `tests/test_reference.py` compares the pages with the
code.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import griffe

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "docs" / "api"
WIDTH = 118
MADE_BY = "Made from the docstrings by `python3 dev.py reference`; do not write here."


@dataclass(frozen=True)
class Field:
    """Page of the reference.

    Attributes:
        title: Heading of the page.
        words: Introduction.
        homes: Modules whose public names are on the page.
    """

    title: str
    words: str
    homes: tuple[str, ...]


PAGES: Mapping[str, Field] = {
    "nodes": Field(
        "Nodes, publishers and subscribers",
        'Begin with `nep.node("name")`; docs/first-programs.md shows how.',
        ("nep.nodes.node", "nep.nodes", "nep.backends.connection"),
    ),
    "messages": Field(
        "Messages",
        "What a subscriber gets, and what can be published beside plain values; see docs/types.md and "
        "docs/latency.md.",
        ("nep.messages",),
    ),
    "types": Field(
        "Types of robots' messages",
        "Dataclasses in `nep.geometry` and `nep.sensor`, for `new_pub` and `new_sub`; see docs/types.md.",
        ("nep.geometry", "nep.sensor"),
    ),
    "services": Field(
        "Services, surveys and parameters",
        "Programs that answer each other; see docs/services.md and docs/patterns.md.",
        ("nep.patterns.services", "nep.patterns.parameters"),
    ),
    "blackboard": Field(
        "Blackboards",
        "The newest value of each key; see docs/blackboard.md.",
        ("nep.programs",),
    ),
    "masters": Field(
        "Masters and the graph",
        "Who is there, and who talks to whom.",
        ("nep.masters.master", "nep.masters", "nep.system", "nep.protocol"),
    ),
    "errors": Field("Errors", "All of them are `NepError`s, and say what to do next.", ("nep.errors",)),
}
OWN_PAGES = ("nep.geometry", "nep.sensor")
"""Public modules with pages that list every name in their `__all__`."""
MADE_BY_HAND = frozenset(
    {"Node", "Master", "FixedServer", "FixedClient", "Blackboard", "ImageFormat", "Encoded"}
)
"""Classes that programs instantiate themselves, so that their constructor is documented.

All other classes are instantiated by nep, except for the message types.
"""
INTERNAL = frozenset({
    "Blackboard.deliver", "BlackboardWatch.attach", "BlackboardWatch.store_messages", "Client.join",
    "Master.epoch", "Master.submit", "Message.decoded", "Message.kind", "Message.raw",
    "Message.seen_ns", "Node.open_parameters", "NodeParameter.as_map", "NodeParameter.form",
    "NodeParameter.with_value", "Publisher.refuse", "Respondent.service", "Server.join",
    "Server.run_one", "Server.spun", "Subscriber.decoded", "Subscriber.is_typed",
    "Subscriber.payloads", "Subscriber.decoded_unshared", "Subscriber.typed", "Subscriber.want_messages",
    "Subscriber.want_payloads",
    "Timer.callback", "Timer.due", "Timer.run_if_due", "Timer.take_turn",
})  # fmt: skip
"""Public members that are omitted because only nep uses them."""
INTERNAL_EVERYWHERE = frozenset({"args", "forked", "node_closes"})
"""Names of members that are omitted in all classes."""
_BEGINNINGS: Mapping[str, str] = {"0": "int", "''": "str"}
"""Types of default values, keyed by the beginning of the value's source text."""

_SENTENCE = re.compile(r"(?<=[.!?]) +(?=[A-Z`\"(])")
_SAID = re.compile(r"`(\w+)`(?::| (?=(?:is|are|as|tells|says|has|counts|are|may)\b))\s*(.*)", re.DOTALL)
_LISTED = re.compile(r"^`(\w+)`\s+(.*)$")
_IN_COLUMNS = re.compile(r"`\w+`\s{2,}")
_SECTION = re.compile(r"(Args|Attributes|Raises|Returns|Yields):\n")
_ENTRY = re.compile(r"    (\w+): (.*)")
_PAGE = re.compile(r"\bdocs/([\w-]+\.md)")
_CODE = "    "


@dataclass(frozen=True)
class Words:
    """Parsed docstring.

    Attributes:
        paragraphs: Paragraphs outside of sections.
        names: Descriptions of arguments or attributes by name.
        raises: Descriptions of exceptions.
    """

    paragraphs: tuple[str, ...]
    names: Mapping[str, str]
    raises: tuple[str, ...]


def words_of(docstring: str, names: Iterable[str]) -> Words:
    """Parse a docstring.

    Args:
        docstring: Text of the docstring.
        names: Names of the documented object's arguments or attributes.
    """
    known, told, raises = frozenset(names), dict[str, str](), list[str]()
    paragraphs: list[str] = []
    is_first = True
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(docstring)):
        if paragraph.startswith(_CODE):
            paragraphs.append(paragraph)
            continue
        if section := _SECTION.match(paragraph):
            is_first = False
            _add_section(section[1], paragraph[section.end() :], paragraphs, told, raises)
            continue
        listed = _listed(paragraph)
        if listed:
            told.update(listed)
            continue
        kept = []
        for sentence in _SENTENCE.split(" ".join(paragraph.split())):
            said = None if is_first else _SAID.fullmatch(sentence)
            is_first = False
            if said and said.group(1) in known and said.group(1) not in told:
                told[said.group(1)] = said.group(2) if sentence[said.end(1) + 1] == ":" else sentence
            elif sentence.startswith("Raises "):
                raises.append(sentence.removeprefix("Raises "))
            else:
                kept.append(sentence)
        if kept:
            paragraphs.append(" ".join(kept))
    return Words(tuple(paragraphs), told, tuple(raises))


def _add_section(
    title: str, content: str, paragraphs: list[str], named: dict[str, str], raises: list[str]
) -> None:
    # Section in Google style.
    if title in {"Returns", "Yields"}:
        paragraphs.append(f"**{title}** {' '.join(content.split())}")
        return
    entries: list[tuple[str, str]] = []
    for line in content.splitlines():
        if entry := _ENTRY.fullmatch(line):
            entries.append((entry[1], entry[2]))
        elif entries:
            entries[-1] = entries[-1][0], f"{entries[-1][1]} {line.strip()}"
    if title == "Raises":
        raises += [f"`{name}`: {text}" for name, text in entries]
    else:
        named.update(entries)


def _listed(paragraph: str) -> Mapping[str, str]:
    # List of names with descriptions in columns.
    if not _IN_COLUMNS.match(paragraph):
        return {}
    found: dict[str, str] = {}
    last = ""
    for line in paragraph.splitlines():
        entry = _LISTED.match(line)
        if entry:
            last = entry.group(1)
            found[last] = entry.group(2)
        elif last and line.startswith("  "):
            found[last] += f" {line.strip()}"
        else:
            return {}
    return found


class Reference:
    """Generator of the reference pages.

    Args:
        package: The package nep, loaded by griffe.
    """

    def __init__(self, package: griffe.Module) -> None:
        self._package = package
        self._pages = {name: page for page in PAGES for name in self._names_on(page)}

    @property
    def names(self) -> frozenset[str]:
        """Public names that are documented on a page."""
        return frozenset(self._pages)

    def page(self, name: str) -> str:
        """Return the Markdown text of a page."""
        field = PAGES[name]
        parts = [
            f"# {field.title}",
            f"{MADE_BY} [All pages](README.md).",
            *self._filled(field.words),
        ]
        for each in self._names_on(name):
            parts += self._entry(each)
        return "\n\n".join(part.rstrip() for part in parts) + "\n"

    def contents(self) -> str:
        """Return the Markdown text of the index page, README.md."""
        lines = [
            "# The reference",
            MADE_BY,
        ]
        for page, field in PAGES.items():
            listed = ", ".join(f"[{each}]({page}.md#{_anchor(each)})" for each in self._names_on(page))
            lines += [f"## [{field.title}]({page}.md)", *self._filled(field.words), *self._filled(listed)]
        return "\n\n".join(lines) + "\n"

    @property
    def spellings(self) -> Mapping[str, str]:
        """Alternative spellings of public names in `nep.public`."""
        members = self._package["public"].members.items()
        return {name: str(each.value) for name, each in members if not each.is_alias and each.is_attribute}

    def _names_on(self, page: str) -> list[str]:
        homes = PAGES[page].homes
        placed = [
            (next(number for number, home in enumerate(homes) if _lies_in(found.path, home)), name)
            for name, found in self._public()
            if any(_lies_in(found.path, home) for home in homes)
        ]
        return [name for _, name in sorted(placed, key=lambda each: each[0])]

    def _public(self) -> Iterator[tuple[str, griffe.Object]]:
        public = self._package["public"]
        for name, member in public.members.items():
            if not name.startswith("_") and member.is_alias:
                yield name, _target(member)
        for home in OWN_PAGES:
            module = self._package[home.removeprefix("nep.")]
            for name in module.exports or ():
                yield str(name), _target(module.members[str(name)])

    def find(self, name: str) -> griffe.Object:
        """Return the object with the public name `name`."""
        return next(found for each, found in self._public() if each == name)

    def members(self, of: griffe.Class) -> list[griffe.Object]:
        """Return the public members of a class, including those inherited from nep."""
        bases = [base for base in of.mro() if base.path.startswith("nep.")]
        found: dict[str, griffe.Object] = {}
        for each in (of, *bases):
            for name, member in each.members.items():
                if not name.startswith("_") and name not in INTERNAL_EVERYWHERE:
                    found.setdefault(name, _target(member))
        return [
            member
            for name, member in found.items()
            if isinstance(member, griffe.Function | griffe.Attribute)
            and not any(f"{each.name}.{name}" in INTERNAL for each in (of, *bases))
        ]

    def _entry(self, name: str) -> list[str]:
        found = self.find(name)
        if isinstance(found, griffe.Class):
            return self._class_entry(name, found)
        if isinstance(found, griffe.Function):
            return [f"## {name}", *self._function(found, f"{name}")]
        value = found.value if isinstance(found, griffe.Attribute) else ""
        return [f"## {name}", _block(f"{name} = {value}"), *self._prose(words_of(_said(found), ()))]

    def _class_entry(self, name: str, found: griffe.Class) -> list[str]:
        members = self.members(found)
        attributes = [each for each in members if isinstance(each, griffe.Attribute)]
        made = found.members.get("__init__") or found.all_members.get("__init__")
        is_made = name in MADE_BY_HAND or found.module.path in OWN_PAGES
        start = made if is_made and isinstance(made, griffe.Function) else None
        arguments = [each.name for each in start.parameters if each.name != "self"] if start else []
        words = words_of(_said(found), [*(each.name for each in attributes), *arguments])
        parts = [f"## {name}"]
        if start is not None:
            parts.append(_block(self._signature(start, name, has_result=False)))
        parts += self._prose(words)
        parts += [f"`nep.{short}` is the same." for short, long in self.spellings.items() if long == name]
        if start is not None and name in MADE_BY_HAND:
            parts += self._arguments(start, words)
            attributes = [each for each in attributes if each.name not in arguments]
        kind = found.members.get("MSG_TYPE")
        if isinstance(kind, griffe.Attribute):
            attributes = [each for each in attributes if each.name != "MSG_TYPE"]
            parts.append(f"In the graph it is `{str(kind.value)[1:-1]}`.")
        parts += self._attributes(attributes, words, start if isinstance(start, griffe.Function) else made)
        parts += self._raises(words)
        for each in members:
            if isinstance(each, griffe.Function):
                parts += [f"### {name}.{each.name}", *self._function(each, each.name)]
        return parts

    def _function(self, found: griffe.Function, name: str) -> list[str]:
        words = words_of(_said(found), [each.name for each in found.parameters])
        parts = [_block(self._signature(found, name)), *self._prose(words)]
        return [*parts, *self._arguments(found, words), *self._raises(words)]

    def _prose(self, words: Words) -> list[str]:
        return [part for paragraph in words.paragraphs for part in self._filled(paragraph)]

    def _filled(self, paragraph: str) -> list[str]:
        if paragraph.startswith(_CODE):
            return [_block(textwrap.dedent(paragraph))]
        linked = self._linked(paragraph)
        return [textwrap.fill(linked, WIDTH, break_long_words=False, break_on_hyphens=False)]

    def _raises(self, words: Words) -> list[str]:
        return [part for each in words.raises for part in self._filled(f"**Raises** {each}")]

    def _arguments(self, of: griffe.Function, words: Words) -> list[str]:
        listed = [each for each in of.parameters if each.name != "self"]
        if not any(each.name in words.names for each in listed):
            return []
        rows = [
            f"| `{each.name}` | {_cell(self._type(each.annotation))} | {_cell(_default(each))} "
            f"| {self._linked(words.names.get(each.name, ''))} |"
            for each in listed
        ]
        return ["\n".join(("| argument | type | default | description |", "|---|---|---|---|", *rows))]

    def _attributes(self, attributes: Sequence[griffe.Attribute], words: Words, made: object) -> list[str]:
        # Attributes without an annotation have the type of the constructor's argument of the same name.
        arguments = made.parameters if isinstance(made, griffe.Function) else ()
        given = {each.name: each.annotation for each in arguments}
        rows = []
        for each in attributes:
            said = " ".join(_said(each).split()) or words.names.get(each.name, "")
            known = each.annotation if each.annotation is not None else given.get(each.name)
            kind = self._type(known) or _BEGINNINGS.get(str(each.value), "")
            rows.append(f"| `{each.name}` | {_cell(kind)} | {self._linked(said)} |")
        return ["\n".join(("| attribute | type | description |", "|---|---|---|", *rows))] if rows else []

    def _signature(self, found: griffe.Function, name: str, *, has_result: bool = True) -> str:
        result = self._type(found.returns) if has_result else ""
        end = f") -> {result}" if result else ")"
        before = "async " if "async" in found.labels else ""
        listed = _parameters(found, self._type)
        one_line = f"{before}{name}({', '.join(listed)}{end}"
        if len(one_line) <= 100:
            return one_line
        return "\n".join((f"{before}{name}(", *(f"    {each}," for each in listed), end))

    def _type(self, annotation: str | griffe.Expr | None) -> str:
        # Resolves nep's internal type aliases.
        said = "" if annotation is None else str(annotation)
        if '"' not in said:
            said = said.replace("'", '"')
        if not isinstance(annotation, griffe.Expr):
            return said
        for each in annotation.iterate(flat=True):
            if isinstance(each, griffe.ExprName) and each.name not in self._pages:
                alias = self._alias(each)
                if alias:
                    said = re.sub(rf"\b{each.name}\b", alias.replace("\\", r"\\"), said)
        return said

    def _alias(self, name: griffe.ExprName) -> str:
        path = name.canonical_path
        if not path.startswith("nep."):
            return ""
        try:
            found = _target(self._package[path.removeprefix("nep.")])
        except (KeyError, griffe.AliasResolutionError):
            return ""
        value = found.value if isinstance(found, griffe.Attribute) else None
        return self._type(value) if isinstance(value, griffe.Expr) and not _is_call(value) else ""

    def _linked(self, text: str) -> str:
        # Turns public names into links.

        def link(found: re.Match[str]) -> str:
            whole = found.group(1)
            page = self._pages.get(whole.removeprefix("nep.").partition(".")[0])
            name = whole.removeprefix("nep.")
            if page is None or not self._is_place(name):
                return found.group(0)
            return f"[`{whole}`]({page}.md#{_anchor(name)})"

        return _PAGE.sub(r"[\1](../\1)", re.sub(r"`([A-Za-z_][\w.]*)`", link, text))

    def _is_place(self, name: str) -> bool:
        # True if the name has a heading of its own.
        owner, _, member = name.partition(".")
        if owner not in self._pages or owner[0].islower():
            return not member and owner in self._pages and "_" in owner
        found = self.find(owner)
        if not member:
            return True
        return isinstance(found, griffe.Class) and any(
            each.name == member and isinstance(each, griffe.Function) for each in self.members(found)
        )


def _target(member: griffe.Object | griffe.Alias) -> griffe.Object:
    return member.final_target if isinstance(member, griffe.Alias) else member


def _said(found: griffe.Object) -> str:
    return found.docstring.value if found.docstring else ""


def _lies_in(path: str, home: str) -> bool:
    return path == home or path.startswith(f"{home}.")


def _is_call(value: griffe.Expr) -> bool:
    return isinstance(value, griffe.ExprCall)


def _anchor(heading: str) -> str:
    # Anchor as generated by GitHub.
    return re.sub(r"[^\w-]", "", heading.lower())


def _cell(text: str) -> str:
    return "`" + text.replace("|", "\\|") + "`" if text else ""


def _block(code: str) -> str:
    return f"```python\n{code}\n```"


def _default(of: griffe.Parameter) -> str:
    if of.default is None:
        return ""
    said = _value(of.default)
    if '"' not in said:
        said = said.replace("'", '"')
    is_internal = said.startswith(("field(", "_"))
    return "" if is_internal else said


def _value(of: str | griffe.Expr) -> str:
    # Source text of a value; constants of nep are replaced by their values.
    if isinstance(of, griffe.ExprName) and isinstance(of.parent, griffe.Object):
        try:
            found = _target(of.parent.modules_collection[of.canonical_path])
        except (KeyError, griffe.AliasResolutionError):
            return str(of)
        if isinstance(found, griffe.Attribute) and found.value is not None:
            return _value(found.value)
    return str(of)


def _parameters(of: griffe.Function, type_of: Callable[[str | griffe.Expr | None], str]) -> list[str]:
    listed: list[str] = []
    is_by_name = False
    for each in of.parameters:
        if each.name == "self":
            continue
        if each.kind is griffe.ParameterKind.keyword_only and not is_by_name:
            listed.append("*")
        is_by_name = is_by_name or each.kind in {
            griffe.ParameterKind.keyword_only,
            griffe.ParameterKind.var_positional,
        }
        stars = {griffe.ParameterKind.var_positional: "*", griffe.ParameterKind.var_keyword: "**"}
        said = f"{stars.get(each.kind, '')}{each.name}"
        annotation = type_of(each.annotation)
        said += f": {annotation}" if annotation else ""
        default = "" if each.kind in stars else _default(each)
        if default or (each.default is not None and each.kind not in stars):
            said += f" = {default or '...'}" if annotation else f"={default or '...'}"
        listed.append(said)
    return listed


def reference() -> Reference:
    """Load the current sources and return their reference."""
    package = griffe.load("nep", search_paths=[ROOT], allow_inspection=False, resolve_aliases=True)
    return Reference(cast("griffe.Module", package))


def pages() -> dict[str, str]:
    """Return the Markdown text of all pages by file name."""
    found = reference()
    return {"README.md": found.contents(), **{f"{each}.md": found.page(each) for each in PAGES}}


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the pages; return 1 if they are out of date."""
    parser = argparse.ArgumentParser(description="Write the reference from the docstrings.")
    parser.add_argument("--check", action="store_true", help="write nothing; 1 when a page is old")
    options = parser.parse_args(arguments)
    now = pages()
    there = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.md")}
    if options.check:
        return 0 if there == now else 1
    FOLDER.mkdir(exist_ok=True)
    for name in there.keys() - now.keys():
        (FOLDER / name).unlink()
    for name, page in now.items():
        (FOLDER / name).write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
