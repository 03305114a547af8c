"""Tests that each shared library of a frozen program is matched to a component with a known licence."""

from __future__ import annotations

import ssl
import sysconfig
from importlib import metadata
from pathlib import Path

import pytest

from installers.inventory.libraries import LIBRARIES, compiled_files, library_of, parts_in_folder
from installers.inventory.parts import LICENCES, InventoryError, Part

ELF = b"\x7fELF"
OURS = [
    Part("cpython", "3", "PSF-2.0", (), "generic"),
    Part("libzmq", "4", "MPL-2.0", (), "generic", "pyzmq"),
    Part("qt", "6", "LGPL-3.0-only", (), "generic"),
]


def put(folder: Path, *names: str, content: bytes = ELF) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("libzmq-2f02442c.so.5.2.5", "libzmq"),
        ("libzmq.5.dylib", "libzmq"),
        ("libsodium-6c8f8377.so.26.4.0", "libsodium"),
        ("libscipy_openblas64_-32a4b2a6.so", "openblas"),
        ("libscipy_openblas64_-63c857e738469261263c764a36be9436.dll", "openblas"),
        ("libscipy_openblas64_.dylib", "openblas"),
        ("libopenblasp-r0-59ffcd50.3.15.so", "openblas"),
        ("libgfortran-040039e1-0352e75f.so.5.0.0", "gcc-runtime-library"),
        ("libgcc_s.1.1.dylib", "gcc-runtime-library"),
        ("libquadmath-96973f99-934c22de.so.0.0.0", "libquadmath"),
        ("libpng16-529cb57a.so.16.58.0", "libpng"),
        ("libavif.16.3.0.dylib", "libavif"),
        ("libaom-a0d22147.so.3.14.1", "libaom"),
        ("libvmaf.3.dylib", "libvmaf"),
        ("libicuuc.so.73", "icu"),
        ("libpyside6.abi3.so.6.11", "qt"),
        ("libshiboken6.abi3.6.11.dylib", "qt"),
        ("pyside6.abi3.dll", "qt"),
        ("libpython3.11.so.1.0", "cpython"),
        ("python313.dll", "cpython"),
        ("python3.dll", "cpython"),
        ("MSVCP140.dll", "microsoft-visual-cpp-runtime"),
        ("msvcp140-a4c2229bdc2a2a630acdc095b4d86008.dll", "microsoft-visual-cpp-runtime"),
        ("VCRUNTIME140_1.dll", "microsoft-visual-cpp-runtime"),
        ("opengl32sw.dll", "mesa"),
        ("libcrypto-3.dll", "openssl"),
        ("libssl.3.dylib", "openssl"),
        ("libssl.so.3", "openssl"),
        ("libffi-8.dll", "libffi"),
        ("sqlite3.dll", "sqlite"),
        ("libz.so.1", "zlib"),
        ("libxcb-render-util.so.0", ""),
        ("libnss3.so", ""),
    ],
)
def test_libraries_are_identified_by_file_name_on_each_system(name: str, part: str) -> None:
    library = library_of(name)
    assert library is not None
    assert library.of == part


@pytest.mark.parametrize(
    "name",
    [
        "libreadline.so.8",
        "libgdbm.so.6",
        "libx264.164.dylib",
        "libavcodec.so.62",
        "zmq.py",
        "libpng16",
        "x.dll",
    ],
)
def test_unknown_file_names_match_no_library(name: str) -> None:
    assert library_of(name) is None


def test_library_table_has_existing_licence_texts_and_only_openblas_is_repeated() -> None:
    for library in LIBRARIES:
        assert library.licence
        assert all((LICENCES / f"{each}.txt").is_file() for each in library.texts), library.files
    names = [library.of for library in LIBRARIES if library.of]
    assert {each for each in names if names.count(each) > 1} == {"openblas"}


def test_compiled_files_are_detected_by_magic_bytes(tmp_path: Path) -> None:
    for name, content in (
        ("a", ELF),
        ("b.dll", b"MZ"),
        ("c", b"\xca\xfe\xba\xbe"),
        ("d.so", b""),
        ("e", b"#!"),
    ):
        put(tmp_path, name, content=content)
    assert [path.name for path in compiled_files(tmp_path)] == ["a", "b.dll", "c"]


def test_programs_modules_and_listed_libraries_need_no_extra_part(tmp_path: Path) -> None:
    (orjson,) = (file.name for file in metadata.files("orjson") or () if file.suffix in {".so", ".pyd"})
    dynload = Path(sysconfig.get_path("stdlib")) / "lib-dynload"
    of_python = [next(dynload.glob("_json*.so")).name] if dynload.is_dir() else []
    put(
        tmp_path,
        "nep",
        "nep-studio.exe",
        orjson,
        "libpython3.11.so.1.0",
        "pyzmq.libs/libzmq-2f.so.5",
        *of_python,
    )
    assert list(parts_in_folder(tmp_path, [*OURS, Part("orjson", "1", "MIT")])) == []


def test_module_of_an_unlisted_wheel_is_reported(tmp_path: Path) -> None:
    (orjson,) = (file.name for file in metadata.files("orjson") or () if file.suffix in {".so", ".pyd"})
    with pytest.raises(InventoryError, match="orjson"):
        list(parts_in_folder(put(tmp_path, orjson), OURS))


def test_all_unknown_libraries_are_reported_at_once(tmp_path: Path) -> None:
    put(tmp_path, "_internal/libreadline.so.8", "numpy.libs/libnew-12ab.so.1", "app.libs/libzmq.so.5")
    with pytest.raises(InventoryError) as raised:
        list(parts_in_folder(tmp_path, [*OURS, Part("numpy", "2", "BSD-3-Clause")]))
    lines = str(raised.value).splitlines()
    assert len(lines) == 2
    assert all("add it to LIBRARIES" in line for line in lines)


def test_ffmpeg_stubs_are_accepted_and_real_ffmpeg_is_rejected(tmp_path: Path) -> None:
    name = "libavcodec-57aca189.so.62.28.102"
    assert list(parts_in_folder(put(tmp_path, name), OURS)) == []
    put(tmp_path, name, content=ELF + bytes(200_000))
    with pytest.raises(InventoryError, match="libavcodec"):
        list(parts_in_folder(tmp_path, OURS))


def test_libraries_bundled_in_wheels_become_separate_parts(tmp_path: Path) -> None:
    put(tmp_path, "libaom-a0d22147.so.3.14.1", "libicuuc.so.73", "libicui18n.so.73", "opengl32sw.dll")
    parts = {each.name: each for each in parts_in_folder(tmp_path, OURS)}
    assert {name: each.version for name, each in parts.items()} == {
        "icu": "73",
        "libaom": "3.14.1",
        "mesa": "",
    }
    assert "Alliance for Open Media Patent License" in parts["libaom"].texts[0][1]


@pytest.mark.skipif(
    not Path("/var/lib/dpkg/info/zlib1g:amd64.list").is_file(), reason="needs Debian's zlib1g"
)
def test_system_library_is_attributed_to_its_package_with_its_licence_text(tmp_path: Path) -> None:
    (part,) = parts_in_folder(put(tmp_path, "libz.so.1"), OURS)
    assert (part.name, part.licence) == ("zlib1g", "Zlib")
    assert part.version
    assert part.kind.startswith("deb/")
    ((_name, text),) = part.texts
    assert isinstance(text, Path)
    assert "zlib" in text.read_text("utf-8")


def test_system_library_without_package_fails_the_build_except_pythons_openssl(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))  # no dpkg-query
    with pytest.raises(InventoryError, match=r"'libnss3\.so' belongs to no package"):
        list(parts_in_folder(put(tmp_path / "in", "libnss3.so"), OURS))
    (tmp_path / "in" / "libnss3.so").unlink()
    (part,) = parts_in_folder(put(tmp_path / "in", "libssl.3.dylib"), OURS)
    assert part.name == "openssl"
    assert part.version in ssl.OPENSSL_VERSION
