"""Script that renders each panel at its design size, light and dark, to images in a folder.

python -m tests.ui.show_panels DIR [panel ...]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QEventLoop, Qt, QTimer
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.ui.blockly.scheme import register_scheme
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.build import behaviour, problems
from app.ui.panels.record.recordings import panel as recordings
from app.ui.panels.robots import camera, health, robot, sensors
from app.ui.panels.robots.robots import panel as robots
from app.ui.panels.watch import alerts, doctor, plot
from app.ui.panels.watch.alarms import panel as alarms
from app.ui.panels.watch.console import panel as console
from app.ui.panels.watch.graph import panel as graph
from app.ui.panels.watch.image import panel as image
from app.ui.panels.watch.inspector import panel as inspector
from app.ui.panels.watch.nodes import panel as nodes
from app.ui.panels.watch.topics import panel as topics
from app.ui.shell.docking.dock import Dock
from app.ui.theme import fonts
from app.ui.theme.theme import Theme
from nep.programs.alarms import AlarmAction, AlarmCondition, AlarmRule
from tests.ui.fakes import Session
from tests.ui.sample_data import blackboard
from tests.ui.shell_parts import Answers

SIZES: dict[str, tuple[Panel, int, int, str]] = {
    "topics": (topics.PANEL, 640, 461, "compact"),
    "inspector": (inspector.PANEL, 330, 782, "compact"),
    "image": (image.PANEL, 220, 220, "compact"),
    "plot": (plot.PANEL, 760, 520, "compact"),
    "console": (console.PANEL, 446, 222, "compact"),
    "nodes": (nodes.PANEL, 446, 260, "compact"),
    "graph": (graph.PANEL, 1428, 780, "compact"),
    "alerts": (alerts.PANEL, 446, 222, "compact"),
    "alarms": (alarms.PANEL, 752, 700, "compact"),
    "doctor": (doctor.PANEL, 446, 400, "compact"),
    "robot": (robot.PANEL, 384, 327, "comfortable"),
    "camera": (camera.PANEL, 384, 275, "comfortable"),
    "sensors": (sensors.PANEL, 384, 250, "comfortable"),
    "health": (health.PANEL, 384, 240, "comfortable"),
    "problems": (problems.PANEL, 1032, 124, "comfortable"),
    "recordings": (recordings.PANEL, 760, 560, "compact"),
    "robots": (robots.PANEL, 1032, 818, "comfortable"),
    "behaviour": (behaviour.PANEL, 1032, 626, "comfortable"),
}


ALARMS = (
    AlarmRule(
        "off",
        AlarmCondition("loses", "/cmd_vel", limit=1.0, for_s=30.0),
        (
            AlarmAction("stop"),
            AlarmAction("call", "restart_lidar", {"now": True}),
            AlarmAction("run", "Rest"),
        ),
        is_enabled=False,
    ),
    AlarmRule("new", AlarmCondition("leaves", ""), (AlarmAction("banner"),)),
    AlarmRule(
        "battery",
        AlarmCondition("below", "/blackboard", "robots.Pepper.battery", 20),
        (AlarmAction("banner"), AlarmAction("console")),
    ),
    AlarmRule("silent", AlarmCondition("silent", "/robot/camera", for_s=2.0), (AlarmAction("keep"),)),
)
"""Alarms that are off, incomplete, active and normal; the last one is shown on top."""


def wait(milliseconds: int) -> None:
    """Run the Qt event loop for this many milliseconds."""
    loop = QEventLoop()
    QTimer.singleShot(milliseconds, loop.quit)
    loop.exec()


def show(name: str, session: Session, theme: Theme, folder: Path, suffix: str) -> None:
    """Render a panel in its dock to an image."""
    panel, width, height, density = SIZES[name]
    context = PanelContext(session, theme, lambda _name: None, lambda _words: None, str, Answers())  # type: ignore[arg-type]
    widget = panel.make(context)
    dock = Dock(theme, panel, widget, density)  # type: ignore[arg-type]
    dock.resize(width, height)
    dock.show()
    wait(10)  # until exposed: hidden panels aren't updated
    dock.is_front = True
    prepare(name, widget)
    for _ in range(8):
        session.tick()
        dock.refresh()
        wait(2500 if name == "behaviour" and _ == 2 else 10)
    dock.grab().save(str(folder / f"{name}-{suffix}.png"))
    widget.dispose()
    dock.close()
    dock.deleteLater()


@contextmanager
def shown_panel(
    qtbot: QtBot, theme: Theme, name: str, session: Session
) -> Iterator[tuple[Dock, PanelWidget]]:
    """Context manager of a panel in its dock, at its design size, after three ticks."""
    panel, width, height, density = SIZES[name]
    widget = panel.make(PanelContext(session, theme, str, str, str, Answers()))  # type: ignore[arg-type]
    dock = Dock(theme, panel, widget, density)  # type: ignore[arg-type]
    qtbot.addWidget(dock)
    dock.resize(width, height)
    with qtbot.waitExposed(dock):  # hidden panels aren't updated
        dock.show()
    dock.is_front = True
    qtbot.waitUntil(dock.is_displayed)
    if session.fleet.links:
        prepare(name, widget)
    for _ in range(3):
        session.tick()
        dock.refresh()
    yield dock, widget
    widget.dispose()
    dock.close()


def prepare(name: str, widget: PanelWidget) -> None:
    """Select in a panel what is selected in the design image."""
    if (
        name == "inspector"
        and isinstance(widget, inspector.InspectorPanel)
        and "/blackboard" in widget.session.shown.topics
    ):
        widget.show_topic("/blackboard")
        widget.session.send("/blackboard", blackboard())  # type: ignore[attr-defined]
        widget.refresh()
        widget.tree.setCurrentIndex(widget.model.index_of_path(("robots", "Pepper", "pose", "y")))
    if name == "nodes" and isinstance(widget, nodes.NodesPanel) and len(widget.session.shown.nodes):
        widget.refresh()
        widget.table.opened.emit(widget.model.key_of(widget.model.row_at(widget.model.index(1, 0))))  # type: ignore[arg-type]
        widget.table.setCurrentIndex(widget.model.index(5, 0))
    if name == "plot" and "/blackboard" in widget.session.shown.topics:
        for path in ("robots.Pepper.pose.x", "robots.Pepper.pose.y", "robots.Pepper.emotion"):
            widget.plot_field("/blackboard", path)  # type: ignore[attr-defined]
        widget.session.send("/blackboard", blackboard())  # type: ignore[attr-defined]
        widget.cursors.setChecked(True)  # type: ignore[attr-defined]
        widget.freeze.setChecked(True)  # type: ignore[attr-defined]
    if name == "topics" and isinstance(widget, topics.TopicsPanel):
        widget.refresh()
        widget.show_topic("/blackboard")
    if (
        name == "alarms"
        and isinstance(widget, alarms.AlarmsPanel)
        and "/blackboard" in widget.session.shown.topics
    ):
        for rule in ALARMS:
            widget.session.alarms.set_rule(rule)
        widget.session.send("/blackboard", {"robots": {"Pepper": {"battery": 12}}})  # type: ignore[attr-defined]


def main() -> int:
    """Render the panels named on the command line, or all except Behaviour."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    QCoreApplication.setAttribute(Qt.ApplicationAttribute.AA_ShareOpenGLContexts)
    register_scheme()
    application = QApplication(sys.argv[:1])
    fonts.load()
    theme = Theme("light")
    names = sys.argv[2:] or [name for name in SIZES if name != "behaviour"]
    for mode in ("light", "dark"):
        theme.set_mode(mode)  # type: ignore[arg-type]
        for name in names:
            show(name, Session.full(), theme, folder, mode)
            if mode == "light":
                show(name, Session(), theme, folder, "empty")
    del application
    return 0


if __name__ == "__main__":
    sys.exit(main())
