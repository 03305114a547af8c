"""Tests of the icons and of the background of the disk image's window."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image
from PIL.IcnsImagePlugin import IcnsFile

from installers.context import ROOT
from installers.macos.disk_image import APP_AT, APPLICATIONS_AT, WINDOW

SIDES = {"ic04": 16, "ic05": 32, "ic07": 128, "ic08": 256, "ic09": 512}
RETINA = {"ic11": 32, "ic12": 64, "ic13": 256, "ic14": 512, "ic10": 1024}


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    subprocess.run(
        [sys.executable, "-m", "installers.macos.pictures", folder],
        cwd=ROOT,
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen"},
        check=True,
    )
    return folder


def entries(icon: bytes) -> Iterator[tuple[str, bytes]]:
    assert icon[:4] == b"icns"
    (size,) = struct.unpack_from(">I", icon, 4)
    assert size == len(icon)
    place = 8
    while place < len(icon):
        (length,) = struct.unpack_from(">I", icon, place + 4)
        yield icon[place : place + 4].decode(), icon[place + 8 : place + length]
        place += length


def raw(content: bytes) -> bytes:
    """Decompress the channels of an icon entry that is not a PNG."""
    assert content[:4] == b"ARGB"
    place, out = 4, bytearray()
    while place < len(content):
        count = content[place]
        if count < 128:
            out += content[place + 1 : place + 2 + count]
            place += count + 2
        else:
            out += content[place + 1 : place + 2] * (count - 125)
            place += 2
    return bytes(out)


@pytest.mark.parametrize("name", ["nep-studio.icns", "behaviour.icns"])
def test_icon_has_all_sizes_including_retina(pictures: Path, name: str) -> None:
    found = dict(entries((pictures / name).read_bytes()))
    assert found.keys() == SIDES.keys() | RETINA.keys()
    for kind, side in (SIDES | RETINA).items():
        if kind in {"ic04", "ic05"}:
            channels = raw(found[kind])
            assert len(channels) == 4 * side * side
            opaque, rest = channels[: side * side], channels[side * side :]
            assert opaque[0] == 0  # the corner is transparent
            assert max(opaque) == 255
            assert len(set(rest)) > 10
            continue
        image = Image.open(BytesIO(found[kind]))
        assert (image.format, image.size) == ("PNG", (side, side))
        assert image.convert("RGBA").getpixel((0, 0))[3] == 0


@pytest.mark.parametrize("name", ["nep-studio.icns", "behaviour.icns"])
def test_icon_is_readable_by_pillow(pictures: Path, name: str) -> None:
    with (pictures / name).open("rb") as file:
        largest = IcnsFile(file).getimage((512, 512, 2))
    assert largest.size == (1024, 1024)


def test_application_and_document_icons_differ(pictures: Path) -> None:
    assert (pictures / "nep-studio.icns").read_bytes() != (pictures / "behaviour.icns").read_bytes()


def test_background_is_light_with_an_arrow_from_application_to_applications_folder(pictures: Path) -> None:
    with Image.open(pictures / "background.png") as file:
        ground = file.convert("L")
    assert ground.size == WINDOW
    assert ground.getpixel((2, 2)) > 230
    dark = [x for x in range(ground.width) if ground.getpixel((x, APP_AT[1])) < 150]
    assert APP_AT[0] + 64 < min(dark) < max(dark) < APPLICATIONS_AT[0] - 64
    assert max(dark) - min(dark) > 80
    with Image.open(pictures / "background@2x.png") as retina:
        assert retina.size == (2 * WINDOW[0], 2 * WINDOW[1])


def test_generated_images_are_reproducible(pictures: Path, tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "installers.macos.pictures", tmp_path], cwd=ROOT, check=True)
    for each in pictures.iterdir():
        assert (tmp_path / each.name).read_bytes() == each.read_bytes(), each.name
