"""Fixtures of the tests that need a live block editor (a pytest plugin of those modules)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from app.ui.blockly_view import BlocklyView, register_scheme
from tests.ui.blockly_person import DEFINITIONS, WAIT_MS, Person, workspace

register_scheme()


@pytest.fixture
def view(qtbot) -> BlocklyView:
    made = BlocklyView()
    qtbot.addWidget(made)
    made.resize(1031, 586)
    made.set_definitions(DEFINITIONS)
    return made


@pytest.fixture
def person(qtbot, view) -> Callable[..., Person]:
    def open_with(*blocks: dict, state: dict | None = None) -> Person:
        view.load(state or workspace(*blocks))
        with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
            view.show()
        return Person(qtbot, view)

    return open_with
