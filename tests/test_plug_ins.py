"""Tests that a plug-in of each kind is added by adding one file."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import dedent
from types import ModuleType

import pytest

import nep
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.compiler.program_names import reserved_names
from app.blocks.model.program import Program
from app.blocks.toolbox.catalogue import Catalogue, english_categories, function_modules
from app.blocks.toolbox.definitions import editor_definitions
from app.blocks.toolbox.help import help_of
from app.robots.description.description import parse, thing_description
from app.robots.kit import Driver
from nep.backends.base import find_backend
from nep.errors import UnknownBackendError
from nep.masters.master import Master
from nep.system.plugins import discover
from tests.blocks import samples
from tests.blocks.fakes import Play
from tests.blocks.samples import block, started, workspace

Write = Callable[[str, str, str], ModuleType]


def forget_categories() -> None:
    english_categories.cache_clear()
    function_modules.cache_clear()


@pytest.fixture
def write(tmp_path: Path) -> Iterator[Write]:
    """Yield a function that adds a module to a package; the module is removed after the test."""
    added: list[tuple[ModuleType, str]] = []

    def write_one(package: str, name: str, source: str) -> ModuleType:
        (tmp_path / f"{name}.py").write_text(dedent(source), encoding="utf-8")
        home = importlib.import_module(package)
        home.__path__.append(str(tmp_path))
        added.append((home, f"{package}.{name}"))
        forget_categories()
        return importlib.import_module(f"{package}.{name}")

    yield write_one
    for home, module in added:
        home.__path__.remove(str(tmp_path))
        sys.modules.pop(module, None)
        delattr(home, module.rpartition(".")[2])
    forget_categories()


def test_back_end_plug_in_is_discovered(write: Write) -> None:
    write(
        "nep.backends",
        "looped",
        """
        from dataclasses import replace
        from nep.backends.memory import BACKEND as MEMORY

        BACKEND = replace(MEMORY, name="looped", aliases=("loop",))
        """,
    )
    with nep.node("one", "LOOP") as one, nep.node("two", "looped") as two:
        subscriber = two.new_sub("topic")
        one.new_pub("topic").publish({"hello": 1})
        assert subscriber.listen(timeout_s=30.0) == (True, {"hello": 1})


@pytest.mark.parametrize("name", ["zeromq", "ZMQ"])
def test_node_finds_its_back_end_by_name_or_alias_and_imports_no_other_for_its_name(name: str) -> None:
    code = (
        "import sys\n"
        "from nep.backends.base import find_backend\n"
        "assert find_backend(sys.argv[1]).name == 'zeromq'\n"
        "print('nep.backends.zenoh' in sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, name], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(name == "ZMQ")


@pytest.mark.parametrize("name", ["base", "no_such", "zeromq.transport", "", "no name"])
def test_module_without_a_back_end_is_not_found(name: str) -> None:
    with pytest.raises(UnknownBackendError):
        find_backend(name)


def test_category_plug_in_is_in_the_toolbox_and_its_block_compiles(write: Write) -> None:
    write(
        "app.blocks.categories",
        "greetings",
        """
        from app.blocks.model.block import Block
        from app.blocks.model.category import Category

        CATEGORY = Category(
            name="greetings", title="Greetings", style="messages", icon="hand", order=99,
            blocks=(
                Block(
                    type="greetings_hello", text="greet", shape="statement", style="messages", icon="hand",
                    tooltip="Says hello in the console.", python="write('hello')",
                ),
            ),
        )
        """,
    )
    definitions = json.dumps(editor_definitions([]))
    assert '"greetings_hello"' in definitions
    assert '"Greetings"' in definitions
    started = {"type": "events_started", "id": "s", "next": {"block": {"type": "greetings_hello", "id": "g"}}}
    program = compile_behaviour({"blocks": {"languageVersion": 0, "blocks": [started]}}, [])
    assert "write('hello')" in program.source
    assert not program.problems


MOON = """
import math

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ValueInput
from app.blocks.runtime.errors import BehaviourError
from app.blocks.runtime.values import number


def weight_on_moon(kilograms: object) -> float:
    mass = number(kilograms, "weight")
    if mass < 0:
        raise BehaviourError("Nothing weighs less than 0 kg.")
    return round(mass / 6, 2)


CATEGORY = Category(
    name="moon", title="Moon", style="values", icon="moon", order=99, functions=(weight_on_moon,),
    blocks=(
        Block(
            type="moon_weight", text="weight on the moon of %KG kg", shape="value", style="values",
            icon="moon", tooltip="What something weighs on the moon.",
            example="For example: 60 kg weigh 10 kg.",
            check="Number", arguments=(ValueInput("KG", "Number", 60),), python="weight_on_moon(%KG)",
        ),
    ),
)
"""


def moon_program(kilograms: float) -> Program:
    return compile_behaviour(
        workspace(started(samples.write(block("moon_weight", KG=samples.number(kilograms))))), []
    )


def test_block_with_a_function_in_one_file_is_offered_compiled_and_run(write: Write) -> None:
    module = write("app.blocks.categories", "moon", MOON)
    definitions = editor_definitions([])
    assert "weight on the moon of" in json.dumps(definitions["blocks"])
    assert '"moon_weight"' in json.dumps(definitions["toolbox"])
    assert help_of(Catalogue([]).blocks["moon_weight"])["example"] == "For example: 60 kg weigh 10 kg."
    program = moon_program(90.0)
    assert not program.problems
    assert f"from {module.__name__} import weight_on_moon" in program.source
    run = Play(program).start()
    run.end()
    assert (run.lines, run.runtime.error) == (["15"], None)
    refused = Play(moon_program(-1.0)).start()
    refused.end()
    assert refused.runtime.error is not None
    assert refused.runtime.error.sentence == "Nothing weighs less than 0 kg."


def test_variable_cannot_have_the_name_of_a_function_of_a_category(write: Write) -> None:
    write("app.blocks.categories", "moon", MOON)
    assert "weight_on_moon" in reserved_names()


def test_robot_plug_in_is_described_driven_and_offered_as_blocks(
    write: Write, master: Master, patient: None
) -> None:
    module = write(
        "app.robots",
        "lamp",
        '''
        from typing import Annotated
        from app.robots.kit import Call, Kind, Link, Range, action, safe_stop


        class Lamp:
            """A lamp that blinks."""

            def __init__(self, link: Link) -> None:
                self.blinked = 0

            @action("blink %times times", category="Looks", icon="lightbulb")
            def blink(self, call: Call, times: Annotated[int, Range(1, 9)] = 3) -> dict[str, object]:
                """Blinks."""
                self.blinked += times
                return {"blinked": self.blinked}

            @safe_stop()
            def stop(self) -> None:
                """Stands still at once."""


        ROBOT = Kind("lamp", "Lamp", Lamp)
        ''',
    )
    robot = parse(thing_description(module.ROBOT.thing_model, "Desk lamp"))
    definitions = json.dumps(editor_definitions([robot]))
    assert "robot_lamp_do_blink" in definitions
    assert robot.action("blink").check({"times": 10}) != ()
    with nep.node("lamp") as node, nep.node("asker") as asker:
        driver = Driver(module.ROBOT, "Desk lamp", node)
        driver.start()
        try:
            found = [t for t in asker.graph().topics.values() if t.msg_type == "robot/description"]
            assert [topic.name for topic in found] == [robot.topics.description]
            answers = asker.new_sub(robot.topics.reply, "robot/answer")
            commands = asker.new_pub(robot.topics.command, "robot/command")
            commands.publish(
                {"id": "1", "op": "invoke", "from": "me", "action": "blink", "input": {"times": 2}}
            )
            state, output = "", None
            while state not in {"succeeded", "failed"}:
                arrived, answer = answers.listen(timeout_s=30.0)
                assert arrived, "the robot didn't reply"
                state, output = answer["state"], answer["output"]
            assert (state, output) == ("succeeded", {"blinked": 2})
        finally:
            driver.close()


def test_package_without_plug_ins_raises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "emptied").mkdir()
    (tmp_path / "emptied" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(nep.NepError, match="emptied"):
        discover("emptied", "PANEL", object)  # type: ignore[type-var]
