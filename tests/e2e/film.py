"""A film of a person's path: a numbered picture with a caption for each step, and hands with one tool only.

The pictures go to the folder that the environment variable NEP_FILM names, in a folder for each film, else to
the test's own folder. When a step fails, its picture is kept too, with what was missing.
"""

from __future__ import annotations

import json
import os
import re
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from tests.e2e.person import Person, Reaction, middle
from tests.e2e.x11 import LEFT, Picture, Screen

WHEEL_UP, WHEEL_DOWN = 4, 5
PLAIN = str.maketrans("“”", '""')  # the letters of a caption are those of ASCII
STRIP, MARGIN, TEXT_PX = 44, 16, 20  # the caption's strip below the picture
PAPER, INK = (0x22, 0x1C, 0x18), (0xF5, 0xF2, 0xF0)  # blue, green, red
STILL_LOOKS, STILL_S = 4, 0.12  # how often, and how far apart, it is looked whether the picture stands still


class MouseOnly(Screen):
    """A person's hand on the mouse; there is no keyboard."""

    def _key(self, name: str, *, down: bool) -> None:
        raise AssertionError(f"{name} is pressed on a path for the mouse alone")

    def wheel(self, x: float, y: float, turns: int) -> None:
        """Turn the wheel there: up when positive."""
        self.move(x, y)
        for _ in range(abs(turns)):
            self.press(WHEEL_UP if turns > 0 else WHEEL_DOWN)
            self.release(WHEEL_UP if turns > 0 else WHEEL_DOWN)


class KeysOnly(Screen):
    """A person's hands on the keyboard; there is no mouse."""

    def move(self, x: float, y: float) -> None:
        raise AssertionError("the mouse moves on a path for the keyboard alone")

    def _button(self, button: int = LEFT, *, down: bool) -> None:
        raise AssertionError("the mouse is pressed on a path for the keyboard alone")


class Film:
    """Keeps what a person sees, step by step."""

    def __init__(self, studio: Person, title: str, folder: Path) -> None:
        """``folder`` is used when NEP_FILM says nothing."""
        self._studio = studio
        self.folder = Path(os.environ.get("NEP_FILM") or folder / "film") / title
        self.folder.mkdir(parents=True, exist_ok=True)
        for old in self.folder.glob("*.png"):
            old.unlink()
        self.pictures: list[Path] = []
        self.slowest: dict[str, Reaction] = {}

    def follow(self, studio: Person) -> None:
        """Go on with another window."""
        self._studio = studio

    @contextmanager
    def step(self, caption: str) -> Iterator[None]:
        """One step: what is done and what must be seen stands in the block; then its picture is taken."""
        try:
            yield
        except BaseException as error:
            self._keep(caption, f"FAILED: {caption}: {str(error).splitlines()[0] if str(error) else error!r}")
            raise
        self._wait_still()
        self._keep(caption, caption)
        self._measure(caption)

    def _measure(self, caption: str) -> None:
        """Keeps the slowest answer of a step in ``reactions.json``; `bench` judges it, no test does."""
        seen = self._studio.reactions()
        if seen:
            self.slowest[caption] = max(seen, key=lambda each: each.took_ms)
        told = {step: each._asdict() for step, each in self.slowest.items()}
        (self.folder / "reactions.json").write_text(json.dumps(told, indent=1), "utf-8")

    def _window(self) -> Sequence[float]:
        left, top, width, height = self._studio.find(kind="MainWindow")["rect"]
        right, bottom = min(left + width, 1600), min(top + height, 1000)
        return max(left, 0), max(top, 0), right - max(left, 0), bottom - max(top, 0)

    def _wait_still(self) -> None:
        """Let what moves arrive; a robot or a camera never does, so not for long."""
        pause = threading.Event()
        before: Picture | None = None
        for _ in range(STILL_LOOKS):
            now = self._studio.screen.picture(self._window())
            if before is not None and before.shape == now.shape and (before == now).all():
                return
            before = now
            pause.wait(STILL_S)

    def _keep(self, name: str, words: str) -> None:
        number = len(self.pictures) + 1
        short = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:50].strip("-")
        path = self.folder / f"{number:02d}-{short}.png"
        picture = with_caption(self._studio.screen.picture(self._window()), f"{number}  {words}")
        assert cv2.imwrite(str(path), picture), f"{path} can't be written"
        self.pictures.append(path)


def with_caption(picture: Picture, words: str) -> Picture:
    """The picture (red, green, blue) with a strip below that says the words; as blue, green, red."""
    strip = np.full((STRIP, picture.shape[1], 3), PAPER, np.uint8)
    scale = TEXT_PX / cv2.getTextSize("Xg", cv2.FONT_HERSHEY_DUPLEX, 1.0, 1)[0][1] * 0.75
    plain = words.translate(PLAIN).encode("ascii", "replace").decode()
    place = (MARGIN, STRIP // 2 + TEXT_PX // 2 - 3)
    cv2.putText(strip, plain, place, cv2.FONT_HERSHEY_DUPLEX, scale, INK, 1, cv2.LINE_AA)
    return np.vstack([picture[:, :, ::-1], strip])


# -- what both paths need ---------------------------------------------------------------------------


def topic(studio: Person, name: str) -> tuple[float, float]:
    """Where the row of a topic is."""
    return middle(studio.row("Topics", name)["rect"])
