"""Tests of the ledger of robots that may be moving.

A robot is added by a command and removed by a confirmed stop, the end of its program or a user.
"""

from __future__ import annotations

import pytest

from app.core.robots.stop.moved_robots import MAX_MOTIONS, MovedRobots
from app.robots.identity import Identity

OLD, NEW = Identity("old", "driver"), Identity("new", "driver")


class Ledger(MovedRobots):
    """Ledger of robots whose current program is ``now``; programs in ``ended_programs`` have ended."""

    def __init__(self) -> None:
        self.now, self.ended_programs = OLD, set[Identity]()
        super().__init__(lambda _name: self.now, self.ended_programs.__contains__, lambda: 7.0)


@pytest.fixture
def ledger() -> Ledger:
    return Ledger()


def test_robot_is_removed_when_its_program_confirms_a_stop(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "shelf")
    ledger.record_stopped("Pepper", {"stranger"}, ledger.mark)
    assert ledger.names == ("Pepper",)
    ledger.record_stopped("Pepper", {"old"}, ledger.mark)
    assert ledger.names == ()


def test_confirmed_stop_does_not_cover_later_commands(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "form", id="1")
    mark = ledger.mark
    ledger.record_command(["Pepper"], "key")
    ledger.record_stopped("Pepper", {"old"}, mark)
    motion = ledger.motion("Pepper")
    assert motion is not None
    assert motion.sender == "key"


def test_final_reply_ends_only_its_own_motion(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "form", id="1")
    ledger.record_command(["Pepper"], "form", id="2")
    ledger.end_motion("Pepper", "1")
    assert "Pepper" in ledger
    ledger.end_motion("Pepper", "2")
    assert "Pepper" not in ledger


def test_final_reply_does_not_end_continuous_motion(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "form")  # velocity commands have no id
    ledger.end_motion("Pepper", "")
    assert "Pepper" in ledger


def test_restarted_program_does_not_confirm_the_stop_of_its_running_predecessor(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "behaviour")
    ledger.now = NEW
    assert ledger.other_programs("Pepper", NEW) == (OLD,)
    ledger.record_stopped("Pepper", {"new"}, ledger.mark)
    assert "Pepper" in ledger
    ledger.ended_programs.add(OLD)
    assert ledger.other_programs("Pepper", NEW) == ()
    assert "Pepper" in ledger, "its program ended: that alone stops no real robot"
    ledger.record_stopped("Pepper", {"new"}, ledger.mark)
    assert "Pepper" not in ledger


def test_virtual_robot_is_removed_when_its_program_ends(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "behaviour")
    ledger.drop_ended("Pepper")
    assert "Pepper" in ledger
    ledger.ended_programs.add(OLD)
    ledger.drop_ended("Pepper")
    assert "Pepper" not in ledger


def test_user_confirmation_removes_the_robot(ledger: Ledger) -> None:
    ledger.record_command(["Pepper", "Turtle"], "bridge")
    ledger.confirm(["Turtle", "Nobody"])
    assert ledger.names == ("Pepper",)


def test_cause_of_motion_takes_precedence_over_missing_stop_reply(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "alarm")
    ledger.record_command(["Pepper"], "stop")
    motion = ledger.motion("Pepper")
    assert motion is not None
    assert (motion.sender, motion.since_s) == ("alarm", 7.0)
    assert "alarm" in motion.reason
    assert ledger.motion("Turtle") is None


def test_recorded_motions_are_limited_without_removing_a_moving_robot(ledger: Ledger) -> None:
    for number in range(3 * MAX_MOTIONS):
        ledger.record_command(["Pepper"], "form", id=str(number))
        ledger.record_command(["Pepper"], "key")
    assert len(ledger._motions["Pepper"]) <= MAX_MOTIONS + 2
    for number in range(3 * MAX_MOTIONS):
        ledger.end_motion("Pepper", str(number))
    ledger.confirm(["Turtle"])
    assert "Pepper" in ledger


def newcomer_after(ledger: Ledger, graphs: int) -> None:
    """Complete an action of a robot, then add a second program of its name after this many other graphs."""
    ledger.record_command(["Pepper"], "form", id="1")
    ledger.end_motion("Pepper", "1", OLD)
    for _ in range(graphs):
        ledger.record_new_programs({})
    ledger.record_new_programs({name: [NEW] for name in ledger.recently_commanded})


@pytest.mark.parametrize("graphs", [0, 1])
def test_second_program_appearing_right_after_a_command_may_have_received_the_command(
    ledger: Ledger, graphs: int
) -> None:
    newcomer_after(ledger, graphs)
    assert ledger.other_programs("Pepper", OLD) == (NEW,)
    ledger.record_stopped("Pepper", {"old"}, ledger.mark)
    assert "Pepper" in ledger
    ledger.record_stopped("Pepper", {"new"}, ledger.mark)
    assert "Pepper" not in ledger


def test_second_program_appearing_later_has_not_received_the_command(ledger: Ledger) -> None:
    newcomer_after(ledger, 2)
    assert "Pepper" not in ledger


def test_second_program_with_a_confirmed_stop_is_not_recorded_as_new(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "form", id="1")
    ledger.record_stopped("Pepper", {"old", "new"}, ledger.mark)
    ledger.record_new_programs({"Pepper": [NEW]})
    assert "Pepper" not in ledger


def test_user_confirmation_clears_the_recently_commanded_robots(ledger: Ledger) -> None:
    ledger.record_command(["Pepper"], "key")
    ledger.confirm(["Pepper"])
    assert ledger.recently_commanded == ()
