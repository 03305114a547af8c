"""Tests of the benchmark for the paper's figures: validity, report, simulated link, and a short run."""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]
BENCH = ROOT / "bench"
KB = 1024
SIZES = [KB * n for n in (16, 64, 4096, 8192)]
LINK = """
import json, socket, subprocess, sys, time
from link import HOSTS, Wifi, joined
SERVE = '''
import socket
server = socket.create_server(("10.77.0.2", 0))
print(server.getsockname()[1], flush=True)
end, _ = server.accept()
while data := end.recv(1 << 16):
    end.sendall(data)
'''
with joined(Wifi(20.0, 0.0, 8.0)) as link:
    command = [*link.elsewhere, sys.executable, "-c", SERVE]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        with socket.create_connection((HOSTS[1], int(server.stdout.readline()))) as end:
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            taken, came = [], []
            for size in (10, 200_000):
                data = bytes(range(250)) * (size // 250 + 1)
                started, back = time.monotonic(), b""
                end.sendall(data[:size])
                while len(back) < size:
                    back += end.recv(1 << 16)
                taken.append(time.monotonic() - started)
                came.append(back == data[:size])
print(json.dumps([taken, came, link.made_by, link.told]))
"""

WRITE = """
import json, pathlib, sys, paper_figures
paper_figures.write(json.loads(sys.argv[1]), pathlib.Path(sys.argv[2]))
"""


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    yield from imported("paper_figures", monkeypatch)


@pytest.fixture
def paper(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    yield from imported("paper", monkeypatch)


@pytest.fixture
def fan(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    yield from imported("nep_fan", monkeypatch)


def imported(name: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Yield a benchmark as a module; it can import its neighbours."""
    monkeypatch.syspath_prepend(str(BENCH))
    before = set(sys.modules)
    yield __import__(name)
    for each in set(sys.modules) - before:
        if str(getattr(sys.modules[each], "__file__", "")).startswith(str(BENCH)):
            del sys.modules[each]


def found(again: float = 1.0, nep: float = 0.4, sizes: list[int] = SIZES) -> dict:
    """Return results in which plain pyzmq takes 1 ms per MB, and the others a multiple of it."""
    rows = {"plain pyzmq": 1.0, "plain again": again, "nep": nep}
    cells = []
    for row, times in rows.items():
        for kind, size in itertools.product(("string", "json"), sizes):
            ms = times * size / 1e6
            cell = {"row": row, "kind": kind, "size": size, "trips": 20, "median_ms": ms, "p95_ms": 2 * ms}
            cells.append(cell)
    local = {"name": "local", "link": "loopback", "blocks": 4, "cells": cells}
    local["not_run"] = {"rospy": "it is missing"}
    local["taken"] = "2026-11-24"
    local["computer"] = {"processor": "one", "processors": 2, "system": "Linux", "load_before": 0.1}
    local["versions"] = {"Python": "3.11.7"}
    return {
        "scenarios": [local],
        "not_run": {"remote": "there is no 'ip'"},
    }


def test_measurement_is_valid_only_if_the_plain_repetition_is_within_5_percent(figures: ModuleType) -> None:
    assert "| does not count |" not in figures.report(found(again=1.049))
    assert figures.does_count(found(again=1.049))
    for again in (1.06, 0.94):
        said = figures.report(found(again=again))
        assert said.count("| does not count |") == 2 * len(SIZES)
        assert not figures.does_count(found(again=again))


def test_goals_are_reached_missed_or_not_counted_by_measured_ratio(figures: ModuleType) -> None:
    assert [goal.is_reached for goal in figures.goals(found(nep=0.49))] == [True, True, True]
    assert [goal.is_reached for goal in figures.goals(found(nep=0.55))] == [True, False, True]
    assert [goal.is_reached for goal in figures.goals(found(nep=1.2))] == [False, False, False]
    assert "**missed**" in str(figures.goals(found(nep=1.2))[0])
    assert "does not count" in str(figures.goals(found(nep=0.4, again=1.1))[0])


def test_goals_are_omitted_unless_all_sizes_are_measured(figures: ModuleType) -> None:
    assert figures.goals(found(sizes=SIZES[:2])) == []


def test_report_numbers_its_figures_as_in_the_paper(figures: ModuleType) -> None:
    """Figure 9 of the paper is R-remote, figure 10 is L-local."""
    run = found()
    run["scenarios"].append(run["scenarios"][0] | {"name": "remote"})
    said = figures.report(run, "images")
    heads = [line for line in said.splitlines() if line.startswith(("### Figure", "!["))]
    assert [line.partition(":")[0] for line in heads] == [
        "![R-remote", "### Figure 9", "![L-local", "### Figure 10",
    ]  # fmt: skip
    assert "### Figure 9: R-remote" in said
    assert "### Figure 10: L-local" in said


def test_remote_scenario_measures_200_round_trips_of_each_size(paper: ModuleType) -> None:
    for size in paper.SIZES["remote"]:
        assert paper.REMOTE_BLOCKS * paper.trips("remote", size) == 200


def test_skipped_measurements_are_reported(figures: ModuleType) -> None:
    said = figures.report(found())
    assert "- rospy: not run, it is missing" in said
    assert "R-remote: not run, there is no 'ip'" in said


def test_writing_replaces_only_the_measured_scenarios(figures: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    document = tmp_path / "figures.md"
    document.write_text(f"before\n{figures.BEGIN}\nold\n{figures.END}\nafter\n", encoding="utf-8")
    kept = found() | {"not_run": {}}
    remote = kept["scenarios"][0] | {"name": "remote", "taken": "2026-11-20"}
    kept["scenarios"] = [remote, kept["scenarios"][0] | {"blocks": 99}]
    (tmp_path / "figures.json").write_text(json.dumps(kept), encoding="utf-8")
    # In a separate process, because matplotlib keeps its font files open.
    command = [sys.executable, "-c", WRITE, json.dumps(found()), str(tmp_path)]
    subprocess.run(command, cwd=BENCH, check=True)
    text = document.read_text(encoding="utf-8")
    assert text.startswith(f"before\n{figures.BEGIN}\n")
    assert text.endswith(f"{figures.END}\nafter\n")
    assert "old" not in text
    assert "| 16 kB | 0.016 (0.033) | 0.007 (0.013) | 1.00 |  |" in text
    written = json.loads((tmp_path / "figures.json").read_text(encoding="utf-8"))
    assert written == {"scenarios": [remote, *found()["scenarios"]], "not_run": {}}
    assert "<svg" in (tmp_path / "images" / "figure-10.svg").read_text(encoding="utf-8")
    assert (tmp_path / "images" / "figure-10.png").read_bytes().startswith(b"\x89PNG")


def test_figures_document_matches_its_recorded_results(figures: ModuleType) -> None:
    numbers = json.loads((ROOT / "docs" / "figures.json").read_text(encoding="utf-8"))
    text = (ROOT / "docs" / "figures.md").read_text(encoding="utf-8")
    assert figures.report(numbers, "images") in text


def test_fan_benchmark_fails_if_the_cost_per_endpoint_grows_by_more_than_a_factor_of_1_2(
    fan: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    def taken(factor: float, again: float = 1.0) -> dict:
        costs = {}
        for what, way, pace, ends in fan.itertools.product(("nep", "plain"), fan.WAYS, fan.PACES, (10, 50)):
            one = 1e-6 * (factor if ends == 50 and what == "nep" and pace == "paced" else 1.0)
            costs[what, fan.Cell(what, way, pace, ends)] = [one]
            if what == "plain":
                costs["again", fan.Cell(what, way, pace, ends)] = [one * again]
        return costs

    assert fan.show(taken(1.19), (10, 50)) == 0
    assert fan.show(taken(1.21), (10, 50)) == 1
    assert fan.show(taken(1.0, again=1.06), (10, 50)) == 1
    assert "above 1.2" in capsys.readouterr().out
    assert fan.line((1, 10, 50), (12.0, 3.0, 2.2)) == pytest.approx((10.0, 2.0))


def in_a_network(program: str, environment: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program in the directory of the benchmarks, in its own network namespace."""
    command = ["unshare", "-rn", sys.executable, "-c", program]
    return subprocess.run(command, cwd=BENCH, env=environment, capture_output=True, text=True, check=False)


def need_networks(figures: ModuleType) -> None:
    import link

    why = link.why_no_networks()
    if why:
        pytest.skip(why)


@pytest.mark.timeout(60)
def test_link_applies_its_delay_and_rate_limit(figures: ModuleType) -> None:
    need_networks(figures)
    done = in_a_network(LINK)
    if "TUN device" in done.stderr:
        pytest.skip("needs netem or /dev/net/tun")
    assert not done.returncode, done.stderr
    (small_s, large_s), came, made_by, told = json.loads(done.stdout)
    assert came == [True, True]
    assert small_s >= 0.040  # 20 ms in each direction
    assert large_s >= 0.040 + 200_000 * 8 / 8e6  # the directions overlap, so at least one transfer time
    assert made_by == "netem" or told["packets"] > 200_000 / 1500


@pytest.mark.timeout(60)
def test_netem_link_is_a_veth_pair_delayed_at_both_ends(figures: ModuleType, tmp_path: Path) -> None:
    need_networks(figures)
    said = tmp_path / "said"
    tc = tmp_path / "tc"
    tc.write_text(f'#!/bin/sh\necho "$@" >> {said}\n', encoding="utf-8")
    tc.chmod(0o755)
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = in_a_network(LINK, environment)
    assert not done.returncode, done.stderr
    _taken, came, made_by, told = json.loads(done.stdout)
    assert (came, made_by, told) == ([True, True], "netem", {})
    wanted = "root netem delay 20.0ms 0.0ms rate 8.0mbit"
    assert said.read_text(encoding="utf-8").splitlines() == [
        f"qdisc add dev nep-own {wanted}", f"qdisc add dev nep-other {wanted}",
    ]  # fmt: skip


@pytest.mark.timeout(120)
def test_both_scenarios_are_measured_and_missing_rows_are_reported(
    figures: ModuleType, tmp_path: Path
) -> None:
    need_networks(figures)
    keep = tmp_path / "found.json"
    command = [sys.executable, str(BENCH / "paper.py"), "--rows", "nep", "nep 0.5.3.5", "rosbridge"]
    command += [
        "--kinds",
        "json",
        "--python2",
        str(tmp_path / "python2.7"),
        "--sizes",
        "1024",
        "--blocks",
        "1",
        "--keep",
        str(keep),
        "--delay-ms",
        "5",
        "--jitter-ms",
        "0",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert keep.exists(), done.stderr
    kept = json.loads(keep.read_text(encoding="utf-8"))
    scenarios = {each["name"]: each for each in kept["scenarios"]}
    for name in {"local", "remote"} - set(kept["not_run"]):
        cells = {each["row"]: each for each in scenarios[name]["cells"]}
        assert set(cells) == {"plain pyzmq", "plain again", "nep"}, scenarios[name]["not_run"]
        assert all(0 < each["median_ms"] <= each["p95_ms"] for each in cells.values())
        assert "no server" in scenarios[name]["not_run"]["rosbridge"]
        assert "--python2" in scenarios[name]["not_run"]["nep 0.5.3.5"]
    if "remote" in scenarios:  # our link delays by 10 ms per round trip
        assert all(each["median_ms"] >= 10.0 for each in scenarios["remote"]["cells"])
    else:
        assert "TUN" in kept["not_run"]["remote"]
