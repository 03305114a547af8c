"""Fixtures for tests with a live block editor, as a pytest plug-in of their modules."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from app.ui.blockly.view import BlocklyView, register_scheme
from tests.ui.blockly_person import DEFINITIONS, WAIT_MS, Person, editor, workspace

register_scheme()


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
