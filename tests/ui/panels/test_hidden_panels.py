"""Tests that hidden panels have no watches, streams or 60 Hz timer and get them back when shown."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QEvent, QObject
from PySide6.QtWidgets import QApplication, QMainWindow

from app.core.session import Session
from app.core.storage.settings import Settings
from app.robots import simulated
from app.robots.description.description import parse, thing_description
from app.ui.panels.registry import PanelRegistry
from app.ui.panels.robots.camera import CameraPanel
from app.ui.panels.robots.robot.panel import RobotPanel
from app.ui.panels.watch.image.panel import ImagePanel
from app.ui.panels.watch.inspector.panel import InspectorPanel
from app.ui.shell.docking.dock import SUSPEND_DELAY_S, Dock, is_on_screen
from app.ui.shell.main_window import TICK_MS, MainWindow
from app.ui.theme.theme import Theme
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo
from tests.ui.fakes.network import Network
from tests.ui.sample_data import picture
from tests.ui.shell_parts import PANELS

pytest_plugins = ["tests.ui.shell_fixtures"]

CAMERA, OTHER, STATE = "/Pepper/camera", "/webcam", "/Pepper/state"


def graph() -> GraphView:
    sender = (PublisherInfo(1, "n1", (), False, 1, 1, 1, 1, 15.0, 1.0),)
    names = {CAMERA: "image", OTHER: "image", "/words": "json"}
    topics = {name: TopicInfo(name, codec, codec, sender) for name, codec in names.items()}
    return GraphView(1, 1, {"n1": NodeInfo("n1", "Pepper", "there", 5, "python", "native", 0)}, topics)


class Case:
    """Window with the real panels on a session without a master, with a fake or the real clock."""

    def __init__(self, home: Path, theme: Theme, *, own_clock: bool = True) -> None:
        self.now = 100.0
        self.session = Session(
            Settings(home),
            address="127.0.0.1:1",
            source=Network,
            journal_folder=home / "journal",
            start_processes=False,
        )
        assert isinstance(self.session.live.source, Network)
        self.source = self.session.live.source
        self.session.fleet.connect(
            parse(thing_description(simulated.ROBOT.thing_model, "Pepper")), "/Pepper/description"
        )
        self.source.tell(graph())
        panels = {**PanelRegistry(), "behaviour": PANELS["behaviour"]}
        clock = {"clock": lambda: self.now} if own_clock else {}
        self.window = MainWindow(self.session, theme, panels, **clock)

    def tick(self, seconds: float = 0.0) -> None:
        self.now += seconds
        self.window.tick()

    def hide_for_long(self) -> None:
        """Advance the clock until the watches of hidden panels have ended."""
        self.tick()
        self.tick(SUSPEND_DELAY_S)

    def dock(self, name: str) -> Dock:
        bench = self.window.bench
        assert bench is not None
        dock = bench.open(name)
        assert dock is not None
        return dock

    def arrive(self, topic: str, data: bytes, codec: str = "json") -> None:
        self.source.send(Message(topic, data, codec, codec))


@pytest.fixture
def case(qtbot, theme: Theme, home: Path) -> Iterator[Case]:
    made = Case(home, theme)
    qtbot.addWidget(made.window)
    theme.apply()
    made.window.resize(1440, 900)
    made.window.show()
    qtbot.waitUntil(lambda: is_on_screen(made.window))
    yield made
    made.window.close()


def settle(qtbot, case: Case, dock: Dock) -> None:
    qtbot.waitUntil(dock.is_displayed)
    case.tick()


def test_closed_panel_watches_no_topics_and_resumes_when_reopened(qtbot, case: Case) -> None:
    case.window.show_layout("behaviour")
    camera = case.dock("camera")
    settle(qtbot, case, camera)
    assert {CAMERA, STATE} <= case.source.wanted
    camera.close()
    case.tick()
    case.tick(SUSPEND_DELAY_S - 0.1)
    assert CAMERA in case.source.wanted, "a panel that is hidden for a moment stays subscribed"
    case.tick(0.1)
    assert CAMERA not in case.source.wanted
    assert STATE in case.source.wanted, "the robot that is drawn is still seen"
    before = case.source.asked.count(CAMERA)
    settle(qtbot, case, case.dock("camera"))
    assert CAMERA in case.source.wanted
    assert case.source.asked.count(CAMERA) == before + 1


@pytest.mark.parametrize("how", ["closed", "behind a tab", "in the other layout", "minimised"])
def test_hidden_panel_ends_its_watches_with_the_real_clock(qtbot, theme: Theme, home: Path, how: str) -> None:
    case = Case(home, theme, own_clock=False)
    qtbot.addWidget(case.window)
    case.window.show()
    case.window.show_layout("developer")
    image = case.dock("image")
    image.panel.show_topic(OTHER)
    qtbot.waitUntil(lambda: image.panel.isVisible() and OTHER in case.source.wanted)
    if how == "closed":
        image.close()
    elif how == "behind a tab":
        case.dock("camera")
    elif how == "in the other layout":
        case.window.show_layout("behaviour")
    else:
        case.window.showMinimized()

    def is_let_go() -> bool:
        case.window.tick()
        return OTHER not in case.source.wanted

    qtbot.waitUntil(is_let_go, timeout=30_000)
    case.window.close()


def test_panel_behind_another_tab_watches_no_topics(qtbot, case: Case) -> None:
    case.window.show_layout("developer")
    image, inspector = case.dock("image"), case.dock("inspector")
    image.panel.show_topic(OTHER)
    settle(qtbot, case, image)
    assert case.source.wanted >= {OTHER}
    camera = case.dock("camera")  # a tab in the same dock area as the image panel
    qtbot.waitUntil(lambda: camera.is_displayed() and not image.is_displayed())
    case.hide_for_long()
    assert OTHER not in case.source.wanted
    assert CAMERA in case.source.wanted
    image.raise_()
    settle(qtbot, case, image)
    assert OTHER in case.source.wanted
    assert inspector.is_displayed()


def test_quick_tab_switch_does_not_resubscribe(qtbot, case: Case) -> None:
    case.window.show_layout("developer")
    image = case.dock("image")
    image.panel.show_topic(OTHER)
    settle(qtbot, case, image)
    camera = case.dock("camera")
    settle(qtbot, case, camera)
    asked = len(case.source.asked)
    for _ in range(5):
        for dock in (image, camera):
            dock.raise_()
            settle(qtbot, case, dock)
            case.tick(SUSPEND_DELAY_S / 3)
    assert len(case.source.asked) == asked


def test_hidden_layout_and_its_floating_panels_watch_no_topics(qtbot, case: Case) -> None:
    case.window.show_layout("developer")
    image = case.dock("image")
    image.panel.show_topic(OTHER)
    image.setFloating(True)
    settle(qtbot, case, image)
    case.window.show_start()
    qtbot.waitUntil(lambda: not image.isVisible())
    case.hide_for_long()
    assert OTHER not in case.source.wanted
    case.window.show_layout("developer")
    settle(qtbot, case, image)
    assert OTHER in case.source.wanted


def test_panels_of_a_minimised_window_watch_no_topics_and_its_timer_slows_down(qtbot, case: Case) -> None:
    case.window.show_layout("behaviour")
    camera = case.dock("camera")
    settle(qtbot, case, camera)
    assert case.window.timer.interval() == TICK_MS // 2
    with_panels = set(case.source.wanted)
    case.window.showMinimized()
    qtbot.waitUntil(lambda: not camera.is_displayed())
    case.hide_for_long()
    assert case.source.wanted == {"/Pepper/answer"}, "answers of robots do not depend on what is seen"
    assert case.window.timer.interval() == TICK_MS
    before = case.window._ticks
    case.window.timer.timeout.emit()
    case.window.timer.timeout.emit()
    assert case.window._ticks == before + 2, "the session goes on at its pace"
    case.window.showNormal()
    settle(qtbot, case, camera)
    assert case.source.wanted == with_panels
    assert case.window.timer.interval() == TICK_MS // 2


def test_frozen_image_and_message_are_kept_while_hidden(qtbot, case: Case) -> None:
    case.window.show_layout("developer")
    image, inspector = case.dock("image").panel, case.dock("inspector").panel
    assert isinstance(image, ImagePanel)
    assert isinstance(inspector, InspectorPanel)
    image.show_topic(OTHER)
    inspector.show_topic("/words")
    settle(qtbot, case, case.dock("image"))
    case.arrive("/words", b'{"a": 1}')
    case.tick()
    inspector.freeze.setChecked(True)
    image.freeze.setChecked(True)
    stream = image._stream
    case.window.showMinimized()
    qtbot.waitUntil(lambda: not case.window.isActiveWindow() or case.window.isMinimized())
    case.hide_for_long()
    assert not case.source.wanted & {OTHER, "/words"}
    case.window.showNormal()
    settle(qtbot, case, case.dock("image"))
    assert case.source.wanted >= {OTHER, "/words"}
    assert (image._stream, image.freeze.isChecked()) == (stream, True)
    assert inspector.is_frozen
    assert inspector.model.value() == {"a": 1}


def test_problems_are_reported_while_their_panel_is_hidden(qtbot, case: Case) -> None:
    case.window.show_layout("developer")
    inspector = case.dock("inspector")
    inspector.panel.show_topic("/words")
    settle(qtbot, case, inspector)
    case.arrive("/words", b"{no json")
    case.tick()
    assert case.session.alerts.has("message:/words")
    inspector.close()
    case.hide_for_long()
    assert "/words" not in case.source.wanted
    assert case.session.alerts.has("message:/words")
    inspector.panel.show_topic(OTHER)
    assert not case.session.alerts.has("message:/words"), "nobody wants to know any more"


def test_unwatched_robot_is_not_stale_when_its_panel_is_shown_again(qtbot, case: Case) -> None:
    case.window.show_layout("behaviour")
    dock = case.dock("robot")
    settle(qtbot, case, dock)
    panel = dock.panel
    assert isinstance(panel, RobotPanel)
    case.arrive(STATE, b'{"x": 1}')
    case.tick()
    dock.close()
    case.hide_for_long()
    panel._last_drawing_s -= 60
    settle(qtbot, case, case.dock("robot"))
    assert not panel.view.is_stale


def test_robot_values_from_before_hiding_are_unknown_when_shown_again(qtbot, case: Case) -> None:
    case.window.show_layout("behaviour")
    sensors, health, robot = (case.dock(name) for name in ("sensors", "health", "robot"))
    case.dock("camera")
    settle(qtbot, case, sensors)
    case.arrive("/Pepper/battery", b'{"value": 84}')
    case.tick()
    link = case.session.fleet.link("Pepper")
    assert link is not None
    assert link.values["battery"] == 84
    for dock in (sensors, health, robot):
        dock.close()
    case.hide_for_long()
    assert link.values["battery"] == 84, "the camera looks at the robot, too"
    case.dock("camera").close()
    case.hide_for_long()
    assert "battery" not in link.values


def test_failed_panel_watches_no_topics_until_retried(qtbot, case: Case) -> None:
    case.window.show_layout("behaviour")
    camera = case.dock("camera")
    settle(qtbot, case, camera)
    assert isinstance(camera.panel, CameraPanel)
    assert case.source.wanted >= {CAMERA}
    view, camera.panel.view = camera.panel.view, None  # type: ignore[assignment]  # whatever makes it raise
    case.tick()
    assert camera.has_failed
    assert CAMERA not in case.source.wanted
    camera.panel.view = view
    camera.retry()
    case.tick()
    assert not camera.has_failed
    assert CAMERA in case.source.wanted


def test_hiding_all_panels_ends_every_watch_except_robot_replies(case: Case) -> None:
    assert isinstance(case.window, QMainWindow)
    for layout in ("behaviour", "developer"):
        case.window.show_layout(layout)
        for name in case.window.panels:
            if name != "behaviour":
                case.dock(name).panel.refresh()
    case.window.show_start()
    case.hide_for_long()
    assert case.source.wanted == {"/Pepper/answer"}


class Paints(QObject):
    """Event filter that records the class names of painted widgets."""

    def __init__(self) -> None:
        super().__init__()
        self.of: list[str] = []

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Paint:
            self.of.append(type(watched).__name__)
        return False


@pytest.mark.parametrize("layout", ["behaviour", "developer"])
def test_ticks_without_changes_repaint_only_the_status_bar(qtbot, case: Case, layout: str) -> None:
    bench = case.window.show_layout(layout)
    for name in ("health", "robots", "alerts", "console"):
        bench.open(name)
    bench.focus_panel(bench.docks["health"])  # no blinking cursor as in a text field
    case.tick()
    case.arrive("/Pepper/battery", b'{"value": 84}')
    settle(qtbot, case, bench.docks["health"])
    for _ in range(40):  # until rarely updated figures are up to date
        case.tick()
        QApplication.processEvents()
    paints = Paints()
    application = QApplication.instance()
    assert application is not None
    application.installEventFilter(paints)
    for _ in range(60):
        case.tick()
        QApplication.processEvents()
    application.removeEventFilter(paints)
    told = {"MainWindow", "QWidget", "StatusBar", "StatusItem"}  # the duration of a tick changes
    assert set(paints.of) <= told


def test_unchanged_camera_image_is_not_repainted(qtbot, case: Case, monkeypatch) -> None:
    for module in ("app.ui.pictures.view", "app.ui.panels.robots.camera"):
        monkeypatch.setattr(f"{module}.STALE_AFTER_S", 1e9)  # independent of the load of the computer
    bench = case.window.show_layout("behaviour")
    camera = bench.docks["camera"]
    settle(qtbot, case, camera)
    panel = camera.panel
    assert isinstance(panel, CameraPanel)
    shown = picture(32, 24).message
    assert shown is not None

    def sees(brightness: int) -> None:
        last = panel.view.picture
        data = bytes([brightness]) * len(shown.data)
        stamp_ns = time.time_ns()
        case.source.send(
            Message(CAMERA, data, "image", "image", stamp_ns=stamp_ns, extension=shown.extension)
        )
        qtbot.waitUntil(lambda: case.tick() or panel.view.picture is not last)
        QApplication.processEvents()

    for _ in range(10):
        sees(90)
    paints = Paints()
    panel.view.installEventFilter(paints)
    for _ in range(10):
        sees(90)
    assert paints.of == []
    sees(91)
    assert paints.of == ["PictureView"]
