"""Tests of the removal of FFmpeg from OpenCV: stubs replace it, and its own dependencies are removed."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from installers.context import PackageError
from installers.macos.film_libraries import FFMPEG_LIBRARIES, remove_ffmpeg
from installers.macos.layout import check
from installers.macos.mach_o import read
from tests.installers.macos.made_up_app import VERSION, context, header, link, made_up_app, put

NEEDED = ("clang", "ld.lld", "llvm-nm")
CV2 = Path("Contents/Frameworks/cv2")
SYSTEM = 'void binder(void) __asm__("dyld_stub_binder"); void binder(void) {}'
"""C source of the symbol that the linker requires from the system library of macOS."""


def library(path: Path, source: str, *linked: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    code = put(path.with_suffix(".c"), source.encode())
    command = ["clang", "--target=arm64-apple-macos13.0", "-dynamiclib", "-nostdlib", "-fuse-ld=lld"]
    name = f"/usr/lib/{path.name}" if "System" in path.name else f"@loader_path/{path.name}"
    subprocess.run(
        [*command, "-mlinker-version=705", "-install_name", name, "-o", path, code, *linked], check=True
    )
    code.unlink()
    return path


def exported(path: Path) -> set[str]:
    told = subprocess.run(["llvm-nm", "-g", "-U", path], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1].lstrip("_") for line in told.splitlines() if line.strip()}


@pytest.mark.skipif(not all(shutil.which(tool) for tool in NEEDED), reason="needs clang and LLVM's linker")
def test_ffmpeg_is_replaced_by_a_stub_and_image_libraries_are_kept(tmp_path: Path) -> None:
    app = made_up_app(tmp_path)
    folder = app / CV2 / "__dot__dylibs"
    system = library(tmp_path / "libSystem.B.dylib", SYSTEM)
    coder = library(folder / "libx264.164.dylib", "int x264(void) { return 264; }")
    films = library(
        folder / "libavcodec.61.dylib",
        "int x264(void); int avcodec_open2(void) { return x264(); }",
        coder,
        system,
    )
    library(folder / "libswresample.5.dylib", "int swr_init(void) { return 1; }")
    pictures = library(folder / "libavif.16.dylib", "int avifDecode(void) { return 2; }")
    both = (
        "int avcodec_open2(void), avifDecode(void); int cv(void) { return avcodec_open2() + avifDecode(); }"
    )
    user = library(app / CV2 / "cv2.abi3.so", both, films, pictures, system)
    link(app / CV2 / ".dylibs", "__dot__dylibs")
    link(app / "Contents/Frameworks/libx264.164.dylib", "cv2/__dot__dylibs/libx264.164.dylib")
    kept = pictures.read_bytes(), user.read_bytes()
    assert remove_ffmpeg(context(tmp_path), app) > 0
    assert {path.name for path in folder.iterdir()} == {"libavcodec.61.dylib", "libavif.16.dylib"}
    assert exported(films) == {"avcodec_open2"}
    (made,) = read(films)
    assert (made.machine, made.oldest_macos, made.needs) == ("arm64", (13, 0), ())
    assert (pictures.read_bytes(), user.read_bytes()) == kept
    assert check(app, VERSION, "arm64") == []


def test_application_without_video_libraries_saves_no_space(tmp_path: Path) -> None:
    app = made_up_app(tmp_path)
    put(app / CV2 / "cv2.abi3.so", header())
    assert remove_ffmpeg(context(tmp_path), app) == 0


def test_video_libraries_in_an_unexpected_folder_raise(tmp_path: Path) -> None:
    app = made_up_app(tmp_path)
    put(app / "Contents/Frameworks/libavcodec.61.dylib", header())
    with pytest.raises(PackageError, match="FFmpeg is in an unexpected folder"):
        remove_ffmpeg(context(tmp_path), app)


@pytest.mark.parametrize(
    ("name", "is_film"),
    [("libavcodec.61.19.101.dylib", True), ("libpostproc.58.dylib", True), ("libavif.16.3.0.dylib", False)],
)
def test_ffmpeg_libraries_are_recognised_by_their_names_and_avif_is_not(name: str, is_film: bool) -> None:
    assert (FFMPEG_LIBRARIES.match(name) is not None) == is_film
