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
GENERATED_BY = "Generated from the docstrings by `python3 dev.py reference`; don't edit."


@dataclass(frozen=True)
class PageSpec:
    """Page of the reference.

    Attributes:
        title: Heading of the page.
        introduction: Text below the heading.
        modules: Modules whose public names are on the page.
    """

    title: str
    introduction: str
    modules: tuple[str, ...]


PAGES: Mapping[str, PageSpec] = {
    "nodes": PageSpec(
        "Nodes, publishers and subscribers",
        'Start with `nep.node("name")`; see docs/first-programs.md.',
        ("nep.nodes.node", "nep.nodes", "nep.backends.connection"),
    ),
    "messages": PageSpec(
        "Messages",
        "Received messages, and payloads other than plain values; see docs/types.md and docs/latency.md.",
        ("nep.messages",),
    ),
    "types": PageSpec(
        "Types of robot messages",
        "Dataclasses in `nep.geometry` and `nep.sensor`, for `new_pub` and `new_sub`; see docs/types.md.",
        ("nep.geometry", "nep.sensor"),
    ),
    "services": PageSpec(
        "Services, surveys and parameters",
        "Requests and replies between programs; see docs/services.md and docs/patterns.md.",
        ("nep.patterns.services", "nep.patterns.parameters"),
    ),
    "blackboard": PageSpec(
        "Blackboards",
        "The newest value of each key; see docs/blackboard.md.",
        ("nep.programs",),
    ),
    "masters": PageSpec(
        "Masters and the graph",
        "The nodes, topics and connections of a network.",
        ("nep.masters.master", "nep.masters", "nep.system", "nep.protocol"),
    ),
    "errors": PageSpec(
        "Errors",
        "All errors are subclasses of `NepError`; their messages say how to solve the problem.",
        ("nep.errors",),
    ),
}
OWN_PAGES = ("nep.geometry", "nep.sensor")
"""Public modules with pages that list every name in their `__all__`."""
INSTANTIATED_BY_PROGRAMS = frozenset(
    {"Node", "Master", "FixedServer", "FixedClient", "Blackboard", "ImageFormat", "Encoded"}
)
"""Classes that programs instantiate themselves, so that their constructor is documented.

All other classes are instantiated by nep, except for the message types.
"""
INTERNAL = frozenset({
    "Blackboard.deliver", "BlackboardWatch.attach", "BlackboardWatch.store_messages", "Client.join",
    "Master.epoch", "Master.submit", "Message.decoded", "Message.kind", "Message.raw",
    "Message.payload_or_extension", "Message.seen_ns", "Node.open_parameters", "NodeParameter.as_map",
    "NodeParameter.form", "NodeParameter.with_value", "Publisher.refuse", "Respondent.service", "Server.join",
    "Server.run_one", "Server.spin_queue", "Subscriber.decoded", "Subscriber.is_typed",
    "Subscriber.decoded_unshared", "Subscriber.take", "Subscriber.typed",
    "Timer.callback", "Timer.due", "Timer.run_if_due", "Timer.claim_tick",
})  # fmt: skip
"""Public members that are omitted because only nep uses them."""
INTERNAL_EVERYWHERE = frozenset({"args", "on_node_close"})
"""Names of members that are omitted in all classes."""
_BEGINNINGS: Mapping[str, str] = {"0": "int", "''": "str"}
"""Types of default values, keyed by the beginning of the value's source text."""

_SENTENCE = re.compile(r"(?<=[.!?]) +(?=[A-Z`\"(])")
_ARGUMENT_SENTENCE = re.compile(
    r"`(\w+)`(?::| (?=(?:is|are|as|tells|says|has|counts|are|may)\b))\s*(.*)", re.DOTALL
)
_LISTED = re.compile(r"^`(\w+)`\s+(.*)$")
_IN_COLUMNS = re.compile(r"`\w+`\s{2,}")
_SECTION = re.compile(r"(Args|Attributes|Raises|Returns|Yields):\n")
_ENTRY = re.compile(r"    (\w+): (.*)")
_PAGE = re.compile(r"\bdocs/([\w-]+\.md)")
_CODE = "    "


@dataclass(frozen=True)
class ParsedDocstring:
    """Parsed docstring.

    Attributes:
        paragraphs: Paragraphs outside of sections.
        names: Descriptions of arguments or attributes by name.
        raises: Descriptions of exceptions.
    """

    paragraphs: tuple[str, ...]
    names: Mapping[str, str]
    raises: tuple[str, ...]


def parse_docstring(docstring: str, names: Iterable[str]) -> ParsedDocstring:
    """Parse a docstring.

    Args:
        docstring: Text of the docstring.
        names: Names of the documented object's arguments or attributes.
    """
    known_names, descriptions, raises = frozenset(names), dict[str, str](), list[str]()
    paragraphs: list[str] = []
    is_first = True
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(docstring)):
        if paragraph.startswith(_CODE):
            paragraphs.append(paragraph)
            continue
        if section := _SECTION.match(paragraph):
            is_first = False
            _add_section(section[1], paragraph[section.end() :], paragraphs, descriptions, raises)
            continue
        entries = _listed(paragraph)
        if entries:
            descriptions.update(entries)
            continue
        remaining = []
        for sentence in _SENTENCE.split(" ".join(paragraph.split())):
            match = None if is_first else _ARGUMENT_SENTENCE.fullmatch(sentence)
            is_first = False
            if match and match.group(1) in known_names and match.group(1) not in descriptions:
                descriptions[match.group(1)] = (
                    match.group(2) if sentence[match.end(1) + 1] == ":" else sentence
                )
            elif sentence.startswith("Raises "):
                raises.append(sentence.removeprefix("Raises "))
            else:
                remaining.append(sentence)
        if remaining:
            paragraphs.append(" ".join(remaining))
    return ParsedDocstring(tuple(paragraphs), descriptions, tuple(raises))


def _add_section(
    title: str, content: str, paragraphs: list[str], descriptions: dict[str, str], raises: list[str]
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
        descriptions.update(entries)


def _listed(paragraph: str) -> Mapping[str, str]:
    # List of names with descriptions in columns.
    if not _IN_COLUMNS.match(paragraph):
        return {}
    descriptions: dict[str, str] = {}
    last = ""
    for line in paragraph.splitlines():
        entry = _LISTED.match(line)
        if entry:
            last = entry.group(1)
            descriptions[last] = entry.group(2)
        elif last and line.startswith("  "):
            descriptions[last] += f" {line.strip()}"
        else:
            return {}
    return descriptions


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
            f"{GENERATED_BY} [All pages](README.md).",
            *self._filled(field.introduction),
        ]
        for entry_name in self._names_on(name):
            parts += self._entry(entry_name)
        return "\n\n".join(part.rstrip() for part in parts) + "\n"

    def contents(self) -> str:
        """Return the Markdown text of the index page, README.md."""
        lines = [
            "# The reference",
            GENERATED_BY,
        ]
        for page, field in PAGES.items():
            links = ", ".join(f"[{each}]({page}.md#{_anchor(each)})" for each in self._names_on(page))
            lines += [
                f"## [{field.title}]({page}.md)",
                *self._filled(field.introduction),
                *self._filled(links),
            ]
        return "\n\n".join(lines) + "\n"

    @property
    def spellings(self) -> Mapping[str, str]:
        """Alternative spellings of public names in `nep.public`."""
        members = self._package["public"].members.items()
        return {name: str(each.value) for name, each in members if not each.is_alias and each.is_attribute}

    def _names_on(self, page: str) -> list[str]:
        modules = PAGES[page].modules
        indexed = [
            (next(number for number, module in enumerate(modules) if _is_in(item.path, module)), name)
            for name, item in self._public()
            if any(_is_in(item.path, module) for module in modules)
        ]
        return [name for _, name in sorted(indexed, key=lambda each: each[0])]

    def _public(self) -> Iterator[tuple[str, griffe.Object]]:
        public = self._package["public"]
        for name, member in public.members.items():
            if not name.startswith("_") and member.is_alias:
                yield name, _target(member)
        for path in OWN_PAGES:
            module = self._package[path.removeprefix("nep.")]
            for name in module.exports or ():
                yield str(name), _target(module.members[str(name)])

    def find(self, name: str) -> griffe.Object:
        """Return the object with the public name `name`."""
        return next(item for each, item in self._public() if each == name)

    def members(self, cls: griffe.Class) -> list[griffe.Object]:
        """Return the public members of a class, including those inherited from nep."""
        bases = [base for base in cls.mro() if base.path.startswith("nep.")]
        members_by_name: dict[str, griffe.Object] = {}
        for ancestor in (cls, *bases):
            for name, member in ancestor.members.items():
                if not name.startswith("_") and name not in INTERNAL_EVERYWHERE:
                    members_by_name.setdefault(name, _target(member))
        return [
            member
            for name, member in members_by_name.items()
            if isinstance(member, griffe.Function | griffe.Attribute)
            and not any(f"{ancestor.name}.{name}" in INTERNAL for ancestor in (cls, *bases))
        ]

    def _entry(self, name: str) -> list[str]:
        item = self.find(name)
        if isinstance(item, griffe.Class):
            return self._class_entry(name, item)
        if isinstance(item, griffe.Function):
            return [f"## {name}", *self._function(item, f"{name}")]
        value = item.value if isinstance(item, griffe.Attribute) else ""
        return [
            f"## {name}",
            _block(f"{name} = {value}"),
            *self._prose(parse_docstring(_docstring_of(item), ())),
        ]

    def _class_entry(self, name: str, cls: griffe.Class) -> list[str]:
        members = self.members(cls)
        attributes = [member for member in members if isinstance(member, griffe.Attribute)]
        constructor = cls.members.get("__init__") or cls.all_members.get("__init__")
        has_constructor = name in INSTANTIATED_BY_PROGRAMS or cls.module.path in OWN_PAGES
        start = constructor if has_constructor and isinstance(constructor, griffe.Function) else None
        arguments = [member.name for member in start.parameters if member.name != "self"] if start else []
        docs = parse_docstring(_docstring_of(cls), [*(member.name for member in attributes), *arguments])
        parts = [f"## {name}"]
        if start is not None:
            parts.append(_block(self._signature(start, name, has_result=False)))
        parts += self._prose(docs)
        parts += [
            f"Also available as `nep.{short}`."
            for short, full_name in self.spellings.items()
            if full_name == name
        ]
        if start is not None and name in INSTANTIATED_BY_PROGRAMS:
            parts += self._arguments(start, docs)
            attributes = [member for member in attributes if member.name not in arguments]
        kind = cls.members.get("MSG_TYPE")
        if isinstance(kind, griffe.Attribute):
            attributes = [member for member in attributes if member.name != "MSG_TYPE"]
            parts.append(f"Message type: `{str(kind.value)[1:-1]}`.")
        parts += self._attributes(
            attributes, docs, start if isinstance(start, griffe.Function) else constructor
        )
        parts += self._raises(docs)
        for member in members:
            if isinstance(member, griffe.Function):
                parts += [f"### {name}.{member.name}", *self._function(member, member.name)]
        return parts

    def _function(self, function: griffe.Function, name: str) -> list[str]:
        docs = parse_docstring(_docstring_of(function), [each.name for each in function.parameters])
        parts = [_block(self._signature(function, name)), *self._prose(docs)]
        return [*parts, *self._arguments(function, docs), *self._raises(docs)]

    def _prose(self, docs: ParsedDocstring) -> list[str]:
        return [part for paragraph in docs.paragraphs for part in self._filled(paragraph)]

    def _filled(self, paragraph: str) -> list[str]:
        if paragraph.startswith(_CODE):
            return [_block(textwrap.dedent(paragraph))]
        linked = self._linked(paragraph)
        return [textwrap.fill(linked, WIDTH, break_long_words=False, break_on_hyphens=False)]

    def _raises(self, docs: ParsedDocstring) -> list[str]:
        return [part for each in docs.raises for part in self._filled(f"**Raises** {each}")]

    def _arguments(self, function: griffe.Function, docs: ParsedDocstring) -> list[str]:
        parameters = [each for each in function.parameters if each.name != "self"]
        if not any(each.name in docs.names for each in parameters):
            return []
        rows = [
            f"| `{each.name}` | {_cell(self._type(each.annotation))} | {_cell(_default(each))} "
            f"| {self._linked(docs.names.get(each.name, ''))} |"
            for each in parameters
        ]
        return ["\n".join(("| argument | type | default | description |", "|---|---|---|---|", *rows))]

    def _attributes(
        self, attributes: Sequence[griffe.Attribute], docs: ParsedDocstring, constructor: object
    ) -> list[str]:
        # Attributes without an annotation have the type of the constructor's argument of the same name.
        arguments = constructor.parameters if isinstance(constructor, griffe.Function) else ()
        given = {attribute.name: attribute.annotation for attribute in arguments}
        rows = []
        for attribute in attributes:
            description = " ".join(_docstring_of(attribute).split()) or docs.names.get(attribute.name, "")
            annotation = (
                attribute.annotation if attribute.annotation is not None else given.get(attribute.name)
            )
            kind = self._type(annotation) or _BEGINNINGS.get(str(attribute.value), "")
            rows.append(f"| `{attribute.name}` | {_cell(kind)} | {self._linked(description)} |")
        return ["\n".join(("| attribute | type | description |", "|---|---|---|", *rows))] if rows else []

    def _signature(self, function: griffe.Function, name: str, *, has_result: bool = True) -> str:
        result = self._type(function.returns) if has_result else ""
        end = f") -> {result}" if result else ")"
        before = "async " if "async" in function.labels else ""
        parameters = _parameters(function, self._type)
        one_line = f"{before}{name}({', '.join(parameters)}{end}"
        if len(one_line) <= 100:
            return one_line
        return "\n".join((f"{before}{name}(", *(f"    {each}," for each in parameters), end))

    def _type(self, annotation: str | griffe.Expr | None) -> str:
        # Resolves nep's internal type aliases.
        text = "" if annotation is None else str(annotation)
        if '"' not in text:
            text = text.replace("'", '"')
        if not isinstance(annotation, griffe.Expr):
            return text
        for element in annotation.iterate(flat=True):
            if isinstance(element, griffe.ExprName) and element.name not in self._pages:
                alias = self._alias(element)
                if alias:
                    text = re.sub(rf"\b{element.name}\b", alias.replace("\\", r"\\"), text)
        return text

    def _alias(self, name: griffe.ExprName) -> str:
        path = name.canonical_path
        if not path.startswith("nep."):
            return ""
        try:
            item = _target(self._package[path.removeprefix("nep.")])
        except (KeyError, griffe.AliasResolutionError):
            return ""
        value = item.value if isinstance(item, griffe.Attribute) else None
        return self._type(value) if isinstance(value, griffe.Expr) and not _is_call(value) else ""

    def _linked(self, text: str) -> str:
        # Turns public names into links.

        def link(match: re.Match[str]) -> str:
            full_name = match.group(1)
            page = self._pages.get(full_name.removeprefix("nep.").partition(".")[0])
            name = full_name.removeprefix("nep.")
            if page is None or not self._has_heading(name):
                return match.group(0)
            return f"[`{full_name}`]({page}.md#{_anchor(name)})"

        return _PAGE.sub(r"[\1](../\1)", re.sub(r"`([A-Za-z_][\w.]*)`", link, text))

    def _has_heading(self, name: str) -> bool:
        # True if the name has a heading of its own.
        owner, _, member = name.partition(".")
        if owner not in self._pages or owner[0].islower():
            return not member and owner in self._pages and "_" in owner
        item = self.find(owner)
        if not member:
            return True
        return isinstance(item, griffe.Class) and any(
            each.name == member and isinstance(each, griffe.Function) for each in self.members(item)
        )


def _target(member: griffe.Object | griffe.Alias) -> griffe.Object:
    return member.final_target if isinstance(member, griffe.Alias) else member


def _docstring_of(item: griffe.Object) -> str:
    return item.docstring.value if item.docstring else ""


def _is_in(path: str, module: str) -> bool:
    return path == module or path.startswith(f"{module}.")


def _is_call(value: griffe.Expr) -> bool:
    return isinstance(value, griffe.ExprCall)


def _anchor(heading: str) -> str:
    # Anchor as generated by GitHub.
    return re.sub(r"[^\w-]", "", heading.lower())


def _cell(text: str) -> str:
    return "`" + text.replace("|", "\\|") + "`" if text else ""


def _block(code: str) -> str:
    return f"```python\n{code}\n```"


def _default(parameter: griffe.Parameter) -> str:
    if parameter.default is None:
        return ""
    text = _value(parameter.default)
    if '"' not in text:
        text = text.replace("'", '"')
    is_internal = text.startswith(("field(", "_"))
    return "" if is_internal else text


def _value(value: str | griffe.Expr) -> str:
    # Source text of a value; constants of nep are replaced by their values.
    if isinstance(value, griffe.ExprName) and isinstance(value.parent, griffe.Object):
        try:
            item = _target(value.parent.modules_collection[value.canonical_path])
        except (KeyError, griffe.AliasResolutionError):
            return str(value)
        if isinstance(item, griffe.Attribute) and item.value is not None:
            return _value(item.value)
    return str(value)


def _parameters(function: griffe.Function, type_of: Callable[[str | griffe.Expr | None], str]) -> list[str]:
    parameters: list[str] = []
    is_by_name = False
    for parameter in function.parameters:
        if parameter.name == "self":
            continue
        if parameter.kind is griffe.ParameterKind.keyword_only and not is_by_name:
            parameters.append("*")
        is_by_name = is_by_name or parameter.kind in {
            griffe.ParameterKind.keyword_only,
            griffe.ParameterKind.var_positional,
        }
        stars = {griffe.ParameterKind.var_positional: "*", griffe.ParameterKind.var_keyword: "**"}
        text = f"{stars.get(parameter.kind, '')}{parameter.name}"
        annotation = type_of(parameter.annotation)
        text += f": {annotation}" if annotation else ""
        default = "" if parameter.kind in stars else _default(parameter)
        if default or (parameter.default is not None and parameter.kind not in stars):
            text += f" = {default or '...'}" if annotation else f"={default or '...'}"
        parameters.append(text)
    return parameters


def reference() -> Reference:
    """Load the current sources and return their reference."""
    package = griffe.load("nep", search_paths=[ROOT], allow_inspection=False, resolve_aliases=True)
    return Reference(cast("griffe.Module", package))


def pages(documentation: Reference | None = None) -> dict[str, str]:
    """Return the Markdown text of all pages by file name; by default of the current sources."""
    documentation = documentation or reference()
    return {
        "README.md": documentation.contents(),
        **{f"{each}.md": documentation.page(each) for each in PAGES},
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pages; with ``--check``, write nothing and return 1 if they are out of date."""
    parser = argparse.ArgumentParser(description="Write the reference from the docstrings.")
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit with 1 if a page is out of date"
    )
    options = parser.parse_args(arguments)
    generated = pages()
    existing = {path.name: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.md")}
    if options.check:
        return 0 if existing == generated else 1
    FOLDER.mkdir(exist_ok=True)
    for name in existing.keys() - generated.keys():
        (FOLDER / name).unlink()
    for name, page in generated.items():
        (FOLDER / name).write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
