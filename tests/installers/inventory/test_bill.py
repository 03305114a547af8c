"""Tests of the bill of materials, the licence folder and the notice, made from the current environment."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from importlib import metadata
from pathlib import Path

import pytest

from installers.inventory.__main__ import main
from installers.inventory.bill import bill, standard_texts, write_licences
from installers.inventory.parts import InventoryError, Part
from nep.version import __version__

QT = Part("qt", "6", "MIT")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Output folder of the inventory for a PyInstaller folder with one extension module."""
    frozen, out = tmp_path_factory.mktemp("frozen"), tmp_path_factory.mktemp("out")
    (module,) = (file for file in metadata.files("orjson") or () if file.suffix in {".so", ".pyd"})
    shutil.copy(str(module.locate()), frozen / module.name)
    assert main(["linux", "1700000000", str(frozen), str(out), str(out / "bill.json")]) == 0
    return out


def test_bill_of_materials_has_licences_and_a_complete_dependency_graph(written: Path) -> None:
    told = json.loads((written / "bill.json").read_text("utf-8"))
    assert told["bomFormat"] == "CycloneDX"
    assert told["metadata"]["component"]["version"] == __version__
    by_name = {each["name"]: each for each in told["components"]}
    assert by_name["pyzmq"]["purl"] == f"pkg:pypi/pyzmq@{metadata.version('pyzmq')}"
    assert by_name["qt"]["licenses"] == [{"license": {"id": "LGPL-3.0-only"}}]
    depends = {each["ref"]: set(each.get("dependsOn", ())) for each in told["dependencies"]}
    root = depends[told["metadata"]["component"]["bom-ref"]]
    assert "generic/qt@" + metadata.version("PySide6-Essentials") in root
    inside = depends[f"pypi/pynng@{metadata.version('pynng')}"]
    assert {each.rpartition("@")[0] for each in inside} == {"generic/nng", "generic/mbedtls"}
    assert not inside & root
    everything = set().union(*depends.values())
    assert everything == {each["bom-ref"] for each in told["components"]}, "nothing hangs in the air"


def test_licence_folder_contains_the_notice_and_texts_of_known_components(written: Path) -> None:
    notice = (written / "NOTICE.txt").read_text("utf-8")
    assert f"NEP Studio {__version__}" in notice
    assert f"Qt {metadata.version('PySide6-Essentials')} and" in notice
    for name, words in (
        ("cpython/LICENSE.txt", "PYTHON SOFTWARE FOUNDATION LICENSE"),
        ("nep-studio/LICENSE", "MIT"),
        ("numpy/openblas/LICENSE.txt", "OpenBLAS"),
        ("opencv-python-headless/LICENSE-3RD-PARTY.txt", "Apache License"),
        ("opencv-python-headless/libjpeg-turbo/LICENSE.txt", "Independent JPEG Group"),
        ("orjson/LICENSE-MPL-2.0", "Mozilla Public License"),
        ("pynng/mbedtls/LICENSE.txt", "Mbed TLS"),
        ("pynng/nng/LICENSE.txt", "Staysail"),
        ("pyzmq/libzmq/LICENSE.zeromq.txt", "Mozilla Public License"),
        ("qt/GPL-3.0.txt", "GNU GENERAL PUBLIC LICENSE"),
        ("qt/LGPL-3.0.txt", "GNU LESSER GENERAL PUBLIC LICENSE"),
        ("qt/chromium/LICENSE.txt", "Chromium"),
        ("rust-crates.txt", "pyo3"),
    ):
        text = (written / "licences" / name).read_text("utf-8")
        assert words in text, name
        assert len(text) > 500, name


def test_unknown_library_fails_the_build(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for each in ("parts_of", "parts_in_wheels"):
        monkeypatch.setattr(f"installers.inventory.__main__.{each}", lambda *_: ())
    (tmp_path / "libreadline.so.8").write_bytes(b"\x7fELF and so on")
    assert main(["linux", "0", str(tmp_path), str(tmp_path), str(tmp_path / "bill.json")]) == 1
    assert "'libreadline.so.8' has no known origin" in capsys.readouterr().err
    assert not (tmp_path / "bill.json").exists()


def test_bill_of_materials_is_reproducible() -> None:
    parts = [Part("a", "1", "MIT"), Part("b", "2", "Zlib", (), "generic", "a"), QT]
    assert bill(parts, "linux", 1_700_000_000, "1.0") == bill(parts, "linux", 1_700_000_000, "1.0")


def test_non_spdx_licence_is_written_as_a_name() -> None:
    told = json.loads(bill([Part("odd", "1", "My own words, and more")], "linux", 0, "1.0"))
    (component,) = told["components"]
    assert component["licenses"] == [{"license": {"name": "My own words, and more"}}]


def test_component_shared_by_two_packages_is_listed_once() -> None:
    crates = [Part("pyo3", "1", "MIT", (), "cargo", within) for within in ("a", "b")]
    told = json.loads(bill([Part("a", "1", "MIT"), Part("b", "1", "MIT"), *crates], "linux", 0, "1.0"))
    assert [each["name"] for each in told["components"]] == ["a", "b", "pyo3"]
    depends = {each["ref"]: each.get("dependsOn") for each in told["dependencies"]}
    assert depends["pypi/a@1"] == depends["pypi/b@1"] == ["cargo/pyo3@1"]


def test_purl_of_a_system_package_names_its_distributor() -> None:
    told = json.loads(bill([Part("libssl3", "3.0", "Apache-2.0", (), "deb/debian")], "linux", 0, "1.0"))
    assert told["components"][0]["purl"] == "pkg:deb/debian/libssl3@3.0"


def test_slash_in_a_package_name_is_replaced_in_its_folder_name(tmp_path: Path) -> None:
    text = tmp_path / "text"
    text.write_text("words", "utf-8")
    parts = [Part("@blockly/field-colour", "1", "MIT", [("LICENSE", text)], "npm"), QT]
    write_licences(parts, tmp_path / "out", "1.0")
    assert (tmp_path / "out" / "licences" / "blockly-field-colour" / "LICENSE").read_text("utf-8") == "words"


def test_crate_licences_are_merged_into_one_file_with_authors_and_unique_texts(tmp_path: Path) -> None:
    parts = [
        Part("one", "1", "MIT OR Apache-2.0", (), "cargo", "a", "Ana"),
        Part("one", "1", "MIT OR Apache-2.0", (), "cargo", "b", "Ana"),
        Part("two", "2", "(MIT OR Apache-2.0) AND Unicode-DFS-2016", (), "cargo", "a"),
        QT,
    ]
    write_licences(parts, tmp_path, "1.0")
    text = (tmp_path / "licences" / "rust-crates.txt").read_text("utf-8")
    assert "one 1: MIT OR Apache-2.0\n    Ana\n    in a, b\n" in text
    assert [line for line in text.splitlines() if line.startswith("----")] == [
        "---- Apache-2.0 ----",
        "---- MIT ----",
        "---- Unicode-3.0 ----",
    ]
    assert (
        text.count("Permission is hereby granted, free of charge, to any person obtaining a copy of\n") == 1
    )


@pytest.mark.parametrize(
    ("licence", "needed"),
    [
        ("MIT", ["MIT"]),
        ("Unlicense OR MIT", ["MIT"]),
        ("BSD-3-Clause", ["BSD-3-Clause"]),
        ("Apache-2.0 WITH LLVM-exception OR Apache-2.0 OR MIT", ["Apache-2.0", "Apache-2.0", "MIT"]),
    ],
)
def test_licence_expression_yields_the_stored_texts_of_its_known_alternatives(
    licence: str, needed: Sequence[str]
) -> None:
    assert standard_texts(Part("a", "1", licence, (), "cargo")) == needed


@pytest.mark.parametrize("licence", ["GPL-9.0-only", "MIT AND GPL-9.0-only", "", "My own"])
def test_crate_without_licence_text_fails_the_build(licence: str) -> None:
    with pytest.raises(InventoryError, match="the licence text of odd is missing"):
        standard_texts(Part("odd", "1", licence, (), "cargo"))
