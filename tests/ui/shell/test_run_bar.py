"""Tests of the six states of Run and Stop, large and compact, as in design image 10."""

from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.core.run.view import RunView
from app.robots.client.stop_report import StopStatus
from app.ui.panels.command import Command
from app.ui.shell.actions.actions import Actions
from app.ui.shell.bars.run_bar import SPEED_COMMANDS, RunBar, ToolBar
from app.ui.theme.theme import Theme
from app.ui.widgets import StopButton, paint

pytest_plugins = ["tests.ui.shell_fixtures"]

VIEWS = {
    "ready": RunView(
        "ready", "Ready", "Pepper and Turtle are connected", "Ready", can_run=True, can_step=True,
    ),
    "running": RunView(
        "running", "Running, 14 s", "Pepper says “Touch my head.”", "Greeting runs, 14 s",
        can_pause=True, can_step=True, can_restart=True, run_label="Restart",
        last_stop="all 2 robots stopped (41 ms)",
        last_stop_status="ok",
    ),
    "paused": RunView(
        "paused", "Paused at “wait 2 s”", "Robots and timers are paused", "Greeting is paused",
        can_run=True, can_step=True, can_restart=True, run_label="Resume",
    ),
    "stopping": RunView(
        "stopping", "Stopping", "Waiting for Turtle, 0.2 s", "Stopping",
        stop_label="Stopping", result="1 of 2 robots stopped",
    ),
    "proven": RunView(
        "proven", "Stopped after 14 s", "It stopped at the dashed block", "Stopped after 14 s",
        can_run=True, can_step=True, result="all 2 robots stopped (41 ms)", result_status="ok",
    ),
    "unanswered": RunView(
        "unanswered", "Turtle didn't reply", "Pepper stopped (38 ms). Switch Turtle off by hand.",
        "Turtle did not reply; switch it off by hand", stop_label="Stop again",
        result="1 of 2 robots stopped", result_status="error", confirm_label="Turtle isn't moving",
    ),
}  # fmt: skip


@pytest.fixture
def bar(qtbot, theme: Theme) -> RunBar:
    made = RunBar(theme)
    made.resize(1440, 60)
    qtbot.addWidget(made)
    made.show()
    return made


@pytest.fixture
def tools(qtbot, theme: Theme) -> ToolBar:
    made = ToolBar(theme)
    made.resize(1440, 40)
    qtbot.addWidget(made)
    made.show()
    return made


@pytest.mark.parametrize(
    ("state", "run", "pause", "step", "stop", "look"),
    [
        ("ready", True, False, True, "Stop", ""),
        ("running", False, True, True, "Stop", "reminder"),
        ("paused", True, False, True, "Stop", ""),
        ("stopping", False, False, False, "Stopping", "counting"),
        ("proven", True, False, True, "Stop", "ok"),
        ("unanswered", False, False, False, "Stop again", "error"),
    ],
)
def test_run_bar_shows_buttons_result_and_text_of_each_state(
    bar: RunBar, state, run, pause, step, stop, look
) -> None:
    bar.show_view(VIEWS[state])
    can_press = run or state == "running"  # the button is Restart while running
    assert (bar.run.isEnabled(), bar.pause.isEnabled(), bar.step.isEnabled()) == (can_press, pause, step)
    assert bar.run.kind == ("run" if run else "plain")
    assert bar.stop.text() == stop
    assert bar.stop.isEnabled()
    assert bar.result.appearance == look
    assert bar.confirm.isVisible() == (state == "unanswered")
    assert bar.sentence.accessibleName() == f"{VIEWS[state].title}. {VIEWS[state].detail}"
    assert (bar.sentence.colour_role == "text") == (state != "unanswered")  # otherwise red


@pytest.mark.parametrize("status", ["ok", "off", "error"])
def test_icon_shows_the_result_of_the_last_stop(bar: RunBar, status: StopStatus) -> None:
    bar.show_view(replace(VIEWS["running"], last_stop="1 of 2 robots stopped", last_stop_status=status))
    assert (bar.result.appearance, bar.result.status) == ("reminder", status)


def test_buttons_keep_their_position_in_all_states(bar: RunBar) -> None:
    places = set()
    for view in VIEWS.values():
        bar.show_view(view)
        QTest.qWait(1)
        places.add(tuple(w.geometry().getRect() for w in (bar.run, bar.pause, bar.step, bar.stop)))
    assert len(places) == 1


def test_run_button_text_is_resume_while_paused(bar: RunBar) -> None:
    bar.show_view(VIEWS["paused"])
    assert bar.run.text() == "Resume"
    bar.show_view(VIEWS["ready"])
    assert bar.run.text() == "Run"


def test_restart_replaces_run_and_is_filled_when_the_blocks_were_edited(bar: RunBar) -> None:
    bar.show_view(VIEWS["running"])
    assert (bar.run.text(), bar.run.icon_name, bar.run.kind) == ("Restart", "rotate-ccw", "plain")
    bar.show_view(replace(VIEWS["running"], is_edited=True))
    assert (bar.run.text(), bar.run.kind, bar.restart.isVisible()) == ("Restart", "run", False)
    bar.show_view(replace(VIEWS["paused"], is_edited=True))
    assert (bar.run.text(), bar.restart.isVisible()) == ("Resume", True)
    bar.show_view(VIEWS["paused"])
    assert not bar.restart.isVisible()


def test_run_restart_confirm_and_stop_buttons_trigger_their_commands(theme: Theme, bar: RunBar) -> None:
    told: list[str] = []
    names = ("run.run", "run.restart", "run.pause", "run.step", "run.stop", "run.confirm", *SPEED_COMMANDS)

    def row(name: str) -> Command[None]:
        return Command(name, name, lambda _do: told.append(name))

    bar.set_actions(Actions(bar, theme, [row(name) for name in names], None))
    bar.show_view(VIEWS["ready"])
    QTest.mouseClick(bar.run, Qt.MouseButton.LeftButton)
    bar.show_view(VIEWS["unanswered"])
    QTest.mouseClick(bar.run, Qt.MouseButton.LeftButton)
    QTest.mouseClick(bar.confirm, Qt.MouseButton.LeftButton)
    QTest.mouseClick(bar.stop, Qt.MouseButton.LeftButton)
    bar.show_view(VIEWS["running"])
    QTest.mouseClick(bar.run, Qt.MouseButton.LeftButton)
    bar.show_view(replace(VIEWS["paused"], is_edited=True))
    QTest.mouseClick(bar.restart, Qt.MouseButton.LeftButton)
    assert told == ["run.run", "run.confirm", "run.stop", "run.run", "run.restart"]


@pytest.mark.parametrize(
    ("state", "run", "pause", "words"),
    [
        ("running", False, True, "Greeting runs, 14 s"),
        ("proven", True, False, "all 2 robots stopped (41 ms)"),
        ("unanswered", False, False, "Turtle did not reply; switch it off by hand"),
        ("paused", True, False, "Greeting is paused"),
    ],
)
def test_compact_bar_shows_all_states(tools: ToolBar, state: str, run: bool, pause: bool, words: str) -> None:
    tools.show_view(VIEWS[state])
    assert (tools.run.isVisible(), tools.pause.isVisible()) == (run, pause)
    spoken = tools.result.text if tools.result.isVisible() else tools.text_label.text()
    assert spoken == words
    assert tools.stop.isVisible()
    assert tools.confirm.isVisible() == (state == "unanswered")


def test_stop_button_of_the_compact_bar_keeps_its_position_in_every_run_state(tools: ToolBar) -> None:
    places = set()
    for view in VIEWS.values():
        tools.show_view(view)
        QTest.qWait(1)
        places.add(tools.stop.geometry().getRect())
    assert len(places) == 1


@pytest.mark.parametrize("place", ["runBar", "toolBar", "appBar"])
@pytest.mark.parametrize("word", ["Stop", "Stopping", "Stop again"])
def test_stop_button_fits_all_its_texts_and_its_shortcut(qtbot, theme: Theme, place, word) -> None:
    stop = StopButton(theme, place)
    qtbot.addWidget(stop)
    size = stop.sizeHint()
    stop.show_state(word)
    assert stop.sizeHint() == size, "its size stays"
    stop.resize(size)
    font, key_font = stop._fonts()
    key = paint.width_of(key_font, "F12") + 7 if place != "runBar" else 0
    needed = stop._icon_side() + 8 + paint.width_of(font, word) + key
    assert needed + 12 <= size.width() - 2 * 4, "within its frame, with some air"


def test_detail_that_is_too_long_for_one_line_uses_two_lines(bar: RunBar) -> None:
    fault = "“walk” stopped: Pepper did not say within 20 s that it had arrived, and it may have met a wall"
    bar.show_view(replace(VIEWS["proven"], detail=fault, result=None))
    sentence = bar.sentence
    whole = sentence.lines(2000.0)
    assert [text for text, _font, _role in whole] == ["Stopped after 14 s", fault]
    narrow = 360.0
    title, first, second = sentence.lines(narrow)
    assert title[0] == "Stopped after 14 s"
    assert f"{first[0]} {second[0]}" == fault
    assert all(paint.width_of(font, text) <= narrow for text, font, _role in (first, second))
    assert fault in sentence.toolTip()


def test_state_text_keeps_its_width_next_to_a_stop_result_in_a_narrow_window(qtbot, bar: RunBar) -> None:
    bar.show_view(replace(VIEWS["proven"], result="Pepper stopped (41 ms)"))
    assert bar.pause.sizeHint().width() == bar.pause.full_width()
    bar.resize(1024, 60)
    qtbot.waitUntil(lambda: bar.sentence.width() >= 180)
    assert bar.pause.sizeHint().width() < bar.pause.full_width()


def test_long_success_result_is_shortened_to_make_room_for_an_error(qtbot, bar: RunBar) -> None:
    good = "the robot of the second group and all others have stopped (41 ms), as far as anybody can tell"
    fault = replace(VIEWS["proven"], title="Stopped after 14 s because of an error", result=good)
    bar.resize(1093, 60)
    bar.show_view(fault)
    qtbot.waitUntil(lambda: bar.sentence.width() >= 180)
    assert bar.result.toolTip() == good
    bar.show_view(replace(fault, result_status="error"))  # an error result is never shortened
    qtbot.waitUntil(lambda: bar.result.width() >= bar.result.sizeHint().width())


def test_title_without_a_detail_is_the_only_line(bar: RunBar) -> None:
    bar.show_view(replace(VIEWS["proven"], title="Stopped", detail=""))
    assert [text for text, _font, _role in bar.sentence.lines(300.0)] == ["Stopped"]
    assert bar.sentence.accessibleName() == "Stopped"
    assert bar.sentence.toolTip() == "Stopped"
