"""Reduce screenshots to 256 colours; flat surfaces and text keep their exact colours.

    python tools/small_png.py PICTURE.png ...

The files are overwritten.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from PySide6.QtGui import QImage

COLOURS = 256
EXACT_SHARE = 0.4375  # share of the table for the most frequent colours; the others are found by clustering
SAMPLE, ROUNDS = 40_000, 12


def shrink(path: Path, max_colours: int = COLOURS) -> int:
    """Rewrite an image file with at most `max_colours` colours; return the new size in bytes.

    Raises `OSError` if the file isn't a readable image or can't be written.
    """
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise OSError(f"{path} isn't a readable image")
    height, width = picture.shape[:2]
    packed = picture.astype(np.uint32) @ np.array([1, 256, 65536], np.uint32)
    colours, inverse, counts = np.unique(packed.ravel(), return_inverse=True, return_counts=True)
    table = _colour_table(colours, counts, max_colours)
    index = _nearest(_channels(colours), table)[inverse].astype(np.uint8).reshape(height, width)
    image = QImage(index.tobytes(), width, height, width, QImage.Format.Format_Indexed8)
    image.setColorTable([0xFF000000 | (r << 16) | (g << 8) | b for b, g, r in table.astype(int).tolist()])
    if not image.save(str(path), quality=0):
        raise OSError(f"{path} can't be written")
    return path.stat().st_size


def _channels(colours: np.ndarray) -> np.ndarray:
    # Packed colours as rows of blue, green, red.
    return np.stack([colours & 255, colours >> 8 & 255, colours >> 16 & 255], axis=1).astype(np.float32)


def _colour_table(colours: np.ndarray, counts: np.ndarray, max_colours: int) -> np.ndarray:
    # The most frequent colours, and cluster centres of the others.
    order = np.argsort(counts)[::-1]
    exact_count = round(EXACT_SHARE * max_colours)
    exact, others, cluster_count = order[:exact_count], order[exact_count:], max_colours - exact_count
    table = _channels(colours[exact])
    if len(others) <= cluster_count:
        return np.vstack([table, _channels(colours[others])])
    rng = np.random.default_rng(7)  # fixed seed, for reproducible files
    share = counts[others] / counts[others].sum()
    sample = _channels(colours[rng.choice(others, SAMPLE, p=share)])
    cv2.setRNGSeed(7)
    criteria = (cv2.TERM_CRITERIA_MAX_ITER, ROUNDS, 0.0)
    _, _, centres = cv2.kmeans(
        sample, cluster_count, np.zeros(0, np.int32), criteria, 1, cv2.KMEANS_PP_CENTERS
    )
    return np.vstack([table, np.rint(centres)])


def _nearest(colours: np.ndarray, table: np.ndarray) -> np.ndarray:
    # Index of the nearest table colour for each colour.
    nearest = np.empty(len(colours), np.int64)
    for begin in range(0, len(colours), 4096):
        batch = colours[begin : begin + 4096]
        nearest[begin : begin + 4096] = ((batch[:, None, :] - table[None]) ** 2).sum(axis=2).argmin(axis=1)
    return nearest


if __name__ == "__main__":
    for name in sys.argv[1:]:
        sys.stdout.write(f"{shrink(Path(name))} bytes  {name}\n")
