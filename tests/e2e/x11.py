"""Mouse, keyboard and pictures of an X screen, with real input events.

It uses libX11 and libXtst, which Qt WebEngine requires too, so that no package is needed for it.
"""

from __future__ import annotations

import ctypes
import ctypes.util
from collections.abc import Sequence

import numpy as np

Picture = np.ndarray
LEFT, RIGHT = 1, 3
WHEEL_UP, WHEEL_DOWN = 4, 5
ALL_PLANES = ctypes.c_ulong(-1).value
Z_PIXMAP = 2
KEYSYMS = {
    "Return": 0xFF0D, "Escape": 0xFF1B, "Delete": 0xFFFF, "Tab": 0xFF09, "BackSpace": 0xFF08,
    "Home": 0xFF50, "End": 0xFF57, "Left": 0xFF51, "Up": 0xFF52, "Right": 0xFF53, "Down": 0xFF54,
    "Shift": 0xFFE1, "Ctrl": 0xFFE3, "Alt": 0xFFE9,
    **{f"F{number}": 0xFFBD + number for number in range(1, 13)},
}  # fmt: skip
SHIFTED = set('~!@#$%^&*()_+{}|:"<>?')


class _Image(ctypes.Structure):
    _fields_ = (
        ("width", ctypes.c_int),
        ("height", ctypes.c_int),
        ("xoffset", ctypes.c_int),
        ("format", ctypes.c_int),
        ("data", ctypes.c_void_p),
        ("byte_order", ctypes.c_int),
        ("bitmap_unit", ctypes.c_int),
        ("bitmap_bit_order", ctypes.c_int),
        ("bitmap_pad", ctypes.c_int),
        ("depth", ctypes.c_int),
        ("bytes_per_line", ctypes.c_int),
        ("bits_per_pixel", ctypes.c_int),
    )


def _library(name: str) -> ctypes.CDLL:
    return ctypes.CDLL(ctypes.util.find_library(name) or f"lib{name}.so.6")


class Screen:
    """X display with mouse and keyboard."""

    def __init__(self, display: str) -> None:
        self.display = display
        self._x, self._test = _library("X11"), _library("Xtst")
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._x.XDefaultRootWindow.restype = ctypes.c_ulong
        self._x.XGetImage.restype = ctypes.POINTER(_Image)
        opened = self._x.XOpenDisplay(display.encode())
        if not opened:
            raise OSError(f"no X display {display}")
        self._d = ctypes.c_void_p(opened)
        self._root = ctypes.c_ulong(self._x.XDefaultRootWindow(self._d))
        self._at = (0, 0)
        self._buttons: set[int] = set()
        self._keys: set[str] = set()

    def close(self) -> None:
        self._x.XCloseDisplay(self._d)

    def let_all_go(self) -> None:
        """Release all held keys and buttons: one held by a failed test would disturb the next one."""
        for button in list(self._buttons):
            self.release(button)
        for name in list(self._keys):
            self.let_go(name)

    # -- the mouse --------------------------------------------------------------------------------

    def move(self, x: float, y: float) -> None:
        self._at = (round(x), round(y))
        self._test.XTestFakeMotionEvent(self._d, -1, *self._at, ctypes.c_ulong(0))
        self._x.XSync(self._d, 0)

    def glide(self, x: float, y: float, steps: int = 12) -> None:
        """Move the mouse to a position in small steps."""
        (left, top), parts = self._at, range(1, steps + 1)
        for part in parts:
            self.move(left + (x - left) * part / steps, top + (y - top) * part / steps)

    def press(self, button: int = LEFT) -> None:
        self._button(button, down=True)

    def release(self, button: int = LEFT) -> None:
        self._button(button, down=False)

    def click(self, x: float, y: float, button: int = LEFT) -> None:
        self.move(x, y)
        self.press(button)
        self.release(button)

    def double_click(self, x: float, y: float) -> None:
        """Double-click with a delay of the X server, so that the clicks stay close on a busy computer."""
        self.click(x, y)
        self._button(LEFT, down=True, after_ms=60)  # a click in the same millisecond isn't counted
        self.release()

    def _button(self, button: int, *, down: bool, after_ms: int = 0) -> None:
        (self._buttons.add if down else self._buttons.discard)(button)
        self._test.XTestFakeButtonEvent(self._d, button, int(down), ctypes.c_ulong(after_ms))
        self._x.XSync(self._d, 0)

    # -- the keyboard -----------------------------------------------------------------------------

    def key(self, name: str, held: Sequence[str] = ()) -> None:
        """Press and release a key while the ``held`` keys are down."""
        for each in held:
            self._key(each, down=True)
        self._key(name, down=True)
        self._key(name, down=False)
        for each in reversed(held):
            self._key(each, down=False)

    def hold(self, name: str) -> None:
        """Press a key without releasing it; `let_go` releases it."""
        self._key(name, down=True)

    def let_go(self, name: str) -> None:
        """Release a held key."""
        self._key(name, down=False)

    def type(self, text: str) -> None:
        """Type a text on the US keyboard layout, the one of Xvfb."""
        for letter in text:
            self.key(letter, ["Shift"] if letter.isupper() or letter in SHIFTED else [])

    def _key(self, name: str, *, down: bool) -> None:
        keysym = KEYSYMS.get(name) or ord(name)
        code = self._x.XKeysymToKeycode(self._d, ctypes.c_ulong(keysym))
        assert code, f"no key for {name!r}"
        (self._keys.add if down else self._keys.discard)(name)
        self._test.XTestFakeKeyEvent(self._d, code, int(down), ctypes.c_ulong(0))
        self._x.XSync(self._d, 0)

    # -- pictures ---------------------------------------------------------------------------------

    def picture(self, rect: Sequence[float]) -> Picture:
        """Return a rectangle of the screen as rows of RGB pixels, 0 to 255."""
        x, y, width, height = (round(value) for value in rect)
        got = self._x.XGetImage(
            self._d, self._root, x, y, width, height, ctypes.c_ulong(ALL_PLANES), Z_PIXMAP
        )
        assert got, f"no picture of {x}, {y}, {width}, {height}"
        image = got.contents
        raw = ctypes.string_at(image.data, image.bytes_per_line * image.height)
        self._x.XDestroyImage(got)
        rows = np.frombuffer(raw, np.uint8).reshape(height, -1)[:, : 4 * width].reshape(height, width, 4)
        return rows[:, :, 2::-1].copy()
