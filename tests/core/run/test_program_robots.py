"""Tests of the robot topics sent to a running program, including robots without a readable description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace

from app.core.robots.stop.moved_robots import MovedRobots
from app.core.run.program_robots import ProgramRobots
from nep.programs.robots import MovingTopics, RobotControls

ROVER = RobotControls("Rover", frozenset({"/Rover/command"}))


class Program:
    """Fake program that records the topics sent to it."""

    def __init__(self) -> None:
        self.told: list[Mapping[str, Sequence[str]]] = []

    def set_robots(self, _owners: Mapping[str, str], guarded: Mapping[str, Sequence[str]]) -> None:
        self.told.append(guarded)


def test_topics_of_robots_with_unreadable_descriptions_are_sent_to_the_program_once() -> None:
    fleet = SimpleNamespace(
        connected=(),
        moved=MovedRobots(),
        moving_topics=MovingTopics(),
        revision=1,
        link=lambda _name: None,
        permission=SimpleNamespace(request_permission=lambda *_words: True),
    )
    program = Program()
    robots = ProgramRobots(fleet)  # type: ignore[arg-type]
    robots.start(program, (), {})  # type: ignore[arg-type]
    robots.update()
    assert program.told == []
    fleet.moving_topics = MovingTopics([ROVER])
    robots.update()
    robots.update()
    fleet.moving_topics = MovingTopics([ROVER])  # a new graph with the same robots
    robots.update()
    assert program.told == [{"/Rover/command": ("Rover",), "robot_action": ("Rover",)}]
    robots.start(program, (), {})  # type: ignore[arg-type]
    robots.update()
    assert len(program.told) == 2  # a new program knows only the connected robots at first
