"""Film of a user's path: a numbered picture with a caption for each step, with the mouse or keys alone.

The pictures are written to the folder that the environment variable NEP_FILM names, in a folder for
each film, else to the test's own folder. When a step fails, its picture is saved too, with the error as
its caption.
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
PLAIN = str.maketrans("“”", '""')  # cv2 draws only ASCII characters
STRIP, MARGIN, TEXT_PX = 44, 16, 20  # caption strip below the picture
PAPER, INK = (0x22, 0x1C, 0x18), (0xF5, 0xF2, 0xF0)  # blue, green, red
STILL_LOOKS, STILL_S = 4, 0.12  # checks that the picture is still, and the seconds in between


class MouseOnly(Screen):
    """Screen on which only the mouse can be used; a key press fails the test."""

    def _key(self, name: str, *, down: bool) -> None:
        raise AssertionError(f"{name} is pressed on a path for the mouse alone")

    def wheel(self, x: float, y: float, turns: int) -> None:
        """Turn the wheel at a position, in pixels; positive turns are up."""
        self.move(x, y)
        for _ in range(abs(turns)):
            self.press(WHEEL_UP if turns > 0 else WHEEL_DOWN)
            self.release(WHEEL_UP if turns > 0 else WHEEL_DOWN)


class KeysOnly(Screen):
    """Screen on which only the keyboard can be used; mouse input fails the test."""

    def move(self, x: float, y: float) -> None:
        raise AssertionError("the mouse moves on a path for the keyboard alone")

    def _button(self, button: int = LEFT, *, down: bool) -> None:
        raise AssertionError("the mouse is pressed on a path for the keyboard alone")


class Film:
    """Series of captioned pictures of the window, one for each step."""

    def __init__(self, studio: Person, title: str, folder: Path) -> None:
        """Create the film's folder in NEP_FILM, or in ``folder`` if that variable is empty or not set."""
        self._studio = studio
        self.folder = Path(os.environ.get("NEP_FILM") or folder / "film") / title
        self.folder.mkdir(parents=True, exist_ok=True)
        for old in self.folder.glob("*.png"):
            old.unlink()
        self.pictures: list[Path] = []
        self.slowest: dict[str, Reaction] = {}

    def follow(self, studio: Person) -> None:
        """Continue with another window."""
        self._studio = studio

    @contextmanager
    def step(self, caption: str) -> Iterator[None]:
        """Run one step, with its actions and checks in the ``with`` block, and take a picture after it."""
        try:
            yield
        except BaseException as error:
            self._keep(caption, f"FAILED: {caption}: {str(error).splitlines()[0] if str(error) else error!r}")
            raise
        self._wait_still()
        self._keep(caption, caption)
        self._measure(caption)

    def _measure(self, caption: str) -> None:
        """Save the slowest reaction of a step to ``reactions.json``, which only `bench` evaluates."""
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
        """Wait until two pictures are equal, with a limit because a robot or a camera image keeps moving."""
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
    """Return an RGB picture with a caption below it, as BGR."""
    strip = np.full((STRIP, picture.shape[1], 3), PAPER, np.uint8)
    scale = TEXT_PX / cv2.getTextSize("Xg", cv2.FONT_HERSHEY_DUPLEX, 1.0, 1)[0][1] * 0.75
    plain = words.translate(PLAIN).encode("ascii", "replace").decode()
    place = (MARGIN, STRIP // 2 + TEXT_PX // 2 - 3)
    cv2.putText(strip, plain, place, cv2.FONT_HERSHEY_DUPLEX, scale, INK, 1, cv2.LINE_AA)
    return np.vstack([picture[:, :, ::-1], strip])


# -- shared by the mouse and keyboard paths ---------------------------------------------------------


def topic(studio: Person, name: str) -> tuple[float, float]:
    """Return the position of a topic's row in pixels."""
    return middle(studio.still_row("Topics", name)["rect"])
