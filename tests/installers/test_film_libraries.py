"""Test that a packaged OpenCV reads and writes images and contains no video library."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from installers.context import Context
from installers.linux.film_libraries import FFMPEG_LIBRARIES, remove_ffmpeg

found = importlib.util.find_spec("cv2")
SITE = Path(found.origin or "").parents[1] if found is not None else Path()
LIBRARIES = SITE / "opencv_python_headless.libs"

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux")
    or not LIBRARIES.is_dir()
    or shutil.which("gcc") is None
    or shutil.which("readelf") is None,
    reason="needs Linux, gcc, readelf and OpenCV's own libraries",
)

USE = """
import sys, numpy as np, cv2
assert cv2.__file__.startswith(sys.argv[1]), cv2.__file__
picture = np.full((48, 64, 3), 200, np.uint8)
for kind in (".jpg", ".png", ".webp", ".bmp"):
    done, data = cv2.imencode(kind, picture)
    assert done and cv2.imdecode(data, cv2.IMREAD_COLOR).shape == picture.shape, kind
film = sys.argv[1] + "/film.mp4"
assert not cv2.VideoWriter(film, cv2.VideoWriter_fourcc(*"mp4v"), 5, (64, 48)).isOpened()
open(film, "wb").write(b"no film")
assert not cv2.VideoCapture(film).isOpened()
print("well")
"""


def test_opencv_without_ffmpeg_handles_images_and_opens_no_videos(tmp_path: Path) -> None:
    context = replace(Context("linux"), root=tmp_path)
    inside = context.frozen / "_internal"
    shutil.copytree(SITE / "cv2", inside / "cv2", ignore=shutil.ignore_patterns("data", "*.pyi"))
    shutil.copytree(LIBRARIES, inside / LIBRARIES.name)
    (inside / "libvpx.so.11").symlink_to(next(LIBRARIES.glob("libvpx*")))
    saved = remove_ffmpeg(context)
    assert saved > 20_000_000
    films = [path for path in (inside / LIBRARIES.name).iterdir() if FFMPEG_LIBRARIES.match(path.name)]
    assert films
    assert sum(path.stat().st_size for path in films) < 100_000
    environ = {**os.environ, "PYTHONPATH": str(inside), "OPENCV_VIDEOIO_PRIORITY_FFMPEG": "0"}
    done = subprocess.run(
        [sys.executable, "-c", USE, str(inside)], env=environ, capture_output=True, text=True, check=False
    )
    assert done.stdout == "well\n", done.stderr
