"""While the page of the blocks is not there, words say so; a quick page is not announced."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.ui.panels.behaviour.panel import WAIT_UNTIL_S, BlocksWait


def test_loading_message_appears_after_a_delay_and_disappears_with_the_page(qtbot) -> None:
    place = QWidget()
    qtbot.addWidget(place)
    place.resize(600, 400)
    now = [10.0]
    wait = BlocksWait(place, lambda: now[0])
    wait.report(ready=False)
    now[0] += WAIT_UNTIL_S - 0.01
    wait.report(ready=False)
    assert wait.words.isHidden()
    now[0] += 0.02
    wait.report(ready=False)
    assert not wait.words.isHidden()
    assert wait.words.text() == "Loading blocks."
    assert wait.words.geometry() == place.rect()
    wait.report(ready=True)
    assert wait.words.isHidden()
    wait.report(ready=False)  # its process died: the patience begins anew
    assert wait.words.isHidden()
