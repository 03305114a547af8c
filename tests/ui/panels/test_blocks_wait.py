"""Test of the loading message of the block editor, which appears only after a delay."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.ui.panels.build.behaviour.panel import LOADING_TEXT_DELAY_S, LoadingMessage


def test_loading_message_appears_after_a_delay_and_disappears_when_the_page_is_loaded(qtbot) -> None:
    place = QWidget()
    qtbot.addWidget(place)
    place.resize(600, 400)
    now = [10.0]
    wait = LoadingMessage(place, lambda: now[0])
    wait.set_ready(is_ready=False)
    now[0] += LOADING_TEXT_DELAY_S - 0.01
    wait.set_ready(is_ready=False)
    assert wait.text_label.isHidden()
    now[0] += 0.02
    wait.set_ready(is_ready=False)
    assert not wait.text_label.isHidden()
    assert wait.text_label.text() == "Loading blocks…"
    assert wait.text_label.geometry() == place.rect()
    wait.set_ready(is_ready=True)
    assert wait.text_label.isHidden()
    wait.set_ready(is_ready=False)  # its process died: the delay starts again
    assert wait.text_label.isHidden()
