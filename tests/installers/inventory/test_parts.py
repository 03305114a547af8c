"""Tests of the inventory of Python, Qt and the block editor, each part with its licence."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest

from installers.inventory.parts import (
    LICENCES,
    Part,
    _texts_of_python,
    editor_parts,
    other_parts,
    own_text,
    parts_of,
)

RESOURCES = Path(__file__).parents[3] / "resources"
WITHOUT_TEXT = {"pyside6", "pyside6-addons", "pyside6-essentials", "shiboken6"}
"""Distributions without a licence text of their own; Qt's text is in the folder `qt`."""


@pytest.fixture(scope="module")
def parts() -> list[Part]:
    return list(parts_of())


def test_bundled_distributions_are_listed_once_with_their_version_and_licence(parts: list[Part]) -> None:
    names = [each.name for each in parts]
    assert len(names) == len(set(names))
    assert {"nep-studio", "pyzmq", "pyside6-essentials", "numpy", "pynng", "cffi", "jsonschema"} <= set(names)
    assert not {"pytest", "mypy", "eclipse-zenoh", "cyclonedds"} & set(names), "they are not in a package"
    assert [each.name for each in parts if not each.licence] == []
    assert [each.version for each in parts] == [metadata.version(each.name) for each in parts]


def test_every_part_outside_the_exception_list_has_its_licence_text(parts: list[Part]) -> None:
    assert {each.name for each in (*parts, *other_parts(RESOURCES)) if not each.texts} <= WITHOUT_TEXT


def test_licence_file_name_with_trailing_version_is_recognised(parts: list[Part]) -> None:
    (orjson,) = (each for each in parts if each.name == "orjson")
    assert "LICENSE-MPL-2.0" in {name for name, _text in orjson.texts}


def test_python_licence_falls_back_to_the_bundled_text(tmp_path: Path) -> None:
    assert _texts_of_python(tmp_path) == [("LICENSE.txt", LICENCES / "PSF-2.0.txt")]
    (tmp_path / "LICENSE.txt").write_text("that of Python for Windows", "utf-8")
    assert _texts_of_python(tmp_path) == [("LICENSE.txt", tmp_path / "LICENSE.txt")]


def test_generated_licence_text_has_the_copyright_holder_and_the_licences() -> None:
    ((name, text),) = own_text("Copyright Ana", "MIT", "Zlib")
    assert name == "LICENSE.txt"
    assert isinstance(text, str)
    assert text.startswith("Copyright Ana\n\nPermission is hereby granted")
    assert text.endswith("source distribution.\n")
    with pytest.raises(OSError, match="WTFPL"):
        own_text("Copyright Ana", "WTFPL")


def test_editor_parts_are_read_from_the_legal_file_of_the_bundler() -> None:
    parts = {each.name: each for each in editor_parts(RESOURCES / "blockly" / "LEGAL.txt")}
    assert parts["blockly"].version.startswith("13.")
    assert parts["blockly"].licence == "Apache-2.0"
