"""Tests of the Recordings panel: list, renaming, deletion and export."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QFile, QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QMenu

from app.core.recording.client import RecorderState
from app.core.timeline.times import clock_text
from app.ui.intents import OpenRecording, RecordTopic
from app.ui.panels.record.recordings import PANEL
from app.ui.panels.record.recordings import panel as panel_module
from app.ui.panels.record.recordings.columns import badge_of
from app.ui.panels.record.recordings.panel import RecordingsPanel
from app.ui.panels.record.recordings.table import RecordingTable
from app.ui.panels.watch.alarms import panel as alarms
from app.ui.panels.watch.topics import panel as topics
from app.ui.text.numbers import group_digits, size_text
from app.ui.widgets import Button
from nep.programs.alarms.history import ActionResult, AlarmRecord
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.messages import TestClock, json_message, limits, picture, record
from tests.ui.fakes import Session
from tests.ui.panel_case import Window
from tests.ui.test_accessible import unsaid

pytestmark = pytest.mark.qt_log_ignore("does not support (grabbing the keyboard|raise)", extend=True)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of three recordings: JSON messages, images, and a truncated file."""
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    made = tmp_path / "Recordings"
    made.mkdir()
    with RecordingWriter(made / "arm.mcap", note="first try", clock=TestClock(), limits=limits()) as writer:
        writer.post([json_message(seq, topic="/odom") for seq in range(5)])
    record(made / "camera.mcap", [[picture(1)]])
    (made / "cut.mcap").write_bytes((made / "arm.mcap").read_bytes()[:-100])
    return made


@pytest.fixture
def window(qapp, folder) -> Window:
    return Window(Session())


@pytest.fixture
def panel(qtbot, window, folder) -> RecordingsPanel:
    made = window.make(PANEL, (760, 560))
    qtbot.addWidget(made)
    for widget in made.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(made, RecordingsPanel)
    yield made
    made.dispose()


def names(panel: RecordingsPanel) -> list[str]:
    rows = [panel.model.row_at(panel.model.index(row, 0)) for row in range(panel.model.rowCount())]
    return sorted(each.path.stem for each in rows if each is not None and each.is_read)


def seen(qtbot, panel: RecordingsPanel, *wanted: str) -> None:
    def there() -> bool:
        panel.refresh()
        return names(panel) == sorted(wanted)

    qtbot.waitUntil(there)


def choose(panel: RecordingsPanel, folder: Path, name: str) -> RecordingTable:
    table = panel.table
    assert isinstance(table, RecordingTable)
    table.select_key(str(folder / f"{name}.mcap"))
    table.setFocus()
    return table


def test_each_recording_is_listed_with_its_details_and_badges(qtbot, panel, window, folder):
    assert panel.empty.isVisible() or panel._has_scanned, "until the folder was looked at, it says so"
    seen(qtbot, panel, "arm", "camera", "cut")
    facts = {each.path.stem: each for each in panel._scan.files}
    assert [badge_of(facts[name], False) for name in ("arm", "cut")] == ["", "cut"]
    assert badge_of(facts["arm"], True) == "recording"
    assert panel.count_label.text().startswith("3 recordings, ")
    row = panel.model.index_of(str(folder / "arm.mcap"))
    cells = [panel.model.cell_at(row.row(), place) for place in range(panel.model.columnCount())]
    assert cells[0].accessible_text == "arm, first try"
    assert [cell.text for cell in cells[4:]] == ["5", "0"]
    qtbot.waitUntil(lambda: panel._collect_thumbnails() or bool(panel._pictures))
    choose(panel, folder, "arm")
    assert panel.details.counts_label.text() == "1 topic, 5 messages"
    assert not list(unsaid(panel))


def test_thumbnail_of_a_recording_with_images_is_shown(qtbot, panel, folder):
    seen(qtbot, panel, "arm", "camera", "cut")
    (facts,) = (each for each in panel._scan.files if each.path.stem == "camera")

    def is_drawn() -> bool:
        panel._collect_thumbnails()
        return panel._picture(facts) is not None

    qtbot.waitUntil(is_drawn)
    image = panel._picture(facts)
    assert image is not None
    assert (image.width(), image.height()) == (128, 96)


def test_click_selects_and_enter_opens_a_recording(qtbot, panel, window, folder):
    seen(qtbot, panel, "arm", "camera", "cut")
    table = choose(panel, folder, "arm")
    rect = table.visualRect(table.currentIndex())
    QTest.mouseClick(table.viewport(), Qt.MouseButton.LeftButton, pos=rect.center())
    assert window.commands == []
    QTest.keyClick(table, Qt.Key.Key_Return)
    assert window.commands == [OpenRecording(folder / "arm.mcap")]


def test_f2_renames_a_recording_in_place_and_overwrites_no_file(qtbot, panel, window, folder):
    (folder / "arm.mcap.bookmarks.json").write_text("[]")
    seen(qtbot, panel, "arm", "camera", "cut")
    table = choose(panel, folder, "arm")
    QTest.keyClick(table, Qt.Key.Key_F2)
    field = table.field
    assert field is not None
    field.setText("camera")
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert window.toasts == ["A recording named “camera” already exists"]
    field.setText("Arm: second/try")
    QTest.keyClick(field, Qt.Key.Key_Return)
    assert table.field is None
    assert sorted(each.name for each in folder.iterdir()) == [
        "Arm second try.mcap", "Arm second try.mcap.bookmarks.json", "camera.mcap", "cut.mcap",
    ]  # fmt: skip
    seen(qtbot, panel, "Arm second try", "camera", "cut")
    assert table.selected_key() == str(folder / "Arm second try.mcap")
    QTest.keyClick(table, Qt.Key.Key_F2)
    QTest.keyClick(table.field, Qt.Key.Key_Escape)
    assert table.field is None


def test_delete_moves_a_recording_to_the_trash_and_undo_restores_the_recording(
    qtbot, panel, window, folder, tmp_path, monkeypatch
):
    place = tmp_path / "bin"
    place.mkdir()

    class Bin(QFile):
        def moveToTrash(self) -> bool:
            there = place / Path(self.fileName()).name
            Path(self.fileName()).rename(there)
            self.setFileName(str(there))
            return True

    monkeypatch.setattr(panel_module, "QFile", Bin)
    seen(qtbot, panel, "arm", "camera", "cut")
    before = (folder / "arm.mcap").read_bytes()
    QTest.keyClick(choose(panel, folder, "arm"), Qt.Key.Key_Delete)
    assert (names(panel), window.toasts) == (["camera", "cut"], ["Moved “arm” to the bin"])
    (undo,) = (run for words, run in window.toast_buttons if words == "Undo")
    assert undo is not None
    undo()
    assert (folder / "arm.mcap").read_bytes() == before
    seen(qtbot, panel, "arm", "camera", "cut")


def test_active_recording_shows_its_stats_and_cannot_be_renamed_or_deleted(qtbot, panel, window, folder):
    client = window.session.recordings.client
    client.state = RecorderState(
        "recording", folder / "arm.mcap", message_count=77, size_bytes=10**9, duration_s=61.0, lost=3
    )
    client.revision += 1

    def is_shown() -> bool:
        panel.refresh()
        row = panel.model.index_of(str(folder / "arm.mcap"))
        return row.isValid() and panel.model.cell_at(row.row(), 4).text == "77"

    qtbot.waitUntil(is_shown)
    row = panel.model.index_of(str(folder / "arm.mcap")).row()
    assert [panel.model.cell_at(row, place).text for place in (2, 3, 5)] == ["1:01", "1.0 GB", "3"]
    table = choose(panel, folder, "arm")
    for key in (Qt.Key.Key_F2, Qt.Key.Key_Delete):
        QTest.keyClick(table, key)
    assert len(window.toasts) == 2
    assert (folder / "arm.mcap").exists()
    client.state = RecorderState()


def test_export_runs_in_the_background_and_reports_its_result(qtbot, panel, window, folder):
    seen(qtbot, panel, "arm", "camera", "cut")
    choose(panel, folder, "arm")
    panel.details.export_button.click()
    assert panel.details.export_button.text() == "Cancel"

    def is_over() -> bool:
        panel.refresh()
        return bool(window.toasts)

    qtbot.waitUntil(is_over)
    assert window.toasts == ["Exported 1 file"]
    assert [each.name for each in (folder / "arm, CSV").iterdir()] == ["odom.csv"]
    assert panel.details.export_button.text() == "Export"


def test_time_range_and_topics_to_export_are_selected_by_mouse_and_keyboard(
    qtbot, panel, window, folder, tmp_path
):
    messages = [json_message(seq, f"/{'ab'[seq % 2]}") for seq in range(1000)]  # 10 s
    record(folder / "long.mcap", [[*messages[:500], picture(1)], messages[500:]])
    seen(qtbot, panel, "arm", "camera", "cut", "long")
    choose(panel, folder, "long")
    strip, details = panel.details.strip, panel.details

    def is_there() -> bool:
        panel.refresh()
        return strip.preview is not None

    qtbot.waitUntil(is_there)
    assert details.part_label.text() == "3 of 3 topics"
    sizes = [sum(each.size_bytes for each in messages[first::2]) for first in range(2)]
    whole, shown = picture(1).size_bytes, size_text(sum(sizes))
    assert (
        details.size_label.text() == f"{group_digits(1000)} messages, about {shown}"
    )  # images can't be exported as a table
    details.format_choice.set_value("mcap")
    details.format_choice.changed.emit("mcap")
    size = size_text(sum(sizes) + whole)
    assert details.size_label.text() == f"{group_digits(1001)} messages, about {size}"
    details.format_choice.set_value("csv")
    details.format_choice.changed.emit("csv")
    qtbot.waitUntil(lambda: strip.height() == strip.sizeHint().height())
    painted = strip.grab().toImage()
    assert painted.pixelColor(painted.width() // 2, 30) != strip._theme.colour("sunken")
    assert strip._images.count(None) < len(strip._images)
    QTest.keyClick(strip.begin, Qt.Key.Key_Right)
    QTest.keyClick(strip.begin, Qt.Key.Key_Right)
    place = QPoint(round(strip._x_of(strip.preview.start_ns + 6 * 10**9)), 30)
    QTest.mouseClick(strip, Qt.MouseButton.LeftButton, pos=place)
    assert abs(strip.end_ns - strip.preview.start_ns - 6 * 10**9) < 10**8
    strip.set_part(strip.begin_ns, strip.preview.start_ns + 6 * 10**9)
    QTest.keyClicks(details.topics_field.edit, "/a ")
    assert details.part_label.text() == "0:02.0 to 0:06.0, 1 of 3 topics"
    assert details.size_label.text() == f"about 200 messages, {size_text(sizes[0] * 200 / 500)}"
    assert details.folder_label.text() == f"{folder.name}/long, 0.02.0 to 0.06.0, CSV"
    assert details.file_count_label.text() == "1 file"
    window.answers.path = tmp_path
    details.choose_button.click()
    assert details.folder_label.text() == f"{tmp_path.name}/long, 0.02.0 to 0.06.0, CSV"
    assert details.folder_label.toolTip() == str(tmp_path / "long, 0.02.0 to 0.06.0, CSV")
    details.export_button.click()

    def is_over() -> bool:
        panel.refresh()
        return bool(window.toasts)

    qtbot.waitUntil(is_over)
    (made,) = (tmp_path / "long, 0.02.0 to 0.06.0, CSV").iterdir()
    assert (made.name, len(made.read_text("utf-8").splitlines())) == ("a.csv", 1 + 200)
    QTest.keyClicks(details.topics_field.edit, "not /a ")
    assert details.part_label.text() == "No matching topics in this recording"
    window.toasts.clear()
    details.export_button.click()
    assert window.toasts == ["No matching topics in this recording"]
    details.topics_field.show_patterns((), ())
    details.topics_field.changed.emit()
    details.list_button.setChecked(True)  # the same with the list of topics
    assert [details.topic_list.model.key_of(topic) for topic in details.topic_list._matching_topics()] == [
        "/a",
        "/b",
        "/camera",
    ]
    model = details.topic_list.model
    rows = [model.index(row, 4).data() for row in range(model.rowCount())]
    assert rows == [size_text(each) for each in (*sizes, whole)]
    details.topic_list.table.opened.emit("/a")
    assert details.topics_field.patterns() == ((), ("/a",))
    assert details.part_label.text().endswith("2 of 3 topics")
    details.topic_list.filter.setText("b")
    details.topic_list.none_button.click()
    assert details.topics_field.patterns() == (("/camera",), ())
    assert details.part().topics == ["/camera"]
    assert details.size_label.text() == "None of the selected topics can be exported in this format"
    details.topic_list.filter.clear()
    details.topic_list.none_button.click()
    assert (details.part(), details.part_label.text()) == (None, "No matching topics in this recording")
    details.topic_list.all_button.click()
    assert details.part().topics is None
    details.topics_field.show_patterns(("/a",), ())
    details.topics_field.changed.emit()  # typed patterns are checked in the list
    assert details.topic_list._checked_names == {"/a"}
    details.time_mode.set_value("clock")
    details.time_mode.changed.emit("clock")
    begin, end = (clock_text(at_ns, digits=1) for at_ns in (strip.begin_ns, strip.end_ns))
    assert details.part_label.text() == f"{begin} to {end}, 1 of 3 topics"
    assert strip.begin.accessibleDescription() == begin
    QTest.keyClick(strip.end, Qt.Key.Key_Home)  # handles can't cross
    assert strip.begin_ns == strip.end_ns
    QTest.mouseDClick(strip.begin, Qt.MouseButton.LeftButton)
    assert strip.is_all_selected
    assert not list(unsaid(panel))


def test_filter_finds_notes_and_topics_ignoring_case(qtbot, panel):
    seen(qtbot, panel, "arm", "camera", "cut")
    panel.filter.setText("FIRST")
    assert "camera" not in names(panel)
    panel.filter.setText("/camera")
    assert names(panel) == ["camera"]
    panel.filter.setText("nowhere")
    assert panel.empty.isVisible()


def test_empty_folder_and_missing_folder_suggest_next_steps(qtbot, panel, window, folder, tmp_path):
    seen(qtbot, panel, "arm", "camera", "cut")
    window.session.recordings.set_folder(tmp_path / "stick")

    def says(words: str) -> bool:
        panel.refresh()
        return any(words in each.text() for each in panel.empty.findChildren(QLabel))

    qtbot.waitUntil(lambda: says("doesn't exist"))
    (tmp_path / "stick").mkdir()
    qtbot.waitUntil(lambda: says("No recordings yet"))
    panel.empty.findChildren(Button)[-1].click()  # nothing to record: opens the connection doctor
    assert window.asked_why == [(panel, "")]


def test_recording_saved_by_an_alarm_is_opened_from_its_history(qtbot, window, folder):
    panel = window.make(alarms.PANEL, (752, 600))
    qtbot.addWidget(panel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    assert isinstance(panel, alarms.AlarmsPanel)
    kept = ActionResult("keep", "kept alarm-2026-11-26-22-01-05.mcap")
    panel.alarms.history.add(AlarmRecord("r", "/camera is silent", panel.now_s(), action_results=[kept]))
    panel.refresh()
    index = panel.model.index(0, 0)
    panel.table.menu_requested.emit(
        panel.model.key_of(panel.model.row_at(index)), panel.table.mapToGlobal(QPoint())
    )
    menu = QApplication.activePopupWidget()
    assert isinstance(menu, QMenu)
    (action,) = (each for each in menu.actions() if each.text() == "Open the recording")
    menu.close()
    action.trigger()
    assert window.commands == [OpenRecording(folder / "alarm-2026-11-26-22-01-05.mcap")]
    panel.dispose()


def test_record_topic_in_the_topic_menu_runs_the_record_command(qtbot, folder):
    window = Window(Session.full())
    panel = window.make(topics.PANEL)
    qtbot.addWidget(panel)
    for widget in panel.header_widgets():
        qtbot.addWidget(widget)
    (run,) = (each.run for each in panel.row_actions("/odom") if each.text == "Record topic")
    run()
    assert window.commands == [RecordTopic("/odom")]
    panel.dispose()
