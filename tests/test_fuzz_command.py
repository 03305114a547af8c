"""Tests of ``dev.py fuzz``, without atheris: division of the time, reports of findings, invalid requests."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.fuzz.targets import TARGETS
from tools.computer import CommandError, Computer
from tools.fuzz import HARNESS, findings_in, fuzz, seconds_each


@dataclass
class Fuzzing:
    """Fake computer whose fuzz targets and findings a test chooses."""

    folder: Path
    weights: Mapping[str, int] = field(default_factory=lambda: {"quick": 1, "slow": 8})
    finds: Mapping[str, bytes] = field(default_factory=dict)
    code: int = 0
    ran: list[list[str]] = field(default_factory=list)

    def ask(self, command: Sequence[str]) -> str:
        assert command[-1] == "--list"
        assert command[1].endswith(HARNESS)
        return json.dumps(self.weights) if self.weights else "ImportError"

    def do(self, command: Sequence[str], environ: Mapping[str, str], log: Path | None) -> int:
        self.ran.append([str(each) for each in command])
        if "venv" in command:
            Path(command[-1]).mkdir(parents=True)
        if str(self.folder) not in command:
            return 0
        for name, data in self.finds.items():
            (self.folder / "findings" / name).write_bytes(data)
        return self.code

    def run(self, *given: str, platform: str = "linux") -> int:
        computer = Computer(platform=platform, environ={}, ask=self.ask, do=self.do)
        return fuzz(computer, given, self.folder)


def test_fuzz_time_is_divided_and_slow_targets_get_a_double_share() -> None:
    assert seconds_each({"a": 1, "b": 1, "c": 4}, 2) == {"a": 30, "b": 30, "c": 60}
    assert seconds_each({"a": 1}, 0.001) == {"a": 1}
    assert seconds_each({}, 5) == {}
    assert sum(seconds_each({name: each.slower for name, each in TARGETS.items()}, 15).values()) < 16 * 60


def test_all_fuzz_targets_run_by_default_and_zero_findings_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    system = Fuzzing(tmp_path)
    assert system.run("--", "--minutes", "3") == 0
    assert system.ran[-1][2:] == [str(tmp_path), "quick=60", "slow=120"]
    assert "0 findings" in capsys.readouterr().out
    assert Fuzzing(tmp_path).run("quick") == 0, "the environment exists"


def test_new_findings_are_reported_and_earlier_findings_are_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    finds = {"quick-1.bin": b"x", "quick-1.txt": b"RecursionError", "slow-timeout-5": b"y"}
    assert Fuzzing(tmp_path, finds=finds).run() == 1
    said = capsys.readouterr().out
    assert "quick-1.bin\nRecursionError" in said
    assert "slow-timeout-5\nthe input takes too long" in said
    assert "2 findings" in said
    assert Fuzzing(tmp_path).run() == 0
    assert findings_in(tmp_path / "findings") == []
    assert findings_in(tmp_path / "none") == []


def test_fuzz_target_that_exits_with_an_error_is_a_failure(tmp_path: Path) -> None:
    assert Fuzzing(tmp_path, code=1).run() == 1


def test_fuzz_rejects_unknown_targets_other_systems_missing_packages_and_bad_durations(
    tmp_path: Path,
) -> None:
    with pytest.raises(CommandError, match="no target 'nothing'"):
        Fuzzing(tmp_path).run("nothing")
    with pytest.raises(CommandError, match="Linux only"):
        Fuzzing(tmp_path).run(platform="darwin")
    with pytest.raises(CommandError, match="cannot be imported"):
        Fuzzing(tmp_path, weights={}).run()
    for minutes in ("0", "-1", "nan", "1e9"):
        with pytest.raises(SystemExit):
            Fuzzing(tmp_path).run("--minutes", minutes)


def test_fuzz_targets_are_listed_and_a_finding_can_be_rerun(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert Fuzzing(tmp_path).run("--list") == 0
    assert capsys.readouterr().out.splitlines()[-2:] == ["quick", "slow"]
    system = Fuzzing(tmp_path)
    system.run("--again", str(tmp_path / "quick-1.bin"))
    assert system.ran[-1][-2:] == ["--again", str(tmp_path / "quick-1.bin")]
