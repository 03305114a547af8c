"""SVG images of the style sheet, as files of Qt's resource system.

A style sheet can only show images from files. These files exist only in memory.
"""

from __future__ import annotations

import struct
from functools import cache

from PySide6.QtCore import QResource

FOLDER = "/studio"
DIRECTORY = 2  # flag of Qt's resource format

_registered: list[bytes] = []  # Qt doesn't copy the data


@cache
def image_url(svg: str) -> str:
    """Return the URL of an image for the style sheet."""
    name = f"{len(_registered)}.svg"
    _register(name, svg.encode())
    return f":{FOLDER}/{name}"


def _register(name: str, content: bytes) -> None:
    # Version 1 of the format of `rcc`, with one file: header, tree (folder and file), name, data.
    name_hash = 0
    for letter in name:
        name_hash = (name_hash << 4) + ord(letter)
        name_hash = (name_hash ^ ((name_hash & 0xF0000000) >> 23)) & 0x0FFFFFFF
    tree = struct.pack(">IHII", 0, DIRECTORY, 1, 1) + struct.pack(">IHHHI", 0, 0, 0, 1, 0)
    data = struct.pack(">I", len(content)) + content
    names = struct.pack(">HI", len(name), name_hash) + name.encode("utf-16-be")
    header_size = 20
    offsets = (header_size, header_size + len(tree), header_size + len(tree) + len(data))
    resource = struct.pack(">4sIIII", b"qres", 1, *offsets) + tree + data + names
    _registered.append(resource)
    if not QResource.registerResourceData(resource, FOLDER):
        raise RuntimeError(f"Qt rejects the image {name}")
