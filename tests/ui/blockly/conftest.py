"""Fixtures for tests with a live block editor. The tests of a file share one web page."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator

import pytest
from PySide6.QtCore import QCoreApplication, QEvent

from app.ui.blockly import host
from app.ui.blockly.view import BlocklyView, register_scheme
from tests.ui.blockly_pages import PagePool
from tests.ui.blockly_person import DEFINITIONS, WAIT_MS, Person, editor, workspace

register_scheme()
_pool = PagePool()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown() -> Generator[None, object, object]:
    """Take the shared page back before pytest-qt deletes the editor of the test."""
    _pool.take_back()
    return (yield)


@pytest.fixture(autouse=True, scope="module")
def _shared_page(_garbage: None) -> Iterator[None]:
    """Lend the page of the previous test to the editor of the next one, until the end of the file."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(host, "BlocklyWeb", _pool.lend)
        yield
    _pool.close()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


@pytest.fixture
def view(qtbot) -> BlocklyView:
    return editor(qtbot, DEFINITIONS, 1031, 586)


@pytest.fixture
def person(qtbot, view) -> Callable[..., Person]:
    def open_with(*blocks: dict, state: dict | None = None) -> Person:
        view.load(state or workspace(*blocks))
        with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
            view.show()
        return Person(qtbot, view)

    return open_with
