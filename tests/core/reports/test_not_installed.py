"""Tests that missing system libraries of Qt are named with the packages that contain them."""

from __future__ import annotations

import importlib.util
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.core.reports.not_installed import PACKAGES_BY_LIBRARY, MissingLibraries, missing_libraries

BROUGHT = ("libQt6", "libicu", "ld-linux")
C_RUNTIME = {
    "libc.so.6",
    "libm.so.6",
    "libgcc_s.so.1",
    "libstdc++.so.6",
    "libdl.so.2",
    "libpthread.so.0",
    "librt.so.1",
}
PT_LOAD, PT_DYNAMIC, DT_NEEDED, DT_STRTAB = 1, 2, 1, 5


def lacking(*names: str, also: str = ""):
    def load(name: str) -> None:
        if name in names:
            raise OSError(f"{also or name}: cannot open shared object file: No such file or directory")

    return load


def found(*names: str, release=dict, also: str = "") -> MissingLibraries | None:
    error = ImportError(f"{also or names[0]}: cannot open shared object file: No such file or directory")
    return missing_libraries(error, lacking(*names, also=also), release)


def test_import_error_of_a_missing_name_is_not_a_missing_library() -> None:
    assert missing_libraries(ImportError("cannot import name 'x'"), lacking("libnss3.so"), dict) is None


def test_every_missing_library_is_named_with_one_install_command() -> None:
    made = found("libnss3.so", "libsmime3.so", "libXtst.so.6")
    assert made is not None
    assert made.names[0] == "libnss3.so"
    assert set(made.names) == {"libnss3.so", "libsmime3.so", "libXtst.so.6"}
    assert made.command == "sudo apt install libnss3 libxtst6"
    assert made.command in made.remedy
    assert "libsmime3.so" in made.title


def test_missing_dependency_of_a_library_is_named() -> None:
    made = found("libnss3.so", also="libnspr4.so")
    assert made == MissingLibraries(("libnspr4.so",), ("libnspr4",))
    unknown = found("libnss3.so", also="libodd.so.1")
    assert unknown == MissingLibraries(("libodd.so.1",), ())
    assert unknown.command == ""


@pytest.mark.parametrize(
    ("release", "package"),
    [
        ({"ID": "ubuntu", "VERSION_ID": "24.04"}, "libasound2t64"),
        ({"ID": "ubuntu", "VERSION_ID": "22.04"}, "libasound2"),
        ({"ID": "debian", "VERSION_ID": "13"}, "libasound2t64"),
        ({"ID": "debian", "VERSION_ID": "12"}, "libasound2"),
        ({"ID": "fedora", "VERSION_ID": "43"}, "libasound2"),
    ],
)
def test_package_names_match_the_distribution_release(release: dict[str, str], package: str) -> None:
    made = found("libasound.so.2", release=lambda: release)
    assert made is not None
    assert made.packages == (package,)


def needed(path: Path) -> Iterator[str]:
    """Yield the names of the libraries that a 64-bit ELF file needs."""
    with path.open("rb") as file:
        header = file.read(64)
        offset, size, count = (
            struct.unpack_from("<Q", header, 32)[0],
            *struct.unpack_from("<HH", header, 54),
        )
        file.seek(offset)
        table = file.read(size * count)
        segments = [struct.unpack_from("<IIQQQQ", table, size * each) for each in range(count)]
        _kind, _flags, start, _address, _physical, length = next(
            each for each in segments if each[0] == PT_DYNAMIC
        )
        file.seek(start)
        entries = list(struct.iter_unpack("<QQ", file.read(length)))
        strings = next(value for tag, value in entries if tag == DT_STRTAB)
        place = next(
            strings - each[3] + each[2]
            for each in segments
            if each[0] == PT_LOAD and each[3] <= strings < each[3] + each[5]
        )
        for tag, value in entries:
            if tag == DT_NEEDED:
                file.seek(place + value)
                yield file.read(256).split(b"\0")[0].decode()


def test_system_libraries_required_by_qt_are_known() -> None:
    spec = importlib.util.find_spec("PySide6")
    assert spec is not None
    assert spec.origin is not None
    libraries = Path(spec.origin).parent / "Qt" / "lib"
    if not (libraries / "libQt6WebEngineCore.so.6").exists():
        pytest.skip("only wheels for Linux leave libraries to the system")
    files = [libraries / f"libQt6{name}.so.6" for name in ("WebEngineCore", "Gui", "Widgets", "Quick")]
    wanted = {name for file in files for name in needed(file)}
    of_system = {name for name in wanted if not name.startswith(BROUGHT)} - C_RUNTIME
    assert "libnss3.so" in of_system
    assert of_system <= set(PACKAGES_BY_LIBRARY)
