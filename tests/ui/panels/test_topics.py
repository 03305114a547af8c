from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QSignalSpy, QTest

from app.core.network.master import MasterState
from app.ui.intents import NewAlarm, PublishMessage, RecordTopic
from app.ui.panels.watch.topics.columns import (
    age_cell,
    bandwidth_cell,
    curve_cell,
    loss_cell,
    name_cell,
    nodes_cell,
    type_cell,
)
from app.ui.panels.watch.topics.panel import PANEL, TopicsPanel
from app.ui.widgets import Button
from app.ui.widgets.table.model import CELL_ROLE
from nep.programs.alarms import AlarmCondition
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, press, ticks
from tests.ui.sample_data import Topic


@pytest.fixture
def window(qapp) -> Window:
    return Window(Session.full())


@pytest.fixture
def panel(qtbot, window) -> TopicsPanel:
    made = window.make(PANEL)
    qtbot.addWidget(made)
    for widget in made.header:
        qtbot.addWidget(widget)
    assert isinstance(made, TopicsPanel)
    return made


FIGURES = ("topic", "type", "publishers", "rate", "bandwidth", "age", "loss")


def place_of(panel: TopicsPanel, column: str) -> int:
    return [each.name for each in panel.table.columns].index(column)


def row(panel: TopicsPanel, name: str, columns: tuple[str, ...] = FIGURES) -> list[str]:
    place = panel.model.index_of(name).row()
    return [panel.model.data(panel.model.index(place, place_of(panel, column))) for column in columns]  # type: ignore[misc]


def test_every_topic_is_listed_with_its_stats(panel) -> None:
    assert panel.model.rowCount() == 13
    assert row(panel, "/robot/depth") == ["/robot/depth", "image", "1", "60.0", "5.1 MB/s", "21 ms", "0.4 %"]
    assert row(panel, "/speech/words")[:5] == ["/speech/words", "string", "2", "0.2", "14 B/s"]
    assert row(panel, "/lidar/scan") == ["/lidar/scan", "bytes", "0", "", "", "gone for 4 s", ""]
    assert panel.count_label.text() == "13 topics, 7 nodes"


def test_topics_panel_subscribes_to_no_topics(panel, window) -> None:
    ticks(window, panel, 10)
    assert window.session.watched == []


def test_unknown_stats_are_blank(panel, window) -> None:
    window.session.put(Topic("/x", rate_hz=None, lost=None))
    panel.refresh()
    assert row(panel, "/x") == ["/x", "json", "1", "", "", "", ""]


def test_new_topics_are_bold_until_selected(panel, window) -> None:
    index = panel.model.index_of("/speech/words")
    cell = panel.model.data(index, CELL_ROLE)
    assert (cell.bold, cell.chip) == (True, "new")
    panel.table.opened.emit("/speech/words")
    panel.refresh()
    cell = panel.model.data(panel.model.index_of("/speech/words"), CELL_ROLE)
    assert (cell.bold, cell.chip) == (False, None)
    assert window.opened == ["/speech/words"]


def test_topics_of_robots_started_by_studio_are_not_marked_as_new(panel, window) -> None:
    window.session.launcher.restart_virtual_robot("Pepper")
    topics = [
        Topic("/Pepper/pose", is_new=True, publisher_nodes=("Pepper",)),
        Topic("/Pepper/command", is_new=True, publisher_nodes=("Pepper", "studio")),
        Topic("/Pepper/world", is_new=True, publisher_nodes=()),
        Topic("/Turtle/pose", is_new=True, publisher_nodes=("Turtle",)),
        Topic("/nobody", is_new=True, publisher_nodes=()),
    ]
    for topic in topics:
        window.session.put(topic)
    panel.refresh()
    cells = [panel.model.data(panel.model.index_of(topic.name), CELL_ROLE) for topic in topics]
    assert [cell.chip for cell in cells] == [None, None, None, "new", "new"]


def test_type_is_shortened_to_its_last_part_and_has_an_icon_without_a_publisher() -> None:
    cell = type_cell(Topic("/a", "robot/answer", "json"))
    assert (cell.text, cell.icon) == ("answer", "braces")
    assert type_cell(Topic("/a", "json", "")).icon == "braces"
    assert type_cell(Topic("/a", "own/kind", "")).icon == "box"


def test_removed_topics_are_struck_through_and_show_the_time_since_removal() -> None:
    gone = Topic("/x", gone_s=4.7, is_new=True)
    assert name_cell(gone).is_struck_out
    assert name_cell(gone).chip is None
    assert age_cell(gone).text == "gone for 4 s"
    assert loss_cell(gone).text == ""
    assert loss_cell(Topic("/y", lost=3, loss_ratio=None)).text == "3"


def test_slash_focuses_the_filter_which_finds_names_types_and_nodes(qtbot, panel, window) -> None:
    panel.filter.show()
    QTest.keyClicks(panel.table, "/")
    panel.filter.setText("IMAGE depth")
    assert panel.model.rowCount() == 1
    assert panel.count_label.text() == "1 of 13 topics, 7 nodes"
    panel.filter.setText("pepper_driver")
    assert panel.model.rowCount() == 7
    panel.filter.setText("nothing like this")
    assert panel.model.rowCount() == 0
    press(button(panel.empty, "Clear the filter"))
    assert panel.model.rowCount() == 13


def test_sorting_keeps_the_selection_and_changing_values_are_sorted_once_per_second(panel, window) -> None:
    panel.show_topic("/odom")
    panel.table.horizontalHeader().sectionClicked.emit(place_of(panel, "rate"))  # descending
    assert panel.model.data(panel.model.index(0, 0)) == "/robot/depth"
    assert panel.table.selected_key() == "/odom"
    moved = QSignalSpy(panel.model.layoutChanged)
    window.session.shown.topics["/touch"].rate_hz = 500.0
    ticks(window, panel, 28)
    assert moved.count() == 0
    ticks(window, panel, 1)
    assert moved.count() == 1
    assert panel.model.data(panel.model.index(0, 0)) == "/touch"


def test_ten_thousand_topics_emit_one_signal_for_visible_rows_every_sixth_tick(qtbot, qapp) -> None:
    window = Window(Session())
    for number in range(10_000):
        window.session.put(Topic(f"/t{number:05}", rate_hz=10.0, age_s=0.1))
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert isinstance(panel, TopicsPanel)
    told, moved = QSignalSpy(panel.model.dataChanged), QSignalSpy(panel.model.layoutChanged)
    inserted = QSignalSpy(panel.model.rowsInserted)
    ticks(window, panel, 30)
    assert told.count() == 5
    assert moved.count() == inserted.count() == 0
    rows = {(told.at(place)[0].row(), told.at(place)[1].row()) for place in range(5)}
    assert len(rows) == 1
    first, last = rows.pop()
    assert last - first < 30


def test_enter_opens_a_topic_and_arrow_keys_move(panel, window) -> None:
    panel.table.setFocus(Qt.FocusReason.TabFocusReason)
    panel.table.select_key("/joint_states")
    QTest.keyClick(panel.table, Qt.Key.Key_Down)
    QTest.keyClick(panel.table, Qt.Key.Key_Return)
    assert window.opened == ["/lidar/scan"]  # the next one in the default order, by name


@pytest.mark.parametrize(
    ("kind", "words", "pressed", "masters", "commands"),
    [
        ("none", "No master is running", "Start a master here", 1, []),
        ("connected", "No topics yet", "Use the virtual robot", 0, ["robots.virtual"]),
        ("searching", "Searching for a master", None, 0, []),
    ],
)
def test_empty_panel_suggests_next_steps(qtbot, qapp, kind, words, pressed, masters, commands) -> None:
    window = Window(Session())
    window.session.live.master = MasterState(kind, window.session.live.master.address)
    panel = window.make(PANEL)
    qtbot.addWidget(panel)
    assert isinstance(panel, TopicsPanel)
    assert panel.empty.isVisible()
    assert panel.empty._title.text() == words
    if pressed is not None:
        press(button(panel.empty, pressed))
    assert window.session.launcher.masters_asked_for == masters
    assert window.commands == commands


def test_sort_order_is_restored_with_the_layout(qtbot, panel, window) -> None:
    panel.table.horizontalHeader().sectionClicked.emit(place_of(panel, "age"))
    again = window.make(PANEL)
    qtbot.addWidget(again)
    again.restore_state(panel.save_state())
    assert isinstance(again, TopicsPanel)
    assert again.table.order.column is panel.table.order.column
    again.restore_state({"sort": "nonsense"})
    assert again.table.order.column is again.table.columns[0]


def test_sparkline_of_recent_rates_is_shown_before_the_rate(panel, window) -> None:
    topic = window.session.shown.topics["/odom"]
    topic.rates.clear()
    topic.rates.extend([49.0, 50.0, 51.0])
    cell = panel.model.data(
        panel.model.index(panel.model.index_of("/odom").row(), place_of(panel, "curve")), CELL_ROLE
    )
    assert cell.curve == (49.0, 50.0, 51.0)
    assert panel.table.columns[place_of(panel, "curve")].tip(topic) == "Recent rate: 49.0 to 51.0 /s"
    assert place_of(panel, "curve") + 1 == place_of(panel, "rate")
    assert curve_cell(Topic("/silent")).curve == ()


def test_columns_are_selected_in_a_menu_and_restored_with_the_layout(qtbot, panel, window) -> None:
    assert panel.table.isColumnHidden(place_of(panel, "subscribers"))
    columns, _others = panel.more_actions()
    menu = columns.menu()
    by_words = {action.text(): action for action in menu.actions()}
    assert "Topic" not in by_words  # the topic column can't be hidden
    assert [words for words, action in by_words.items() if action.isChecked()] == [
        "Type", "Publishers", "Rate over time", "Rate /s", "Bandwidth", "Age", "Loss",
    ]  # fmt: skip
    by_words["Subscribers"].trigger()
    by_words["Bandwidth"].trigger()
    assert not panel.table.isColumnHidden(place_of(panel, "subscribers"))
    assert panel.table.isColumnHidden(place_of(panel, "bandwidth"))
    again = window.make(PANEL)
    qtbot.addWidget(again)
    again.restore_state(panel.save_state())
    assert isinstance(again, TopicsPanel)
    assert not again.table.isColumnHidden(place_of(panel, "subscribers"))
    assert again.table.isColumnHidden(place_of(panel, "bandwidth"))
    columns, _others = again.more_actions()
    next(action for action in columns.menu().actions() if action.text() == "Default columns").trigger()
    assert again.table.isColumnHidden(place_of(panel, "subscribers"))
    assert again.save_state()["columns"] == {}


def test_publisher_cell_lists_the_nodes_of_a_topic() -> None:
    topic = Topic("/x", publisher_nodes=("camera", "lidar"), subscribers=2)
    assert nodes_cell(topic).text == "camera, lidar"


def test_tooltips_report_the_number_of_shown_messages(panel, window) -> None:
    rate, loss = (panel.table.columns[place_of(panel, name)] for name in ("rate", "loss"))
    topic = window.session.shown.topics["/odom"]
    assert rate.tip(topic) == "Messages per second, as reported by the publishers"
    topic.received, topic.dropped, topic.missed = 1200, 970, 3800
    assert rate.tip(topic) == "230 of 5\u2009000 messages shown"
    assert loss.tip(topic) == "0 messages lost. 230 of 5\u2009000 messages shown"


def test_empty_panel_links_to_the_connection_doctor(qtbot, panel, window) -> None:
    assert panel.doctor.isHidden()
    panel.filter.setText("nothing like this")
    assert panel.doctor.isHidden()  # empty because of the filter
    empty = Window(Session())
    bare = empty.make(PANEL)
    qtbot.addWidget(bare)
    assert isinstance(bare, TopicsPanel)
    assert bare.doctor.isVisible()
    press(bare.doctor.button)
    assert empty.asked_why == [(bare, "")]


def test_filter_for_a_missing_topic_links_to_the_connection_doctor(panel, window) -> None:
    panel.filter.setText("no topic")
    assert [each.accessibleName() for each in panel.empty.findChildren(Button)] == ["Clear the filter"]
    panel.filter.setText("/robot/deph")
    press(button(panel, "Why is nothing shown?"))
    assert window.asked_why == [(panel, "/robot/deph")]
    (hidden,) = panel.blockers()
    assert hidden.message == "Topics only shows entries with “/robot/deph”."
    hidden.run()
    assert (panel.filter.text(), list(panel.blockers())) == ("", [])


def test_requested_topic_is_selected_when_listed(panel, window) -> None:
    panel.show_topic("/odom")
    assert panel.table.currentIndex() == panel.model.index_of("/odom")
    panel.show_topic("/later")
    window.session.put(Topic("/later"))
    panel.refresh()
    assert panel.model.index_of("/later").isValid()
    assert panel.table.currentIndex() == panel.model.index_of("/later")
    assert window.opened == []


def test_topic_name_of_twenty_letters_fits_the_default_width(qtbot, panel) -> None:
    panel.resize(640, 400)
    needed = panel.theme.font("mono").pixelSize() * 0.6 * len("/Pepper/head_touched")
    qtbot.waitUntil(lambda: panel.table.columnWidth(place_of(panel, "topic")) >= needed)


def test_context_menu_of_a_topic_offers_all_its_commands(panel, window) -> None:
    menu = panel.menu_of("/blackboard")
    assert menu is not None
    for action in menu.actions():
        action.trigger()
    assert len({action.text() for action in menu.actions()}) == 7
    assert window.opened == ["/blackboard"]
    assert window.beside == ["/blackboard"]
    assert window.plotted == [("/blackboard", "")]
    condition = AlarmCondition("silent", "/blackboard", for_s=2.0)
    requested = [PublishMessage("/blackboard"), NewAlarm(condition), RecordTopic("/blackboard")]
    assert window.commands == requested
    assert QGuiApplication.clipboard().text() == "/blackboard"


def shown(panel: TopicsPanel) -> list[str]:
    rows = (panel.model.index(place, 0) for place in range(panel.model.rowCount()))
    return [panel.model.data(index, CELL_ROLE).text for index in rows]  # type: ignore[union-attr]


def as_tree(panel: TopicsPanel, window: Window) -> None:
    press(panel.tree_button)
    ticks(window, panel)


def test_tree_view_groups_topics_in_folders_with_summed_rates(panel, window) -> None:
    session = window.session
    session.put(Topic("/arm/left/speed", rate_hz=40.0, bandwidth_Bps=400.0, age_s=0.5, lost=0))
    session.put(Topic("/arm/right/speed", rate_hz=2.5, bandwidth_Bps=100.0, age_s=0.1, lost=3))
    panel.filter.setText("/arm/*")
    as_tree(panel, window)
    assert shown(panel) == ["arm/", "left/", "speed", "right/", "speed"]
    figures = ("topic", "type", "rate", "bandwidth", "age", "loss")
    assert row(panel, "/arm/*", figures) == ["arm/", "2 topics", "42.5", "500 B/s", "0.1 s", "3"]
    cell = panel.model.data(panel.model.index_of("/arm/left/speed"), CELL_ROLE)
    assert cell.indent > panel.model.data(panel.model.index_of("/arm/*"), CELL_ROLE).indent
    session.shown.topics["/arm/left/speed"].rate_hz = 50.0
    ticks(window, panel, 6)
    assert row(panel, "/arm/*", ("rate",)) == ["52.5"]
    assert panel.count_label.text() == "2 of 15 topics, 7 nodes"
    press(panel.tree_button)
    assert shown(panel) == ["/arm/left/speed", "/arm/right/speed"]


def test_folders_are_expanded_and_collapsed_by_keyboard_and_left_selects_the_parent(panel, window) -> None:
    as_tree(panel, window)
    whole = panel.model.rowCount()
    panel.table.setFocus(Qt.FocusReason.TabFocusReason)
    panel.table.select_key("/robot/depth")
    QTest.keyClick(panel.table, Qt.Key.Key_Left)
    assert panel.table.selected_key() == "/robot/*"
    QTest.keyClick(panel.table, Qt.Key.Key_Left)
    assert "depth" not in shown(panel)
    QTest.keyClick(panel.table, Qt.Key.Key_Right)
    assert panel.model.rowCount() == whole
    QTest.keyClick(panel.table, Qt.Key.Key_Return)
    assert panel.model.rowCount() < whole
    assert window.opened == []
    panel.show_topic("/robot/depth")  # the folder of a requested topic is expanded
    assert panel.table.selected_key() == "/robot/depth"
    QTest.keyClick(panel.table, Qt.Key.Key_Return)
    assert window.opened == ["/robot/depth"]


def test_filter_expands_folders_and_matches_types_and_patterns(panel, window) -> None:
    as_tree(panel, window)
    panel.table.opened.emit("/robot/*")
    assert "depth" not in shown(panel)
    panel.filter.setText("/robot/* image")
    found = [name for name in shown(panel) if not name.endswith("/")]
    assert "depth" in found
    assert {window.session.shown.topics[f"/robot/{name}"].msg_type for name in found} == {"image"}
    panel.filter.clear()
    assert "depth" not in shown(panel)


def test_collapsed_folder_with_new_topics_is_marked(panel, window) -> None:
    as_tree(panel, window)
    assert panel.model.data(panel.model.index_of("/speech/*"), CELL_ROLE).chip is None
    panel.table.opened.emit("/speech/*")
    assert panel.model.data(panel.model.index_of("/speech/*"), CELL_ROLE).chip == "new"


def test_tree_view_and_collapsed_folders_are_restored_with_the_layout(qtbot, panel, window) -> None:
    as_tree(panel, window)
    panel.table.opened.emit("/robot/*")
    again = window.make(PANEL)
    qtbot.addWidget(again)
    assert isinstance(again, TopicsPanel)
    again.restore_state(panel.save_state())
    assert shown(again) == shown(panel)
    again.restore_state({"tree": "yes", "closed": [7, None]})
    assert not again.tree_button.isChecked()


def test_folder_menu_expands_and_collapses_all_and_copies_its_pattern(panel, window) -> None:
    as_tree(panel, window)
    whole = shown(panel)
    by_words = {action.text(): action for action in panel.menu_of("/robot/*").actions()}
    by_words["Collapse all folders"].trigger()
    assert len(shown(panel)) < len(whole)
    by_words["Copy name"].trigger()
    assert QGuiApplication.clipboard().text() == "/robot/*"
    by_words["Expand all folders"].trigger()
    assert shown(panel) == whole


def test_bandwidth_of_a_topic_without_subscribers_is_unknown() -> None:
    unheard = Topic("/t", rate_hz=50.0, bandwidth_Bps=0.0)
    assert "0" not in bandwidth_cell(unheard).text
    assert "0" in bandwidth_cell(Topic("/t", rate_hz=50.0, bandwidth_Bps=0.0, subscribers=1)).text
