from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QLineEdit

from app.errors import InputProblem
from app.robots.description.inputs import Choice as Option
from app.robots.description.inputs import Parameter
from app.robots.description.model import Action
from app.ui.panels.robots.robots.controls.chooser import control_for
from app.ui.panels.robots.robots.controls.colour import ColourSwatches
from app.ui.panels.robots.robots.form import ActionForm
from app.ui.panels.robots.robots.input_text import input_summary
from app.ui.theme.theme import Theme
from app.ui.widgets import ComboBox, Segments, SliderWithUnit, Switch
from nep.i18n import _, translate
from tests.ui.sample_data import ACTIONS

FEW = (Option("en", "English"), Option("fr", "French"))
MANY = tuple(Option(number, f"number {number}") for number in range(6))


def action(*parameters: Parameter) -> Action:
    return Action("do", "do it", "bot", "Movement", parameters, "%robot do", None, "/c", "/a")


@pytest.fixture
def theme(qapp) -> Theme:
    return Theme("light")


@pytest.mark.parametrize(
    ("parameter", "kind", "start", "other"),
    [
        (Parameter("p", "p", "text", default="hi"), QLineEdit, "hi", "ho"),
        (Parameter("p", "p", "number", 0, 1, 0.05, "m", 0.5), SliderWithUnit, 0.5, 0.25),
        (Parameter("p", "p", "integer", 0, 100, 5, "%", 60), SliderWithUnit, 60, 20),
        (Parameter("p", "p", "angle", -180, 180, 5, "°", 30), SliderWithUnit, 30.0, -45.0),
        (Parameter("p", "p", "choice", choices=FEW, default="fr"), Segments, "fr", "en"),
        (Parameter("p", "p", "choice", choices=MANY, default=3), ComboBox, 3, 5),
        (Parameter("p", "p", "colour", default="#35c26b"), ColourSwatches, "#35c26b", "#b06bff"),
        (Parameter("p", "p", "boolean", default=True), Switch, True, False),
        (Parameter("p", "p", "list", default=["yes", "no"]), QLineEdit, ["yes", "no"], ["one"]),
    ],
    ids=lambda value: value.kind if isinstance(value, Parameter) else "",
)
def test_each_parameter_kind_has_its_control_and_value(qtbot, theme, parameter, kind, start, other) -> None:
    form = ActionForm(theme, action(parameter))
    qtbot.addWidget(form)
    control = form.controls["p"]
    assert isinstance(control.widget, kind) or control.widget.findChild(kind) is not None
    assert form.input() == {"p": start}
    assert type(form.input()["p"]) is type(start)
    form.set_input({"p": other})
    assert form.input() == {"p": other}
    assert form.action.check(form.input()) == ()


def test_empty_fields_are_omitted_and_entered_numbers_and_images_are_returned(qtbot, theme) -> None:
    form = ActionForm(
        theme,
        action(
            Parameter("n", "n", "integer", default=2),
            Parameter("x", "x", "number"),
            Parameter("i", "i", "image"),
        ),
    )
    qtbot.addWidget(form)
    assert form.input() == {"n": 2}  # empty fields are omitted
    form.set_input({"n": 7, "x": 1.5, "i": "file:///p.png"})
    assert form.input() == {"n": 7, "x": 1.5, "i": "file:///p.png"}


def test_invalid_number_is_kept_as_typed_and_reported_by_validation(qtbot, theme) -> None:
    form = ActionForm(theme, action(Parameter("n", "count", "integer", default=2)))
    qtbot.addWidget(form)
    field = form.findChild(QLineEdit)
    assert field is not None
    field.setText("two")
    assert form.input() == {"n": "two"}
    form.show_problems(form.action.problems(form.input()))
    assert field.property("wrong") == "true"
    assert field.text() == "two"
    QTest.keyClicks(field, "x")
    assert field.property("wrong") == "false"  # typing removes the error message


def test_choices_offered_by_the_robot_at_runtime_fill_the_list(qtbot, theme) -> None:
    parameter = Parameter("name", "animation", "text", options_from="animations")
    asked: list[str] = []

    def options(name: str) -> list[str]:
        asked.append(name)
        return ["hey", "bow", "nod", "clap", "wave"]

    form = ActionForm(theme, action(parameter), options)
    qtbot.addWidget(form)
    assert asked == ["animations"]
    assert isinstance(form.controls["name"].widget, ComboBox)
    assert form.input() == {"name": "hey"}
    assert isinstance(control_for(theme, parameter, []).widget, QLineEdit)


def test_problems_are_shown_below_their_rows_and_general_problems_at_the_end(qtbot, theme) -> None:
    form = ActionForm(
        theme,
        action(Parameter("t", "text", "text", is_required=True), Parameter("s", "speed", "number", 0, 1)),
    )
    qtbot.addWidget(form)
    form.show()
    form.show_problems((InputProblem("t", "text must not be empty"), InputProblem("", "Pepper has gone")))
    below = form._error_labels
    assert below["t"].text() == "Must not be empty." or below["t"].text() == "Text must not be empty."
    assert below["t"].isVisible()
    assert not below["s"].isVisible()
    assert form.problem.text() == "Pepper has gone."
    form.show_problems(())
    assert not below["t"].isVisible()
    assert not form.problem.isVisible()


def test_advanced_parameters_are_shown_by_the_more_button(qtbot, theme) -> None:
    form = ActionForm(
        theme, action(Parameter("a", "a", "text"), Parameter("b", "b", "text", default="x", is_advanced=True))
    )
    qtbot.addWidget(form)
    form.show()
    widget = form.controls["b"].widget
    assert form.controls["a"].widget.isVisible()
    assert not widget.isVisible()
    assert form.input()["b"] == "x"  # collapsed fields keep their values
    QTest.mouseClick(form.more, Qt.MouseButton.LeftButton)
    assert widget.isVisible()
    assert not ActionForm(theme, action(Parameter("a", "a", "text"))).more.isVisibleTo(form)


def test_every_control_has_an_accessible_name(qtbot, theme) -> None:
    for described in ACTIONS:
        form = ActionForm(theme, described)
        qtbot.addWidget(form)
        for parameter in described.parameters:
            widget = form.controls[parameter.name].widget
            names = {
                widget.accessibleName(),
                *(child.accessibleName() for child in widget.findChildren(QLineEdit)),
            }
            assert parameter.title in names


def test_summary_lists_the_values_briefly(qtbot, theme) -> None:
    emotion = next(one for one in ACTIONS if one.name == "emotion")
    form = ActionForm(theme, emotion)
    qtbot.addWidget(form)
    assert form.summary() == "happy, for 2 s"


def test_ampersand_in_a_parameter_name_is_shown_literally(qtbot, theme) -> None:
    form = ActionForm(theme, action(Parameter("p", "R&D", "text", default="hi")))
    qtbot.addWidget(form)
    (name,) = (each for each in form.findChildren(QLabel) if each.buddy() is not None)
    assert name.text() == "R&&D"  # in a label with a buddy, a single & would underline the D


def test_problems_are_matched_to_rows_in_a_translated_form(qtbot, theme, pseudo) -> None:
    made = action(Parameter("p", "p", "number", is_required=True), Parameter("q", "q", "number"))
    form = ActionForm(theme, made)
    qtbot.addWidget(form)
    form.show_problems(made.problems({"q": "x"}))
    below = {name: label.text() for name, label in form._error_labels.items()}
    assert all(below.values())
    assert form.problem.isHidden()


def test_duration_in_the_input_summary_is_translated(pseudo) -> None:
    waits = action(Parameter("s", translate("robot", "seconds"), "number", unit="s"))
    assert input_summary(waits, {"s": 2.0}) == _("for {duration}").format(duration="2 s")
