"""One Studio with a virtual robot for several tests, which takes less time than one for each test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.ui.startup.single_instance import StartRequest, send_request, socket_name
from tests.e2e.behaviours import say, started, write
from tests.e2e.person import Seen, middle
from tests.e2e.studio import Studio, terminate_all
from tests.e2e.waiting import until
from tests.e2e.x11 import RIGHT, Screen
from tests.ports import free_port

RESET_S = 20.0
CORNER = (2, 990)  # no widget reacts to the mouse there
_HAS_BLOCKS = "!!document.querySelector('.nepTab:not([hidden]) .blocklyBlockCanvas [data-id]')"
_HAS_DRAG = "!!document.querySelector('.blocklyDragging')"


class SharedStudio:
    """Studio that tests use one after the other; each of them starts from the same state.

    Open files, menus, sheets and programs of a test are closed before the next test. After a failed test,
    and when that state can't be restored, the next test gets a new process with new settings.
    """

    def __init__(self, screen: Screen, create_folder: Callable[[], Path]) -> None:
        self._screen, self._create_folder = screen, create_folder
        self._studio: Studio | None = None
        self._is_spoiled = False
        self._failure = ""

    @property
    def studio(self) -> Studio:
        """Studio with an empty behaviour."""
        assert self._studio is not None, self._failure
        return self._studio

    def mark_spoiled(self) -> None:
        """Replace the process before the next test."""
        self._is_spoiled = True

    def prepare(self) -> None:
        """Restore the initial state, in a new process if necessary.

        This starts threads and opens pipes, so it must be called before the check for leaks of a test. If
        no process can be started, `studio` raises the reason.
        """
        self._screen.let_all_go()
        self._screen.move(*CORNER)
        if self._studio is not None and not self._is_spoiled:
            try:
                self._reset(self._studio)
                return
            except AssertionError:
                pass  # a new process has the initial state
        self.close()
        self._is_spoiled = False
        folder = self._create_folder()
        path = write(folder / "First.nepb", started(say("First")))
        self._studio = Studio(self._screen, folder / "home", f"127.0.0.1:{free_port()}", str(path))
        try:
            self._studio.wait_up().use_virtual_pepper()
            self._reset(self._studio)
        except AssertionError as error:
            self._failure = str(error)
            self.close()
        except BaseException:
            self.close()
            raise

    def open(self, path: Path) -> Studio:
        """Open a behaviour as a double click on its file does; return Studio when its blocks are shown."""
        studio = self.studio
        name, request = socket_name(studio.home), StartRequest((path,))
        until(lambda: send_request(name, request), "Studio accepts the file")
        _close_others(studio, path.stem)
        until(lambda: studio.page(_HAS_BLOCKS), "its blocks are shown")
        return studio

    def close(self) -> None:
        """End the process and its children."""
        if self._studio is not None:
            studio, self._studio = self._studio, None
            studio.close()
            terminate_all(studio.children())

    @staticmethod
    def _reset(studio: Studio) -> None:
        assert studio.process.poll() is None, "Studio has ended"

        def is_closed() -> bool:
            """Press Escape until no menu, sheet or large room is open."""
            if not (studio.menus("popup") or studio.all(kind="Scrim") or studio.all(kind="LargeRoom")):
                return True
            studio.screen.key("Escape")
            return False

        until(is_closed, "everything is closed", RESET_S)
        studio.screen.key("1", ["Alt"])
        if studio.programs():
            studio.screen.key("F12")
        until(lambda: not studio.programs(), "the program has ended", RESET_S)
        studio.find("Run", RESET_S, kind="RunButton")
        until(lambda: not studio.page(_HAS_DRAG), "no block is dragged", RESET_S)
        studio.choose("File", "New behaviour")
        _close_others(studio, "New behaviour")
        studio.says("Pepper ready", RESET_S)


def _close_others(studio: Studio, name: str) -> None:
    """Wait until the tab with this name is open and shown, and close all others."""

    def shown() -> Seen | None:
        tabs = studio.all(kind="BehaviourTab", checked=True)
        return next((tab for tab in tabs if str(tab["name"]).startswith(name)), None)

    until(shown, f"{name} is shown")
    if len(studio.all(kind="BehaviourTab")) > 1:
        tab = studio.still(kind="BehaviourTab", checked=True)
        studio.screen.click(*middle(tab["rect"]), RIGHT)
        studio.pick("Close other behaviours")
        until(lambda: len(studio.all(kind="BehaviourTab")) == 1, "no other tab is open")
