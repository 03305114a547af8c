from __future__ import annotations

import importlib
import time

import pytest
import shiboken6
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication

from app.core.network.master import MasterState
from app.core.reports.not_installed import MissingLibraries, alert_missing
from app.intents import AllowOtherComputers, Inspect
from app.ui.intents import OpenPanel, SelectService
from app.ui.panels.base import Blocker, PanelWidget, paused_blocker
from app.ui.panels.registry import PanelRegistry
from app.ui.panels.watch import console
from app.ui.panels.watch.doctor import PANEL, DoctorPanel
from app.ui.panels.watch.inspector.panel import PANEL as INSPECTOR
from app.ui.widgets import Button
from nep.programs.doctor import Finding
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, press, ticks
from tests.ui.sample_data import FOUND

FINE = Finding("master", "ok", "A master runs.")
ALSO_FINE = Finding("loopback", "ok", "Programs of this computer reach each other.")
FULL = Finding("disk", "error", "The disk is full.", "Make room.")


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> DoctorPanel:
    made = window.make(PANEL, (640, 480))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, DoctorPanel)
    return made


def test_doctor_runs_when_first_shown_and_lists_the_most_severe_finding_first(qtbot, window) -> None:
    *more_severe, reachable, files = FOUND
    window.session.doctor.found = (reachable, files, *reversed(more_severe))
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert window.session.doctor.looked == 1
    assert panel.shown_findings == list(FOUND)
    assert len(panel.rows) == len(FOUND)
    assert panel.rows[0].accessibleName().startswith("error: “python3 server.py” (process 77) uses port 7780")
    assert panel.chip.accessibleName() == "2"
    panel.refresh()
    assert window.session.doctor.looked == 1  # no new check without a change


def test_findings_are_shown_incrementally_during_a_check(qtbot, window) -> None:
    window.session.live.master = MasterState("none", "127.0.0.1:7780")
    doctor = window.session.doctor
    doctor.found = (FINE, ALSO_FINE, FULL)
    told = []

    def look() -> None:
        """Report two steps of a check as the checking thread does, and refresh the panel after each."""
        doctor.looked += 1
        doctor.is_running = True
        for done, found in enumerate(((FINE,), (FULL, FINE))):
            doctor._report_progress(found, done + 1, 4)
            panel.refresh()
            shown_ids = [each.id for each in panel.shown_findings]
            told.append((shown_ids, panel.progress_label.text(), panel.chip.accessibleName()))
        doctor._run_checks()
        doctor.is_running = False

    panel = PANEL.make(window.context())
    qtbot.addWidget(panel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    panel.resize(640, 480), panel.show()
    doctor.start = look
    panel._master = "none"
    look()
    assert told == [(["master"], "Checking: 1 of 4", ""), (["disk", "master"], "Checking: 2 of 4", "1")]
    panel.refresh()
    assert [each.id for each in panel.shown_findings] == ["disk", "master", "loopback"]
    assert panel.progress_label.text() == "3 checks done"
    told.clear()
    doctor.found = (FINE, ALSO_FINE)
    look()  # the previous findings stay until all checks are done
    panel.refresh()
    assert [shown for shown, _looked, _chip in told] == [["disk", "master", "loopback"]] * 2
    assert [looked for _shown, looked, _chip in told] == ["Checking: 1 of 4", "Checking: 2 of 4"]
    assert panel.progress_label.text() == "All 2 checks passed"
    assert panel.chip.accessibleName() == "no problems"


def test_panels_waiting_for_a_topic_are_listed_with_the_suggested_topic(
    qtbot, panel, window, monkeypatch
) -> None:
    now = [time.monotonic()]
    monkeypatch.setattr("app.ui.panels.watch.doctor.time.monotonic", lambda: now[0])
    near, far, silent = (window.make(INSPECTOR) for _ in range(3))
    for each in (near, far, silent):
        qtbot.addWidget(each)
    published = next(each.name for each in window.session.shown.topics if each.publisher_nodes)
    window.session.shown.topics[published].newest = None
    near.show_topic(f"{published}s"), far.show_topic("/zzzz/qqqqqqqqqq"), silent.show_topic(published)
    window.panels += [near, far, silent]
    panel.refresh()
    before = len(panel.rows)
    now[0] += 2.5
    panel.refresh()
    told = {row.accessibleName(): row.button for row in panel.rows}
    assert len(told) == before + 3
    (why,) = [told[each] for each in told if "/zzzz/qqqqqqqqqq, which has no publisher." in each]
    assert why.accessibleName() == "Why is nothing shown?"
    press(why)
    assert window.asked_why == [(far, "/zzzz/qqqqqqqqqq")]
    assert [each for each in told if f"is waiting for {published}; no message has arrived." in each]
    (use,) = [told[each] for each in told if f"is waiting for {published}s, which has no publisher." in each]
    assert use.accessibleName() == f"Use {published}"
    press(use)
    assert near.subtitle() == published
    window.panels.clear()
    panel.refresh()
    assert len(panel.rows) == before


def test_suggested_command_is_copied(qtbot, panel, window) -> None:
    row = panel.rows[0]
    assert row.button.accessibleName() == "Copy the command"
    qtbot.mouseClick(row.button, Qt.MouseButton.LeftButton)
    assert QGuiApplication.clipboard().text() == "nep master --port 7781"
    assert window.toasts == ["Copied “nep master --port 7781”"]
    assert not panel.rows[1].button.isVisible()


def test_doctor_starts_the_master_and_checks_again_when_the_master_runs(qtbot, panel, window) -> None:
    missing = Finding("master:none", "error", "No master runs.", "Start a master.", "nep master")
    window.session.doctor.found = (missing,)
    qtbot.mouseClick(panel.check_button, Qt.MouseButton.LeftButton)
    panel.refresh()
    (row,) = panel.rows
    assert row.button.accessibleName() == "Start the master"
    qtbot.mouseClick(row.button, Qt.MouseButton.LeftButton)
    assert window.session.launcher.masters_asked_for == 1
    window.session.doctor.found = (Finding("master", "ok", "A master runs."),)
    window.session.live.master = MasterState("searching", "127.0.0.1:7780")
    panel.refresh()
    assert [each.id for each in panel.shown_findings] == ["master"]
    assert panel.chip.accessibleName() == "no problems"


def test_report_is_copied_as_text(panel, window) -> None:
    (copy,) = panel.more_actions()
    copy.trigger()
    text = QGuiApplication.clipboard().text()
    assert text.startswith("x “python3 server.py” (process 77) uses port 7780")
    assert text.count("\n") >= len(FOUND)
    assert window.toasts == ["Copied the report"]


def test_check_button_is_disabled_and_findings_are_kept_during_a_check(panel, window) -> None:
    window.session.doctor.is_running = True
    panel.refresh()
    assert not panel.check_button.isEnabled()
    assert len(panel.rows) == len(FOUND)
    window.session.doctor.is_running = False
    panel.refresh()
    assert panel.check_button.isEnabled()


NEAR = Finding(
    "topic:near",
    "error",
    "/robot/deph has no publisher.",
    "Did you mean /robot/depth?",
    instead="/robot/depth",
)


class Asker(PanelWidget):
    """Panel without visible data that is paused and records the topics passed to `show_topic`."""

    def __init__(self, context) -> None:
        super().__init__(context, "Depth")
        self.paused = True
        self.asked: list[str] = []

    def show_topic(self, name: str) -> None:
        self.asked.append(name)

    def blockers(self) -> list[Blocker]:
        return [paused_blocker(self.title(), self.go_on)] if self.paused else []

    def go_on(self) -> None:
        self.paused = False


@pytest.fixture
def asker(qtbot, window) -> Asker:
    made = Asker(window.context())
    qtbot.addWidget(made)
    return made


def names(panel) -> list[str]:
    return [row.button.accessibleName() for row in panel.rows if row.button.isVisibleTo(row)]


def test_suggested_topic_name_is_applied_to_the_panel_that_opened_the_doctor(
    qtbot, panel, window, asker
) -> None:
    window.session.doctor.found = (NEAR,)
    window.session.doctor.expect_topic("/robot/deph")
    asker.paused = False
    panel.set_stalled_panel(asker)
    assert panel.topic_choice.value == "/robot/deph"
    assert panel.command_label.text() == "In a terminal: nep doctor /robot/deph"
    assert names(panel) == ["Use /robot/depth"]
    window.session.doctor.found = (Finding("topic", "ok", "Messages of /robot/depth come here."),)
    qtbot.mouseClick(panel.rows[0].button, Qt.MouseButton.LeftButton)
    panel.refresh()
    assert (asker.asked, window.session.doctor.expected_topic) == (["/robot/depth"], "/robot/depth")
    assert window.toasts == ["Opened /robot/depth. Checking again"]
    assert panel.chip.accessibleName() == "no problems"


def test_without_an_originating_panel_the_topic_opens_in_a_matching_panel(qtbot, panel, window) -> None:
    window.session.doctor.found = (NEAR,)
    window.session.doctor.expect_topic("/robot/deph")
    panel.refresh()
    qtbot.mouseClick(panel.rows[0].button, Qt.MouseButton.LeftButton)
    assert window.opened == ["/robot/depth"]


def test_paused_panel_is_the_first_finding_and_can_be_resumed(qtbot, panel, window, asker) -> None:
    window.session.doctor.found = (NEAR,)
    window.session.doctor.expect_topic("/robot/deph")
    panel.set_stalled_panel(asker)
    assert panel.rows[0].accessibleName().startswith("error: Depth is paused")
    assert names(panel) == ["Resume", "Use /robot/depth"]
    qtbot.mouseClick(panel.rows[0].button, Qt.MouseButton.LeftButton)
    assert not asker.paused
    assert window.toasts == ["Done. Checking again"]
    panel.refresh()
    assert names(panel) == ["Use /robot/depth"]


def test_doctor_does_not_query_a_closed_panel(qtbot, panel, window) -> None:
    asker = Asker(window.context())
    panel.set_stalled_panel(asker)
    assert "paused" in panel.rows[0].accessibleName()
    shiboken6.delete(asker)
    panel.refresh()
    assert "paused" not in panel.rows[0].accessibleName()


def test_open_recording_that_hides_the_live_topic_is_reported(qtbot, panel, window, tmp_path) -> None:
    window.session.open_recording(tmp_path / "none.mcap")
    try:
        panel.refresh()
        assert "recording" not in panel.rows[0].accessibleName()  # no panel expects a topic yet
        window.session.doctor.expect_topic("/robot/camera")
        panel.refresh()
        said = panel.rows[0].accessibleName()
        assert said.startswith("error: The open recording doesn't contain /robot/camera.")
        qtbot.mouseClick(panel.rows[0].button, Qt.MouseButton.LeftButton)
        assert window.commands == ["replay.live"]
    finally:
        window.session.return_to_live()
    panel.refresh()
    assert "recording" not in panel.rows[0].accessibleName()


@pytest.mark.parametrize(
    ("finding", "button", "command"),
    [
        (
            Finding("topic:closed", "info", "This computer only."),
            "Let other computers connect",
            AllowOtherComputers(),
        ),
        (Finding("topic:unreadable", "error", "No JSON."), "Show the bytes", Inspect("/x")),
        (Finding("topic:name", "error", "No name."), "Choose a topic", OpenPanel("topics")),
        (
            Finding("topic:silent:cam", "error", "Silent.", instead="restart"),
            "Call restart",
            SelectService("restart"),
        ),
        (Finding("topic:service", "error", "A service.", instead="/x"), "Call /x", SelectService("/x")),
    ],
)
def test_each_finding_has_one_button(qtbot, panel, window, finding, button, command) -> None:
    window.session.doctor.found = (finding,)
    window.session.doctor.expect_topic("/x")
    panel.refresh()
    assert names(panel) == [button]
    qtbot.mouseClick(panel.rows[0].button, Qt.MouseButton.LeftButton)
    assert window.commands == [command]


def test_missing_topic_is_entered_by_the_user(panel, window, asker) -> None:
    panel.set_stalled_panel(asker)
    panel.topic_choice.set_value("/odom")
    panel.topic_choice.activated.emit(panel.topic_choice.currentIndex())
    assert window.session.doctor.expected_topic == "/odom"
    assert "paused" not in panel.rows[0].accessibleName()
    panel.copy_button.click()
    assert QGuiApplication.clipboard().text().startswith("Missing: /odom\n")


def test_topic_of_an_unresponsive_network_is_reported(panel, window) -> None:
    network = window.session.shown.networks.get("ros2")
    network.state, network.sentence = "lost", "no daemon answers"
    window.session.doctor.expect_topic("ros2 /camera")
    panel.refresh()
    assert panel.rows[0].accessibleName().startswith("error: ROS 2: no daemon answers.")
    assert names(panel)[0] == "Other networks"
    assert panel.command_label.text() == "In a terminal: nep doctor"


def test_empty_panels_open_the_doctor_with_their_topic_if_they_have_one(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.live.master = MasterState("connected", "127.0.0.1:7780")
    for name in ("inspector", "image", "console", "services"):
        made = window.make(PanelRegistry()[name])
        qtbot.addWidget(made)
        made.show_topic("/nothing")
        ticks(window, made, 2)
        empty = made.body.empty if name == "inspector" else made.empty
        press(empty.findChildren(Button)[-1])  # earlier buttons may not be deleted yet
        wanted = "/nothing" if name in {"inspector", "image"} else ""
        assert window.asked_why.pop() == (made, wanted)
        made.dispose()


def test_paused_panels_are_reported_to_the_doctor(qtbot, window) -> None:
    for name in ("inspector", "image", "plot"):
        made = window.make(PanelRegistry()[name])
        qtbot.addWidget(made)
        assert list(made.blockers()) == []
        made.freeze.setChecked(True)
        (hindrance,) = made.blockers()
        assert "paused" in hindrance.message
        hindrance.run()
        assert not made.freeze.isChecked()
        made.dispose()


def test_console_filters_are_reported_to_the_doctor(qtbot, window) -> None:
    made = window.make(console.PANEL)
    qtbot.addWidget(made)
    assert list(made.blockers()) == []
    made.set_level("error")
    (hindrance,) = made.blockers()
    assert hindrance.message == "Console only shows entries with “Errors only”."
    hindrance.run()
    assert made.level == "all"


def test_empty_plot_opens_the_doctor(qtbot, window) -> None:
    made = window.make(importlib.import_module("app.ui.panels.watch.plot").PANEL, (900, 600))
    qtbot.addWidget(made)
    made._add_typed("/odom.speed", False)
    ticks(window, made, 6)
    assert made.advice.topic == "/odom"
    press(made.advice.doctor_link)
    assert window.asked_why == [(made, "/odom")]
    made.dispose()


def test_doctor_shows_an_empty_state_before_the_first_result(qtbot, qapp) -> None:
    window = Window(Session())
    window.session.doctor.start = lambda: None
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(panel, DoctorPanel)
    assert panel.empty.isVisible()


def test_missing_system_libraries_of_the_block_editor_are_a_finding(panel, window) -> None:
    alert_missing(window.session.alerts, MissingLibraries(("libnss3.so",), ("libnss3",)))
    panel.refresh()
    (found,) = [each for each in panel.shown_findings if "libnss3.so" in each.sentence]
    assert found.severity == "error"
    assert "sudo apt install libnss3" in found.fix
    assert not panel.rows[panel.shown_findings.index(found)].button.isVisibleTo(panel)
