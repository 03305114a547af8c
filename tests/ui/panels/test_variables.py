"""Tests of the Variables panel: values during a run and the commands of a variable."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from app.blocks.model.program import Variable
from app.blocks.runtime.events import VariablesChanged
from app.blocks.runtime.variables import VariableValue, display_value
from app.intents import RenameVariable
from app.ui.intents import DeleteVariable, ToggleVariableWatch
from app.ui.panels.build.variables import PANEL, VariablesPanel, rows_of, value_cell
from app.ui.widgets.table.model import Order
from tests.blocks.samples import block, get, list_of, number, started, workspace, write
from tests.ui.fakes import Session
from tests.ui.panel_case import Window, button, ticks

SAVED = workspace(
    started(
        block("variables_set", VAR={"id": "score"}, VALUE=number(3)),
        block("variables_set", VAR={"id": "names"}, VALUE=list_of(number(1))),
        write(get("score")),
    ),
    variables=("score", "names", "later"),
)


@pytest.fixture
def window(qapp) -> Window:
    made = Window(Session.full())
    made.session.document.apply_edit(SAVED)
    return made


@pytest.fixture
def panel(qtbot, window) -> VariablesPanel:
    made = window.make(PANEL, (600, 300))
    qtbot.addWidget(made)
    for widget in made.header:
        qtbot.addWidget(widget)
    assert isinstance(made, VariablesPanel)
    return made


def shown(panel: VariablesPanel) -> list[tuple[str, str]]:
    model = panel.model
    return [(model.cell_at(row, 0).text, model.cell_at(row, 1).text) for row in range(model.rowCount())]


def tells(window: Window, panel: VariablesPanel, **values: object) -> None:
    """Let the running program report these values of its variables."""
    run = window.session.runs._runner
    assert run is not None
    told = tuple(display_value(id, value) for id, value in values.items())
    window.session.runs.on_runner_event(VariablesChanged(run=run.run, values=told))
    ticks(window, panel, 1)


def test_every_variable_of_the_behaviour_is_listed_before_the_run(panel, window) -> None:
    assert shown(panel) == [("score", ""), ("names", ""), ("later", "")]
    assert panel.status_label.text() == ""


def test_values_are_updated_and_marked_during_a_run_and_kept_afterwards(panel, window) -> None:
    now = [100.0]
    panel.clock = lambda: now[0]
    window.session.runs.run()
    tells(window, panel, score=3, names=["Ada", "Grace"], later=0)
    assert shown(panel) == [("score", "3"), ("names", "2 items: Ada, Grace"), ("later", "0")]
    assert panel.status_label.text() == "Live"
    now[0] += 1
    ticks(window, panel, 1)
    assert panel.model.cell_at(0, 1).tint == ""
    tells(window, panel, score=4)
    assert [panel.model.cell_at(row, 1).tint for row in range(3)] == ["changedTint", "", ""]
    window.session.runs.stop()
    ticks(window, panel, 2)
    assert shown(panel)[0] == ("score", "4")
    assert panel.status_label.text() == "Final values"
    window.session.runs.run()  # the last values stay until the robots have replied
    now[0] += 1
    ticks(window, panel, 2)
    assert panel.model.cell_at(0, 1).role == "textSecondary"


def test_list_variable_is_expanded_by_click_and_keyboard(panel, window) -> None:
    window.session.runs.run()
    tells(window, panel, names=["Ada", "Grace"])
    index = panel.model.index_of("names 0")
    QTest.mouseClick(
        panel.table.viewport(), Qt.MouseButton.LeftButton, pos=panel.table.visualRect(index).center()
    )
    assert shown(panel)[1:4] == [("names", "2 items"), ("1", "Ada"), ("2", "Grace")]
    QTest.keyClick(panel.table, Qt.Key.Key_Left)
    assert shown(panel) == [("score", ""), ("names", "2 items: Ada, Grace"), ("later", "")]
    QTest.keyClick(panel.table, Qt.Key.Key_Right)
    assert len(shown(panel)) == 5


def test_keys_and_menu_trigger_variable_commands(panel, window) -> None:
    panel.table.select_key("score 0")
    QTest.keyClick(panel.table, Qt.Key.Key_F2)
    QTest.keyClick(panel.table, Qt.Key.Key_Delete)
    menu = panel.menu_of("score 0")
    assert menu is not None
    enabled = {action.text(): action.isEnabled() for action in menu.actions()}
    assert enabled == {
        "Show next to the blocks": True,
        "Show where it is used": True,
        "Change the value": False,  # no program is running
        "Rename": True,
        "Delete": True,
    }
    menu.actions()[0].trigger()
    menu.deleteLater()
    assert window.commands[-3:] == [
        RenameVariable("score"),
        DeleteVariable("score"),
        ToggleVariableWatch("score"),
    ]


def test_panel_without_variables_explains_variables_and_offers_to_create_a_variable(panel, window) -> None:
    window.session.document.apply_edit(workspace(started()))
    ticks(window, panel, 1)
    assert panel.pages.currentWidget() is panel.empty
    button(panel.empty, "New variable").click()
    assert window.commands[-1] == "variable.new"


def test_variables_of_another_behaviour_show_no_values_of_the_run(panel, window) -> None:
    window.session.runs.run()
    tells(window, panel, score=3)
    window.session.documents.new()
    window.session.document.apply_edit(workspace(started(), variables=("score",)))
    ticks(window, panel, 1)
    assert shown(panel) == [("score", "")]


@pytest.mark.parametrize(
    ("value", "words"),
    [([], "empty"), (["x"], "1 item: x"), (None, "unknown"), ("", ""), (True, "yes"), ("a\nb", "a b")],
)
def test_variable_value_is_formatted_in_one_row(value: object, words: str) -> None:
    (row,) = rows_of([Variable("v", "v", "v")], {"v": display_value("v", value)}, (), Order())
    assert value_cell(row).text == words


def test_names_are_sorted_case_insensitively(panel) -> None:
    variables = [Variable(each, each, each) for each in ("b", "A", "c")]
    order = Order(panel.table.columns[0])
    assert [row.variable.name for row in rows_of(variables, {}, (), order)] == ["A", "b", "c"]
    assert VariableValue("v", "list", "", ("x",), 5).length == 5
