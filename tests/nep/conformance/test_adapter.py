"""Tests of nep's own adapter, which must pass every rule, and of the command `nep wire check`."""

from __future__ import annotations

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import typer

from nep.cli.programs import wire
from nep.programs.conformance import AdapterProcess, check, select_rules

ADAPTER = (sys.executable, str(Path(__file__).parents[3] / "examples" / "conformance_adapter.py"))


def test_nep_passes_every_rule() -> None:
    rules = select_rules(())
    with ThreadPoolExecutor(4) as pool:  # the rules mostly wait
        found = pool.map(
            lambda first: list(check(lambda master: AdapterProcess(ADAPTER, master), rules[first::4])),
            range(4),
        )
        outcomes = [each for some in found for each in some]
    assert [
        (each.rule.id, each.status, each.observation) for each in outcomes if each.status != "passed"
    ] == []
    assert len(outcomes) == len(rules)


def test_command_prints_outcomes_and_exits_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as exited:
        wire.check([*ADAPTER], ["node-record"], as_json=True)
    assert exited.value.exit_code == 0
    (outcome,) = json.loads(capsys.readouterr().out)
    assert (outcome["id"], outcome["status"]) == ("node-record", "passed")
    assert outcome["section"] == "docs/wire.md#node"


def test_command_exits_with_1_for_a_failed_rule(capsys: pytest.CaptureFixture[str]) -> None:
    answers = (
        "import json, sys\n"
        "for line in sys.stdin:\n"
        "    print(json.dumps({'re': json.loads(line)['id'], 'features': []}), flush=True)"
    )
    with pytest.raises(typer.Exit) as exited:
        wire.check([sys.executable, "-c", answers], ["node-record", "latched"])
    assert exited.value.exit_code == 1
    said = capsys.readouterr().out
    assert "node-record" in said
    assert "latched" in said


@pytest.mark.parametrize(
    "command", [["/there/is/none"], [sys.executable, "-c", "print('no JSON')"], [sys.executable, "-c", ""]]
)
def test_unusable_adapter_exits_with_2(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(typer.Exit) as exited:
        wire.check(command, ["node-record"])
    assert exited.value.exit_code == 2
    assert capsys.readouterr().err


def test_unknown_rule_and_missing_command_are_usage_errors() -> None:
    with pytest.raises(typer.BadParameter):
        wire.check([*ADAPTER], ["no-such-rule"])
    with pytest.raises(typer.BadParameter):
        wire.check([], [])


def test_list_option_prints_all_rules(capsys: pytest.CaptureFixture[str]) -> None:
    wire.check([], [], list_rules=True)
    output = capsys.readouterr().out
    assert all(each.id in output for each in select_rules(()))


def test_rule_sections_exist_in_the_documentation() -> None:
    root = Path(__file__).parents[3]
    page = (root / "docs" / "wire.md").read_text("utf-8")
    rules = (root / "docs" / "wire-check.md").read_text("utf-8")
    services = (root / "docs" / "services.md").read_text("utf-8")
    headings = {
        line.lstrip("#").strip().lower().replace("`", "").replace(",", "").replace(" ", "-")
        for line in (page + services).splitlines()
        if line.startswith("#")
    }
    for each in select_rules(()):
        assert each.location.partition("#")[2] in headings
        assert f"| `{each.id}` | {each.requirement}" in rules
