"""Tests of the page that the tests of the block editor share."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

import pytest

from app.ui.blockly import host
from app.ui.blockly.view import BlocklyView
from tests.ui.blockly_pages import PagePool
from tests.ui.blockly_person import DEFINITIONS, START, WAIT_MS, Person, editor, workspace

pytestmark = pytest.mark.web


@pytest.fixture
def pool(monkeypatch) -> Iterator[PagePool]:
    pool = PagePool()
    monkeypatch.setattr(host, "BlocklyWeb", pool.lend)
    yield pool
    pool.close()


def opened(qtbot, *blocks: dict) -> Person:
    view: BlocklyView = editor(qtbot, DEFINITIONS, 700, 450)
    view.load(workspace(*blocks))
    with qtbot.waitSignal(view.ready, timeout=WAIT_MS):
        view.show()
    return Person(qtbot, view)


def process_of(them: Person) -> int:
    assert them.view.web is not None
    return them.view.web.page.renderProcessPid()


def test_page_is_reused_in_the_same_process_without_state_of_the_last_editor(qtbot, pool) -> None:
    first = opened(qtbot, START)
    first.ask("(window.nepLeft = 1, document.documentElement.setAttribute('data-left', 'yes'))")
    process = process_of(first)
    changes: list[str] = []
    pool.take_back()
    second = opened(qtbot)
    second.view.changed.connect(lambda key, _workspace: changes.append(key))
    assert process_of(second) == process
    assert second.ask("[window.nepLeft ?? 0, document.documentElement.dataset.left ?? '']") == [0, ""]
    assert second.tops() == []
    assert changes == []


def test_page_whose_process_was_killed_is_not_reused(qtbot, pool) -> None:
    them = opened(qtbot, START)
    process = process_of(them)
    with qtbot.waitSignal(them.view.ready, timeout=WAIT_MS):
        os.kill(process, signal.SIGKILL)
    web = them.view.web
    pool.take_back()
    assert opened(qtbot, START).view.web is not web


def test_second_editor_of_a_test_gets_its_own_page(qtbot, pool) -> None:
    one, two = opened(qtbot, START), opened(qtbot)
    assert one.view.web is not two.view.web
    assert [len(one.tops()), len(two.tops())] == [1, 0]
