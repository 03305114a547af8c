"""Helpers that build a setup program of a small frozen program with NSIS, as the real one is built."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from installers.context import Context
from installers.windows.icon import ico
from installers.windows.nsis import make_setup

FILES = ("nep.exe", "nep-studio.exe", "_internal/b.dll", "_internal/a.dll", "_internal/ñ x/text.txt")


def frozen_program(root: Path, version: str = "1.2.3", program: bytes = b"MZ") -> Context:
    """Return a packer context with a small frozen program. `program` is the content of its .exe files."""
    made = replace(Context("windows"), root=root, version=version, epoch=1_750_000_001)
    for name in FILES:
        path = made.frozen / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(program if path.suffix == ".exe" else f"{name} {version}".encode())
    (root / "LICENSE").write_text("as you like", "utf-8")
    return made


def setup_of(context: Context) -> Path:
    """Build the setup program of a context and return its path."""
    icon, picture = context.root / "small.ico", context.root / "small.bmp"
    icon.write_bytes(ico({16: _file(".png")}))
    picture.write_bytes(_file(".bmp"))
    return make_setup(context, icon, picture)


def _file(kind: str) -> bytes:
    return cv2.imencode(kind, np.zeros((16, 16, 3), np.uint8))[1].tobytes()
