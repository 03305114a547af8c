"""Tests that compile time is linear in the number of blocks.

Executed lines are counted: four times the blocks must take about four times the lines.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from functools import partial
from types import FrameType

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.model.names import PythonNames
from app.blocks.model.project import Project
from app.blocks.model.workspace import parse_workspace
from app.core.projects.problems import problem_lines
from tests.blocks.samples import block, call, define, number, robot, say, started, workspace

Saved = dict[str, object]
FEW = 20


def steps(work: Callable[[], object]) -> int:
    """Count the Python lines that `work` executes.

    Unlike a time measurement, the count doesn't depend on the load of the machine.
    """
    count = 0

    def trace(_frame: FrameType, event: str, _argument: object) -> object:
        nonlocal count
        count += event == "line"
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    finally:
        sys.settrace(before)
    return count


def copied(saved: Saved) -> Saved:
    made: Saved = json.loads(json.dumps(saved))
    return made


def scripts(count: int) -> Saved:
    return workspace(*[copied(started(say("hi"))) for _ in range(count)])


def variables(count: int) -> Saved:
    names = [{"id": f"v{n}", "name": "the same"} for n in range(count)]
    sets = [block("variables_set", VAR={"id": f"v{n}"}, VALUE=number(1)) for n in range(count)]
    return {**workspace(started(*sets)), "variables": names}


def functions(count: int) -> Saved:
    made = [define(f"f{n}", "same", ("a",), say("x")) for n in range(count)]
    return workspace(*made, started(*[call("same", id=f"c{n}") for n in range(count)]))


def strangers(count: int) -> Saved:
    return workspace(started(*[say("hi", f"R{n}") for n in range(count)]))


@pytest.mark.parametrize("make", [scripts, variables, functions, strangers])
def test_compile_time_is_linear_in_number_of_blocks(make: Callable[[int], Saved]) -> None:
    robots = (robot(),)
    compile_behaviour(make(2), robots)  # warm-up: fills the caches
    few, many = (steps(partial(compile_behaviour, make(count), robots)) for count in (FEW, 4 * FEW))
    assert many < 5 * few


def test_naming_and_parsing_time_is_linear_for_duplicate_names_and_ids() -> None:
    def name(count: int) -> None:
        names = PythonNames(frozenset())
        assert len({names.new_name("when started", "script") for _ in range(count)}) == count

    def parse(count: int) -> None:
        saved = workspace(*[block("x", "one id") for _ in range(count)])
        assert len({script[0].id for script in parse_workspace(saved).scripts}) == count

    for work in (name, parse):
        work(2)
        few, many = (steps(lambda work=work, count=count: work(count)) for count in (100, 400))
        assert many < 5 * few


def test_time_to_list_problems_is_linear_in_number_of_missing_robots() -> None:
    here = robot()

    def work(count: int) -> int:
        saved = strangers(count)
        missing = [robot(f"R{n}") for n in range(count)]
        problems = compile_behaviour(saved, (here,), absent=missing).problems
        pages = Project.of_blocks("", saved).pages
        return steps(lambda: problem_lines(problems, pages, missing, (here,), ()))

    work(2)
    assert work(4 * 10) < 5 * work(10)
