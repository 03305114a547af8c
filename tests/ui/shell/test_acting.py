"""Test of sending by hand in the main window: menu commands, status bar and Stop."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.core.run.acting.acting import SessionActing
from app.core.run.acting.arming import Target
from app.ui.intents import PublishMessage, SelectService
from app.ui.panels.act.publish import PANEL as PUBLISH
from app.ui.panels.act.publish.panel import PublishPanel
from app.ui.panels.act.services import PANEL as SERVICES
from app.ui.panels.act.services.panel import ServicesPanel
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import Theme
from tests.ui.fakes import Session
from tests.ui.shell_parts import PANELS, Answers

pytest_plugins = ["tests.ui.shell_fixtures"]
pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)


@pytest.fixture
def window(qtbot, theme: Theme) -> Iterator[MainWindow]:
    panels = {**PANELS, "publish": PUBLISH, "services": SERVICES}
    made = MainWindow(Session.full(), theme, panels, [], dialogs=Answers())  # type: ignore[arg-type]
    qtbot.addWidget(made)
    theme.apply()
    made.resize(1440, 900)
    yield made
    made.close()


def acting_of(window: MainWindow) -> SessionActing:
    return window.session.acting


def test_publish_and_call_commands_open_their_panels_and_stop_disarms(window: MainWindow) -> None:
    acting, run = acting_of(window), window.commands.run
    request = window.commands.request
    assert request(PublishMessage("/blackboard"))
    bench = window.show_layout("developer")
    publish = bench.docks["publish"].panel
    assert isinstance(publish, PublishPanel)
    assert publish.message is not None
    assert publish.message.topic == "/blackboard"
    assert run("publish.new")
    assert [each.topic for each in acting.saved_messages.messages] == ["/blackboard", ""]
    assert not request(PublishMessage("ros2 /camera")), "other networks are only looked at"
    assert request(SelectService("remember_face"))
    assert isinstance(bench.docks["services"].panel, ServicesPanel)
    assert {"publish", "services"} <= {entry.name for entry in window.commands.entries.all()}
    assert not acting.arming.is_on, "nothing is armed by opening a panel"
    acting.arm()
    acting.allow(Target("topic", "/blackboard"))
    window._update_status_bar()
    assert "Armed 5:00" in window.status.texts()
    run("run.stop")
    assert not acting.arming.is_on
    window._update_status_bar()
    assert not any(words.startswith("Armed") for words in window.status.texts())
