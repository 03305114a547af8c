"""Tests of the detection of components that are compiled into wheels, and of the report of unknown ones."""

from __future__ import annotations

import functools
import re
from importlib import metadata
from pathlib import Path

import pytest

from installers.inventory import wheels
from installers.inventory.parts import InventoryError, Part
from installers.inventory.wheels import parts_in_wheels, parts_of_build, parts_of_crates, version_in

THEIRS = (("LICENSE-3RD-PARTY.txt", "words"),)
BUILD = """General configuration for OpenCV 4.14.0
    Extra dependencies:          avif /usr/local/lib/libpng.so dl m
    3rdparty dependencies:       libprotobuf libtiff ippiw ippicv ipphal zlib tegra_hal
    ZLib:                        build (ver 1.3.2)
    AVIF:                        avif (ver 1.4.2)
    PNG:                         /usr/local/lib/libpng.so (ver 1.6.58)
    TIFF:                        build (ver 42 - 4.7.1)
    Intel IPP:                   2026.0.0 [2026.0.0]
    Custom HAL:                  YES (carotene (ver 0.0.1))
    Protobuf:                    build (3.19.1)
    Flatbuffers:                 builtin/3rdparty (25.9.23)
"""


@functools.cache
def parts_of_wheel(name: str) -> dict[str, Part]:
    part = Part(name, metadata.version(name), "MIT")
    return {each.name: each for each in parts_in_wheels([part])}


@pytest.mark.parametrize(
    ("wheel", "inside"),
    [
        ("pynng", {"nng", "mbedtls"}),
        ("pyzmq", {"libzmq", "libsodium"}),
        ("numpy", {"openblas", "lapack", "gcc-runtime-library"}),
        ("opencv-python-headless", {"libjpeg-turbo", "libpng", "libwebp", "openjpeg", "protobuf"}),
        ("iceoryx2", {"pyo3", "serde_core"}),
        ("orjson", {"pyo3-ffi"}),
        ("pyside6-addons", {"chromium"}),
    ],
)
def test_components_compiled_into_a_wheel_are_listed_with_their_licence(wheel: str, inside: set[str]) -> None:
    told = parts_of_wheel(wheel)
    assert inside <= told.keys()
    assert all(each.licence for each in told.values())
    assert {each.within for each in told.values()} == {"qt" if wheel == "pyside6-addons" else wheel}
    assert [each.name for each in told.values() if each.kind != "cargo" and not each.texts] == []


@pytest.mark.parametrize(
    ("wheel", "name"), [("pynng", "nng"), ("pynng", "mbedtls"), ("pyzmq", "libzmq"), ("numpy", "openblas")]
)
def test_components_compiled_into_a_wheel_have_a_version_number(wheel: str, name: str) -> None:
    assert re.fullmatch(r"\d+\.\d+(\.\d+)+", parts_of_wheel(wheel)[name].version)


def test_chromium_inside_qt_has_its_version() -> None:
    assert re.fullmatch(r"\d+\.0\.\d+\.\d+", parts_of_wheel("pyside6-addons")["chromium"].version)


@pytest.mark.parametrize("folder", ["", "licenses/", "licenses/licenses/"])
def test_licence_text_is_found_in_old_and_new_wheels_and_the_topmost_wins(
    folder: str, tmp_path: Path
) -> None:
    info = tmp_path / "made_up-1.dist-info"
    names = [
        f"{info.name}/{folder}LICENSE.txt",
        f"{info.name}/{folder}deeper/LICENSE.txt",
        "other/LICENSE.txt",
    ]
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("words", "utf-8")
    (info / "METADATA").write_text("Name: made-up\nVersion: 1\n", "utf-8")
    (info / "RECORD").write_text("".join(f"{name},,\n" for name in reversed(names)), "utf-8")
    found = metadata.Distribution.at(info)
    assert wheels._licence_text(found, "LICENSE.txt") == (("LICENSE.txt", tmp_path / names[0]),)
    with pytest.raises(InventoryError, match="made-up no longer contains 'COPYING'"):
        wheels._licence_text(found, "COPYING")


def test_system_package_is_not_treated_as_a_wheel() -> None:
    assert list(parts_in_wheels([Part("libssl3", "3", "Apache-2.0", (), "deb/debian")])) == []


def test_opencv_build_information_is_parsed() -> None:
    told = {each.name: each for each in parts_of_build(BUILD, THEIRS)}
    assert {name: each.version for name, each in told.items()} == {
        "carotene": "0.0.1",
        "flatbuffers": "25.9.23",
        "ipp-icv": "2026.0.0",
        "libavif": "1.4.2",
        "libpng": "1.6.58",
        "libtiff": "4.7.1",
        "protobuf": "3.19.1",
        "zlib": "1.3.2",
    }
    assert told["zlib"].texts == THEIRS
    assert "Sam Leffler" in told["libtiff"].texts[0][1]


def test_unknown_component_of_opencv_is_reported() -> None:
    with pytest.raises(InventoryError, match="OpenCV contains 'libnew'"):
        list(parts_of_build("3rdparty dependencies: libnew", THEIRS))


def test_build_only_crates_are_excluded() -> None:
    expression = {"expression": "MIT"}
    made = {
        "components": [
            {"name": "a", "version": "1", "purl": "pkg:cargo/a@1", "licenses": [expression], "author": "Ana"},
            {
                "name": "cc",
                "version": "1",
                "purl": "pkg:cargo/cc@1",
                "licenses": [expression],
                "scope": "excluded",
            },
            {"name": "b", "version": "2", "purl": "pkg:cargo/b@2", "licenses": [{"license": {"id": "Zlib"}}]},
            {"name": "libdrm", "version": "2", "purl": "pkg:rpm/almalinux/libdrm@2"},
        ]
    }
    assert list(parts_of_crates(made, "wheel")) == [
        Part("a", "1", "MIT", (), "cargo", "wheel", "Ana"),
        Part("b", "2", "Zlib", (), "cargo", "wheel"),
    ]
    assert list(parts_of_crates({}, "wheel")) == []


def test_crate_without_a_licence_is_reported() -> None:
    made = {"components": [{"name": "odd", "version": "1", "purl": "pkg:cargo/odd@1"}]}
    with pytest.raises(InventoryError, match="the crate 'odd' in wheel has no licence"):
        list(parts_of_crates(made, "wheel"))


def test_unknown_crate_of_iceoryx2_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wheels, "CRATES", {})
    with pytest.raises(InventoryError, match="iceoryx2 contains the crate 'arc-swap'"):
        parts_of_wheel.__wrapped__("iceoryx2")


def test_version_is_extracted_from_a_binary_file(tmp_path: Path) -> None:
    path = tmp_path / "library"
    path.write_bytes(b"")
    assert version_in(path, rb"v(\d+)") == ""
    path.write_bytes(b"\0" * 5000 + b"v12\0v13")
    assert version_in(path, rb"v(\d+)") == "12"
    assert version_in(path, rb"w(\d+)") == ""
