"""Tests of the reference pages generated from docstrings: complete, current, without internal names."""

from __future__ import annotations

import re

import griffe
import pytest

import nep
from tools import reference

pytestmark = pytest.mark.usefixtures("syntax_trees")
INTERNAL = re.compile(
    r"\bnep\.(nodes|backends|system|patterns|protocol|masters|messages|programs|cli)\b|\b_[a-z]\w+|ParameterHost"
)
"""Pattern of internal packages and names that must not be in the reference."""


@pytest.fixture(scope="module")
def book() -> reference.Reference:
    return reference.reference()


@pytest.fixture(scope="module")
def pages(book: reference.Reference) -> dict[str, str]:
    return reference.pages(book)


def test_reference_pages_are_up_to_date(pages: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reference, "pages", lambda: pages)
    assert reference.main(["--check"]) == 0, "docstrings have changed: python3 dev.py reference"


def test_every_public_name_is_in_the_reference(book: reference.Reference) -> None:
    names = {each for each in nep.__all__ if not each.startswith("_")} - book.spellings.keys()
    types = {*nep.geometry.__all__, *nep.sensor.__all__}
    assert book.names == names | types
    assert book.spellings == {
        "node": "Node",
        "master": "Master",
        "server": "FixedServer",
        "client": "FixedClient",
    }


def test_every_public_name_has_a_docstring(book: reference.Reference) -> None:
    silent = []
    for name in sorted(book.names):
        found = book.find(name)
        silent += [] if found.docstring else [name]
        if isinstance(found, griffe.Class):
            silent += [
                f"{name}.{each.name}"
                for each in book.members(found)
                if isinstance(each, griffe.Function) or "property" in each.labels
                if not each.docstring
            ]
    assert silent == []


def test_internal_names_are_absent_from_the_reference(pages: dict[str, str]) -> None:
    found = [
        f"{name}: {line}"
        for name, page in pages.items()
        for line in page.splitlines()
        if INTERNAL.search(line.replace("raw_image", ""))
    ]
    assert found == []


def test_members_listed_as_internal_exist(book: reference.Reference) -> None:
    for each in reference.INTERNAL:
        owner, _, member = each.partition(".")
        found = book.find(owner)
        assert isinstance(found, griffe.Class)
        inherited = {name for base in (found, *found.mro()) for name in base.members}
        init = found.members.get("__init__")
        assert member in inherited, f"{each} is gone: {init}"


def test_reference_lines_fit_the_width_and_links_resolve(pages: dict[str, str]) -> None:
    headings = {
        name: {
            re.sub(r"[^\w-]", "", line.lstrip("# ").lower())
            for line in page.splitlines()
            if line.startswith("#")
        }
        for name, page in pages.items()
    }
    for name, page in pages.items():
        for line in page.splitlines():
            assert len(line) <= reference.WIDTH or line.startswith(("|", "[")), f"{name}: {line}"
            for file, anchor in re.findall(r"\]\((\w+\.md)#(\w+)\)", line):
                assert anchor in headings[file], f"{name}: {line}"


DOCSTRING = """A thing of so many.

`count`: how many there are. It is not said of `other`. `size` is in metres. Raises `NepError` when it fails,
and `ValueError`.

Second, with 0.5.4 in it.

    thing(1)
    thing(2)
"""


def test_docstring_is_split_into_paragraphs_arguments_and_errors() -> None:
    words = reference.parse_docstring(DOCSTRING, ["count", "size"])
    assert words.names == {"count": "how many there are.", "size": "`size` is in metres."}
    assert words.raises == ("`NepError` when it fails, and `ValueError`.",)
    assert words.paragraphs == (
        "A thing of so many.",
        "It is not said of `other`.",
        "Second, with 0.5.4 in it.",
        "    thing(1)\n    thing(2)",
    )


def test_two_column_list_is_parsed() -> None:
    words = reference.parse_docstring("A thing.\n\n`a`   one\n`long`  two\n       and three\n`b` four", [])
    assert words.names == {"a": "one", "long": "two and three", "b": "four"}
    assert words.paragraphs == ("A thing.",)


def test_first_sentence_is_not_parsed_as_an_argument() -> None:
    words = reference.parse_docstring("`name` is no name. `name`: the name.", ["name"])
    assert words.paragraphs == ("`name` is no name.",)
    assert words.names == {"name": "the name."}
