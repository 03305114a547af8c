"""Tests that a command canceled by another script's command is reported, with a count, at its block."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.robot_handle import Replacement
from tests.blocks.fakes import FakeLink, Play, until
from tests.blocks.fighting import fighter, look, turn
from tests.blocks.samples import say, started, workspace


class Fight:
    """Programs that share one fake link, on which a test controls the replies."""

    def __init__(self) -> None:
        self.link = FakeLink()
        self.link.held = {"turn", "look"}
        self.plays: list[Play] = []

    def begin(self, *scripts: dict[str, object], robots: tuple[str, ...] = ("Pepper",)) -> Play:
        known = tuple(fighter(name) for name in robots)
        play = Play(compile_behaviour(workspace(*scripts), known), known, self.link)
        self.plays.append(play.start())
        return play

    def asked(self, count: int) -> None:
        until(lambda: len(self.link.calls) >= count)


@pytest.fixture
def fight() -> Iterator[Fight]:
    made = Fight()
    yield made
    for play in made.plays:
        play.stop()


def test_replaced_command_is_reported_at_its_block_and_script_continues(fight: Fight) -> None:
    play = fight.begin(started(turn("t"), say("on")), started(turn("t2"), say("on")))
    fight.asked(2)
    loser, winner = fight.link.calls
    fight.link.answer(loser, "canceled", error="replaced by turn")
    until(lambda: len(fight.link.calls) == 3)
    fight.link.answer(winner, "succeeded")
    play.end()
    (news,) = play.runtime.replacements.take_new()
    assert news.block in {"t", "t2"}  # depends on which script starts first
    assert news.message == "“turn” was replaced by “turn”"
    assert news.count == 1
    assert fight.link.invoked[2] == ("Pepper", "say", {"text": "on"})
    assert play.runtime.error is None
    assert play.runtime.replacements.take_new() == ()


def test_repeated_replacements_are_counted(fight: Fight) -> None:
    play = fight.begin(started(turn("t", again=True)), started(turn("t2", again=True)))
    for round_ in range(1, 4):
        fight.asked(round_ + 1)
        fight.link.answer(fight.link.calls[round_ - 1], "canceled")
    fight.asked(5)
    news = {each.block: each for each in play.runtime.replacements.take_new()}
    assert sum(each.count for each in news.values()) == 3
    assert set(news) == {"t", "t2"}


def test_replacement_names_robot_when_several_are_used(fight: Fight) -> None:
    play = fight.begin(
        started(turn("t", "Ada")),
        started(turn("t2", "Ada")),
        started(look("l", "Bob")),
        robots=("Ada", "Bob"),
    )
    fight.asked(3)
    loser = next(call for call in fight.link.calls if call.robot == "Ada")
    fight.link.answer(loser, "canceled")
    found: list[Replacement] = []
    until(lambda: bool(found.extend(play.runtime.replacements.take_new()) or found))
    assert found[0].message == "Ada: “turn” was replaced by “turn”"


def test_canceled_commands_of_other_robots_or_parts_are_not_replacements(fight: Fight) -> None:
    play = fight.begin(
        started(turn("t", "Ada")),
        started(look("l", "Ada")),
        started(turn("t2", "Bob")),
        robots=("Ada", "Bob"),
    )
    fight.asked(3)
    for call in list(fight.link.calls):
        fight.link.answer(call, "canceled")
    play.end()
    assert play.runtime.replacements.take_new() == ()


def test_restarted_event_script_does_not_replace_itself(fight: Fight) -> None:
    hat = {"type": "robot_pepper_when_touched", "id": "h", "fields": {"ROBOT": "Pepper", "PLACE": "head"}}
    play = fight.begin({**hat, "next": {"block": turn("t")}})
    fight.link.happen(("Pepper", "touched"), {"place": "head", "down": True})
    for count in (1, 2):
        fight.asked(count)  # touched again during the turn
        fight.link.happen(("Pepper", "touched"), {"place": "head", "down": True})
        fight.link.answer(fight.link.calls[count - 1], "canceled")
    fight.asked(3)
    assert play.runtime.replacements.take_new() == ()


def test_queued_command_is_not_reported_as_replaced(fight: Fight) -> None:
    robot = fighter("Pepper")
    queues = replace(robot, actions=tuple(replace(action, on_busy="queue") for action in robot.actions))
    program = compile_behaviour(workspace(started(turn("t")), started(turn("t2"))), [queues])
    play = Play(program, (queues,), fight.link).start()
    fight.plays.append(play)
    fight.asked(2)
    for call in list(fight.link.calls):
        fight.link.answer(call, "canceled")
    play.end()
    assert play.runtime.replacements.take_new() == ()
