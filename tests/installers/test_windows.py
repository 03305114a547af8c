"""Tests of the inputs of NSIS and PyInstaller for Windows, and of the zip file."""

from __future__ import annotations

import os
import shutil
import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path

import pytest

from installers.context import Context, PackageError
from installers.windows.icon import SIDES, ico
from installers.windows.nsis import REG_FILE, association_macros, entry_macros
from installers.windows.packer import make_zip, reject_wine_files, set_timestamps
from installers.windows.version import version_numbers, version_resource
from installers.windows.wine import windows_requirements
from tests.installers.small_setup import frozen_program, setup_of

LATER = 1_800_000_000


@pytest.fixture
def context(tmp_path: Path) -> Context:
    """Packer context with a frozen program of a few small files."""
    return frozen_program(tmp_path)


# ---- pinned packages on Windows -------------------------------------------------------------------


def test_pinned_packages_are_selected_by_their_markers_for_windows() -> None:
    lines = [
        "# a comment",
        "colorama==0.4.6 ; sys_platform == 'win32' \\",
        "    --hash=sha256:aa \\",
        "    --hash=sha256:bb",
        "macholib==1.16.4 ; sys_platform == 'darwin' \\",
        "    --hash=sha256:cc",
        "numpy==2.2.6 ; python_full_version < '3.11' \\",
        "    --hash=sha256:dd",
        "iceoryx2==0.10.0 ; platform_machine == 'AMD64' and sys_platform == 'win32' \\",
        "    --hash=sha256:ee",
        "rich==15.0.0 \\",
        "    --hash=sha256:ff",
    ]
    assert windows_requirements(lines) == [
        "colorama==0.4.6 --hash=sha256:aa --hash=sha256:bb",
        "iceoryx2==0.10.0 --hash=sha256:ee",
        "rich==15.0.0 --hash=sha256:ff",
    ]


def test_every_package_for_windows_has_a_hash() -> None:
    pinned = (Path(__file__).parents[2] / "requirements" / "package.txt").read_text("utf-8")
    wanted = windows_requirements(pinned.splitlines())
    assert {"pefile", "pywin32-ctypes", "pyinstaller", "pyside6"} <= {line.split("==")[0] for line in wanted}
    assert all("==" in line and "--hash=sha256:" in line for line in wanted)


# ---- version and icon -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("version", "numbers"), [("0.1.0", (0, 1, 0, 0)), ("1.2.3rc4", (1, 2, 3, 0)), ("2", (2, 0, 0, 0))]
)
def test_version_is_padded_to_four_numbers(version: str, numbers: tuple[int, ...]) -> None:
    assert version_numbers(version) == numbers


@dataclass
class Written:
    """Element of a version resource, as PyInstaller would construct it."""

    args: tuple[object, ...]
    named: dict[str, object]


def test_version_resource_is_a_valid_expression_with_version_and_product_name() -> None:
    def make(*args: object, **named: object) -> Written:
        return Written(args, named)

    names = ("VSVersionInfo", "FixedFileInfo", "StringFileInfo", "StringTable", "StringStruct", "VarFileInfo")
    written = eval(version_resource("1.2.3"), dict.fromkeys((*names, "VarStruct"), make))
    assert written.named["ffi"].named["filevers"] == (1, 2, 3, 0)
    (table,) = written.named["kids"][0].args[0]
    texts = dict(each.args for each in table.args[1])
    assert (texts["ProductName"], texts["ProductVersion"]) == ("NEP Studio", "1.2.3")


def test_ico_file_holds_each_image_at_its_offset() -> None:
    pictures = {side: b"\x89PNG" + bytes([side % 256]) * side for side in SIDES}
    made = ico(pictures)
    assert struct.unpack_from("<HHH", made) == (0, 1, len(SIDES))
    for number, side in enumerate(SIDES):
        width, height, *_rest, size, at = struct.unpack_from("<BBBBHHII", made, 6 + 16 * number)
        assert (width or 256, height or 256) == (side, side)
        assert made[at : at + size] == pictures[side]


# ---- NSIS script ----------------------------------------------------------------------------------


def test_installer_script_unpacks_every_file_into_its_folder(context: Context) -> None:
    told = entry_macros(context.frozen)
    unpacked = [line.strip() for line in told.partition("!macroend")[0].splitlines()[1:]]
    frozen = context.frozen
    assert unpacked == [
        f'File "{frozen}/nep-studio.exe"',
        f'File "{frozen}/nep.exe"',
        'SetOutPath "$NewFolder\\_internal"',
        f'File "{frozen}/_internal/a.dll"',
        f'File "{frozen}/_internal/b.dll"',
        'SetOutPath "$NewFolder\\_internal\\ñ x"',
        f'File "{frozen}/_internal/ñ x/text.txt"',
    ]
    for name in ("_internal", "nep-studio.exe", "nep.exe", "uninstall.exe"):
        assert f'!insertmacro ${{do}} "{name}"' in told


def test_file_association_is_registered_and_unregistered() -> None:
    put, take = association_macros(REG_FILE.read_text("utf-8")).split("!macro Dissociate")
    command = '"Software\\Classes\\NEPStudio.Behaviour\\shell\\open\\command" ""'
    assert f'WriteRegStr HKCU {command} "$\\"$INSTDIR\\nep-studio.exe$\\" $\\"%1$\\""' in put
    assert 'DeleteRegKey HKCU "Software\\Classes\\NEPStudio.Behaviour"\n' in take
    # Other programs may use the suffix: remove only our values, and the key only if it is empty.
    assert '${If} $0 == "NEPStudio.Behaviour"\n    DeleteRegValue HKCU "Software\\Classes\\.nepb" ""' in take
    assert 'DeleteRegKey HKCU "Software\\Classes\\.nepb"' not in take
    assert "Program Files" not in put + take


def test_setup_texts_exist_in_each_language() -> None:
    words = (REG_FILE.parent / "setup" / "words.nsh").read_text("utf-8")
    said = {
        language: {line.split()[1] for line in words.splitlines() if f"${{LANG_{language}}}" in line}
        for language in ("ENGLISH", "SPANISH", "FRENCH", "JAPANESE")
    }
    used = (REG_FILE.parent / "setup" / "nep-studio.nsi").read_text("utf-8")
    assert all(each == said["ENGLISH"] for each in said.values())
    assert all(f"$({name})" in used for name in said["ENGLISH"])


@pytest.mark.skipif(shutil.which("makensis") is None, reason="needs nsis")
def test_setup_is_reproducible(context: Context) -> None:
    set_timestamps(context.frozen, context.epoch)
    made = setup_of(context)
    assert made.name == "NEP-Studio-1.2.3-setup.exe"
    first = made.read_bytes()
    assert first.startswith(b"MZ")
    made.unlink()
    assert setup_of(context).read_bytes() == first


# ---- zip and files forbidden in a package ---------------------------------------------------------


def test_zip_is_sorted_and_reproducible(context: Context) -> None:
    made = make_zip(context)
    first = made.read_bytes()
    with zipfile.ZipFile(made) as archive:
        names = archive.namelist()
        assert names == sorted(names)
        assert "NEP Studio/_internal/ñ x/text.txt" in names
        assert {each.date_time for each in archive.infolist()} == {(2025, 6, 15, 15, 6, 40)}
    for path in context.frozen.rglob("*"):
        os.utime(path, (LATER, LATER))
    made.unlink()
    assert make_zip(context).read_bytes() == first


def test_wine_dll_is_rejected(context: Context) -> None:
    reject_wine_files(context.frozen)
    (context.frozen / "_internal" / "version.dll").write_bytes(b"MZ" + bytes(62) + b"Wine builtin DLL\0")
    with pytest.raises(PackageError, match=r"files of Wine: version\.dll"):
        reject_wine_files(context.frozen)
