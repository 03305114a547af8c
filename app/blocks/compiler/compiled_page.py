"""Compiled page: the scripts of one page as code, before they are linked with those of other pages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from app.blocks.compiler.lowering import ModuleFunction, ModuleKey
from app.blocks.compiler.program_names import NameRequest
from app.blocks.compiler.unused_names import NameUsage
from app.blocks.model.program import Problem


@dataclass
class UsedResources:
    """Robots, sensors, events and topics that blocks use, in the order of the blocks."""

    robots: dict[str, None] = field(default_factory=dict)
    sensors: dict[tuple[str, str], None] = field(default_factory=dict)
    events: dict[tuple[str, str], None] = field(default_factory=dict)
    publishes: dict[str, None] = field(default_factory=dict)
    listens: dict[str, None] = field(default_factory=dict)
    moves: dict[str, None] = field(default_factory=dict)

    @classmethod
    def merge(cls, parts: Iterable[UsedResources]) -> UsedResources:
        """Return the resources of several pages."""
        merged = cls()
        for part in parts:
            merged.robots |= part.robots
            merged.sensors |= part.sensors
            merged.events |= part.events
            merged.publishes |= part.publishes
            merged.listens |= part.listens
            merged.moves |= part.moves
        return merged


@dataclass(frozen=True)
class CompiledPage:
    """Compiled page. Immutable, so that it can be cached and linked in any thread.

    Attributes:
        source: Readable code of the functions and scripts; "" if there are none.
        runnable: The same code with a call of ``step`` before each block.
        lines: Block ids by line of `source`.
        names: Names in the code, which are replaced when the page is linked.
        commands: Names of the commands that the code calls.
        variables: Python names of the used variables by id, in the order of their first use.
        variable_names: Names of all variables by id.
        starts: Number of scripts that can start.
        has_scripts: True if the page contains blocks.
        actions: Names of the executed actions by robot; None if they aren't statically known.
        problems: Problems of blocks, in the order of the blocks.
        page_problems: Problems that were found after all blocks were compiled.
        module_lookups: Functions of other pages that were looked up; the code is valid while they are equal.
    """

    source: str
    runnable: str
    lines: Mapping[int, str]
    names: tuple[NameRequest, ...]
    commands: frozenset[str]
    variables: Mapping[str, str]
    variable_names: Mapping[str, str]
    starts: int
    has_scripts: bool
    uses: UsedResources
    actions: Mapping[str, tuple[str, ...]] | None
    readings: Mapping[str, str]
    labels: Mapping[str, str]
    breakpoints: tuple[str, ...]
    problems: tuple[Problem, ...]
    page_problems: tuple[Problem, ...]
    name_usage: NameUsage
    absent: tuple[str, ...]
    module_lookups: Mapping[ModuleKey, ModuleFunction | None]
