"""The bill of materials, the licences and the notice of what is in this very environment."""

from __future__ import annotations

import json
from importlib import metadata
from pathlib import Path

from installers import inventory
from installers.inventory import bill, editor_parts, main, others, parts_of, write_licences
from nep.version import __version__

RESOURCES = Path(__file__).parents[2] / "resources"
WITHOUT_TEXT = {
    "cpython",
    "iceoryx2",
    "pyinstaller",
    "pyside6",
    "pyside6-addons",
    "pyside6-essentials",
    "shiboken6",
}
"""Qt's text is under `qt`; the others' wheels have none, or this Python came without one."""


def test_every_distribution_inside_is_told_once_with_its_licence() -> None:
    parts = list(parts_of())
    names = [each.name for each in parts]
    assert len(names) == len(set(names))
    assert {"nep-studio", "pyzmq", "pyside6-essentials", "numpy", "pynng", "cffi", "jsonschema"} <= set(names)
    assert not {"pytest", "mypy", "eclipse-zenoh", "cyclonedds"} & set(names), "they are not in a package"
    assert [each.name for each in parts if not each.licence] == []
    assert [each.version for each in parts] == [metadata.version(each.name) for each in parts]


def test_all_have_their_licence_text() -> None:
    parts = [*parts_of(), *others(RESOURCES)]
    assert {each.name for each in parts if not each.texts} <= WITHOUT_TEXT
    assert "qt" not in {each.name for each in parts if not each.texts}


def test_the_editors_parts_are_read_from_what_its_bundler_wrote() -> None:
    parts = {each.name: each for each in editor_parts(RESOURCES / "blockly" / "LEGAL.txt")}
    assert parts["blockly"].version.startswith("13.")
    assert parts["blockly"].licence == "Apache-2.0"


def test_the_same_parts_give_the_same_bill(tmp_path: Path) -> None:
    texts = []
    for each in ("a", "b"):
        folder = tmp_path / each
        folder.mkdir()
        assert main(["linux", "1700000000", str(folder), str(folder / "bill.json")]) == 0
        texts.append((folder / "bill.json").read_text("utf-8"))
    assert texts[0] == texts[1]
    told = json.loads(texts[0])
    assert told["bomFormat"] == "CycloneDX"
    assert told["metadata"]["component"]["version"] == __version__
    by_name = {each["name"]: each for each in told["components"]}
    assert by_name["pyzmq"]["purl"] == f"pkg:pypi/pyzmq@{metadata.version('pyzmq')}"
    assert by_name["qt"]["licenses"] == [{"license": {"id": "LGPL-3.0-only"}}]
    (root,) = (each for each in told["dependencies"] if len(each.get("dependsOn", ())) > 1)
    assert len(root["dependsOn"]) == len(told["components"])
    notice = (tmp_path / "a" / "NOTICE.txt").read_text("utf-8")
    assert f"NEP Studio {__version__}" in notice
    assert f"Qt {metadata.version('PySide6-Essentials')} and" in notice
    for name in (
        "qt/LGPL-3.0.txt",
        "qt/GPL-3.0.txt",
        "nep-studio/LICENSE",
        "opencv-python-headless/LICENSE.txt",
    ):
        assert (tmp_path / "a" / "licences" / name).stat().st_size > 500, name


def test_a_licence_in_words_is_a_name() -> None:
    odd = inventory.Part("odd", "1", "My own words, and more")
    told = json.loads(bill([odd], "linux", 0, "1.0"))
    (component,) = told["components"]
    assert component["licenses"] == [{"license": {"name": "My own words, and more"}}]


def test_a_name_with_a_slash_stays_in_its_folder(tmp_path: Path) -> None:
    text = tmp_path / "text"
    text.write_text("words", "utf-8")
    parts = [
        inventory.Part("@blockly/field-colour", "1", "MIT", [("LICENSE", text)], "npm"),
        inventory.Part("qt", "6", "MIT"),
    ]
    write_licences(parts, tmp_path / "out", "1.0")
    assert (tmp_path / "out" / "licences" / "blockly-field-colour" / "LICENSE").read_text("utf-8") == "words"
