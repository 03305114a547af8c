"""Reader for Mach-O files: processors, minimum macOS and linked libraries."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

__all__ = ["Slice", "read"]

_THIN = {0xFEEDFACF: ">", 0xCFFAEDFE: "<", 0xFEEDFACE: ">", 0xCEFAEDFE: "<"}
_WIDE = {0xFEEDFACF, 0xCFFAEDFE}
_FAT, _FAT_64 = 0xCAFEBABE, 0xCAFEBABF
_MAX_SLICES = 8
"""Maximum number of slices in a fat file.

Java class files have the same magic number, followed by their version, which is 45 or more.
"""
_MACHINES = {0x01000007: "x86_64", 0x0100000C: "arm64"}
_PROGRAM = 2
_VERSION_MIN_MACOS, _BUILD_VERSION = 0x24, 0x32
_LOAD, _REEXPORT = 0xC, 0x8000001F


@dataclass(frozen=True)
class Slice:
    """Part of a Mach-O file with the code for one processor."""

    machine: str
    """Processor: "arm64", "x86_64", or the hexadecimal number of another type."""
    is_program: bool
    """True for an executable, False for a library or plug-in."""
    oldest_macos: tuple[int, int] | None
    """Minimum macOS version, or None if unspecified."""
    needs: tuple[str, ...] = ()
    """Linked libraries by install name, such as "@rpath/libzmq.5.dylib"."""


def read(path: Path) -> tuple[Slice, ...]:
    """Return the slices of a file; empty if it isn't Mach-O or is truncated.

    Raises OSError if the file can't be read.
    """
    with path.open("rb") as file:
        try:
            return tuple(_slices(file))
        except struct.error:  # truncated header
            return ()


def _slices(file: BinaryIO) -> Iterator[Slice]:
    (magic,) = struct.unpack(">I", file.read(4))
    if magic in _THIN:
        yield _slice(file, 0)
    elif magic in {_FAT, _FAT_64}:
        (count,) = struct.unpack(">I", file.read(4))
        layout, size = (">5I", 20) if magic == _FAT else (">2I2Q2I", 32)
        if count <= _MAX_SLICES:
            entries = [struct.unpack(layout, file.read(size)) for _each in range(count)]
            for entry in entries:
                yield _slice(file, entry[2])


def _slice(file: BinaryIO, start: int) -> Slice:
    file.seek(start)
    (magic,) = struct.unpack(">I", file.read(4))
    order = _THIN.get(magic)
    if order is None:
        raise struct.error("no Mach-O data at the offset in the fat header")
    cpu, _sub, kind, count, _size, _flags = struct.unpack(f"{order}6I", file.read(24))
    if magic in _WIDE:
        file.read(4)
    oldest, needs = None, []
    for _each in range(count):
        command, size = struct.unpack(f"{order}2I", file.read(8))
        body = file.read(max(size - 8, 0))
        if command in {_VERSION_MIN_MACOS, _BUILD_VERSION}:
            offset = 0 if command == _VERSION_MIN_MACOS else 4
            (packed,) = struct.unpack_from(f"{order}I", body, offset)
            oldest = (packed >> 16, packed >> 8 & 0xFF)
        elif command in {_LOAD, _REEXPORT}:
            (offset,) = struct.unpack_from(f"{order}I", body)
            needs.append(body[offset - 8 :].split(b"\0")[0].decode("utf-8", "replace"))
    return Slice(_MACHINES.get(cpu, hex(cpu)), kind == _PROGRAM, oldest, tuple(needs))
