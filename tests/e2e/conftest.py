"""Fixtures of the end-to-end tests: real processes on a virtual screen, separate from the user's mouse."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable, Generator, Iterator
from pathlib import Path

import pytest

from dev import virtual_screen
from tests.e2e.shared_studio import CORNER, SharedStudio
from tests.e2e.studio import Studio, save_picture, terminate_all
from tests.e2e.x11 import Screen
from tests.ports import free_port

HERE = Path(__file__).parent
_SHARED = "shared"  # the fixture
_shared_studio = pytest.StashKey[SharedStudio]()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test in this folder as ``e2e`` and skip it without Xvfb."""
    missing = pytest.mark.skip(reason="needs Xvfb (the package xvfb): a screen that is nobody's")
    for item in items:
        if str(item.path).startswith(f"{HERE}{os.sep}"):  # `path.parents` takes half a second for all tests
            item.add_marker(pytest.mark.e2e)
            if shutil.which("Xvfb") is None:
                item.add_marker(missing)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Save a picture of the screen when a test fails, before its fixtures are closed."""
    report = yield
    if (
        report.failed
        and _SHARED in getattr(item, "fixturenames", ())
        and _shared_studio in item.session.stash
    ):
        item.session.stash[_shared_studio].mark_spoiled()
    screen = getattr(item, "funcargs", {}).get("screen")
    folder = getattr(item, "funcargs", {}).get("tmp_path")
    if report.when == "call" and report.failed and screen is not None and folder is not None:
        with contextlib.suppress(OSError, AssertionError):
            save_picture(screen, folder / "screen.png")
            report.sections.append(("Screen", f"the screen is in {folder / 'screen.png'}"))
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Restore the state of the shared Studio, before the check for leaks begins."""
    if _SHARED in getattr(item, "fixturenames", ()) and _shared_studio in item.session.stash:
        item.session.stash[_shared_studio].prepare()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None, None, None]:
    """Close the shared Studio unless the next test uses it, too."""
    try:
        return (yield)
    finally:
        if _SHARED not in getattr(nextitem, "fixturenames", ()) and _shared_studio in item.session.stash:
            item.session.stash[_shared_studio].close()


@pytest.fixture(scope="session")
def shared(
    request: pytest.FixtureRequest, screen: Screen, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[SharedStudio]:
    """Studio with the virtual Pepper that is shared between tests; a failed test doesn't affect the next."""
    studio = SharedStudio(screen, lambda: tmp_path_factory.mktemp("shared"))
    studio.prepare()
    request.session.stash[_shared_studio] = studio
    yield studio
    studio.close()


@pytest.fixture(scope="session")
def screen() -> Iterator[Screen]:
    """Virtual screen of 1600 x 1000 pixels for this test alone."""
    with virtual_screen() as number:
        screen = Screen(f":{number}")
        yield screen
        screen.close()


@pytest.fixture
def address(monkeypatch: pytest.MonkeyPatch) -> str:
    """Address of this test's master, which may not be running yet."""
    address = f"127.0.0.1:{free_port()}"
    monkeypatch.setenv("NEP_MASTER", address)
    return address


@pytest.fixture
def start(screen: Screen, address: str, tmp_path: Path) -> Iterator[Callable[..., Studio]]:
    """Function that starts Studio, always with the same settings; all are closed after the test."""
    started: list[Studio] = []

    def start(*arguments: str, **environment: str) -> Studio:
        started.append(Studio(screen, tmp_path / "home", address, *arguments, **environment))
        return started[-1].wait_up()

    screen.move(*CORNER)
    yield start
    screen.let_all_go()
    for studio in started:
        studio.close()
    if started:
        terminate_all(started[0].children())


@pytest.fixture
def studio(start: Callable[..., Studio]) -> Studio:
    """Studio on its start page."""
    return start()
