"""Tests that a plug-in of each kind is added by adding one file."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import dedent
from types import ModuleType

import pytest

import nep
from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.toolbox.catalogue import english_categories
from app.blocks.toolbox.definitions import editor_definitions
from app.robots.description.description import parse, thing_description
from app.robots.kit import Driver
from nep.masters.master import Master
from nep.system.plugins import discover

Write = Callable[[str, str, str], ModuleType]


@pytest.fixture
def write(tmp_path: Path) -> Iterator[Write]:
    """Yield a function that adds a module to a package; the module is removed after the test."""
    added: list[tuple[ModuleType, str]] = []

    def write_one(package: str, name: str, source: str) -> ModuleType:
        (tmp_path / f"{name}.py").write_text(dedent(source), encoding="utf-8")
        home = importlib.import_module(package)
        home.__path__.append(str(tmp_path))
        added.append((home, f"{package}.{name}"))
        english_categories.cache_clear()
        return importlib.import_module(f"{package}.{name}")

    yield write_one
    for home, module in added:
        home.__path__.remove(str(tmp_path))
        sys.modules.pop(module, None)
        delattr(home, module.rpartition(".")[2])
    english_categories.cache_clear()


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


def test_robot_plug_in_is_described_driven_and_offered_as_blocks(write: Write, master: Master) -> None:
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
