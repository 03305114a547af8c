"""Tests of the detection of Mach-O files by their first bytes."""

from __future__ import annotations

from pathlib import Path

import pytest

from installers.macos.mach_o import Slice, read
from tests.installers.macos.made_up_app import PROGRAM, fat, header, put

SYSTEM = ("/usr/lib/libSystem.B.dylib",)


def test_thin_executable_is_recognised(tmp_path: Path) -> None:
    path = put(tmp_path / "a", header(PROGRAM, "arm64", (13, 4), ["@rpath/libzmq.5.dylib"]))
    assert read(path) == (Slice("arm64", True, (13, 4), (*SYSTEM, "@rpath/libzmq.5.dylib")),)


def test_universal_library_is_recognised(tmp_path: Path) -> None:
    path = put(tmp_path / "a", fat(header(macos=(15, 0)), header(machine="x86_64")))
    assert read(path) == (Slice("arm64", False, (15, 0), SYSTEM), Slice("x86_64", False, (13, 0), SYSTEM))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xca\xfe",
        b"#!/bin/sh\nexit 0\n",
        b"\x7fELF" + bytes(60),
        b"MZ" + bytes(60),
        b"\xca\xfe\xba\xbe\x00\x00\x00\x41" + bytes(400),  # Java 21 class file, same magic number
        header()[:20],
        header()[:40],
        fat(header())[:4100],
    ],
)
def test_non_mach_o_and_truncated_files_are_not_recognised(tmp_path: Path, content: bytes) -> None:
    assert read(put(tmp_path / "a", content)) == ()


def test_missing_file_raises(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "a")
