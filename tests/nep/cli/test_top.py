"""Tests of `nep top`: the content and order of its tables, and how it ends."""

from __future__ import annotations

import io
import json
import math

import pytest
from msgspec.structs import replace
from rich.console import Console
from rich.live import Live

import nep
from nep.cli.graph import top
from nep.cli.graph.top import TopicOrder, node_rows, topic_rows
from nep.masters.master import Master
from nep.masters.process import view
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo
from tests.nep.cli.conftest import TypeIn
from tests.nep.programs import eventually

NODE = NodeInfo("a" * 16, "camera", "lab", 7, "Python", "native", 1)
OTHER = replace(NODE, id="b" * 16, name="arm", cpu_ratio=0.5)
PUBLISHER = PublisherInfo(1, NODE.id, (), False, 10, 100, 10, None, 30.0, 900.0)


def topic(name: str, rate_hz: float | None = None, lost: int | None = None, **more: object) -> TopicInfo:
    return replace(TopicInfo(name, "json", "json", rate_hz=rate_hz, lost=lost), **more)


def graph(*topics: TopicInfo) -> GraphView:
    return GraphView(1, 1, {each.id: each for each in (NODE, OTHER)}, {each.name: each for each in topics})


def test_largest_values_are_listed_first_and_unknown_values_last() -> None:
    found = graph(topic("/none"), topic("/slow", 1.0, 9), topic("/nan", math.nan), topic("/fast", 100.0, 0))
    assert [each.name for each in topic_rows(found)] == ["/fast", "/slow", "/nan", "/none"]
    assert topic_rows(found, order=TopicOrder.LOST)[0].name == "/slow"
    assert [each.name for each in topic_rows(found, order=TopicOrder.NAME)] == [
        "/fast",
        "/nan",
        "/none",
        "/slow",
    ]


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("/robot/*/camera", ["/robot/1/camera"]),
        ("CAM", ["/robot/1/camera"]),
        ("/robot/**", ["/robot/1/camera"]),
    ],
)
def test_rows_are_filtered_by_pattern_or_substring(pattern: str, names: list[str]) -> None:
    found = graph(topic("/robot/1/camera"), topic("/odom"))
    assert [each.name for each in topic_rows(found, pattern)] == names


def test_nodes_show_the_sum_of_their_publishers_and_are_sorted_by_rate() -> None:
    found = graph(
        topic("/a", publishers=(PUBLISHER, replace(PUBLISHER, id=2, rate_hz=None))),
        topic("/b", publishers=(replace(PUBLISHER, rate_hz=5.0), replace(PUBLISHER, node_id="gone"))),
    )
    assert [(node.name, hz) for node, hz in node_rows(found)] == [("arm", None), ("camera", 35.0)]


def test_output_is_a_table_for_a_file_and_a_json_line_with_the_json_option(
    master: Master, type_in: TypeIn
) -> None:
    node = nep.Node("teller")
    publisher = node.new_pub("/odom", "json")
    node.new_sub("/odom", "json")
    node.new_pub("/other", "json")
    publisher.publish({"x": 1})
    eventually(lambda: {"/odom", "/other"} <= view(master.address).topics.keys())
    done = type_in("top", "odom", "--count", "1")
    assert done.returncode == 0, done.stderr
    (row,) = [line for line in done.stdout.splitlines() if line.startswith("/odom")]
    assert row.split()[1:3] == ["json", "teller"]
    assert "/other" not in done.stdout
    assert [line for line in done.stdout.splitlines() if line.startswith("teller")]
    told = json.loads(type_in("top", "--json", "-n", "1").stdout)
    assert {"/odom", "/other"} <= {each["name"] for each in told["topics"]}
    assert "teller" in {each["name"] for each in told["nodes"]}
    node.close()


def test_unreachable_master_address_is_reported(type_in: TypeIn) -> None:
    done = type_in("top", "--count", "1", "--master", "127.0.0.1:1")
    assert done.returncode == 1
    assert "127.0.0.1:1" in done.stderr


def test_lost_master_is_reported_and_the_last_values_stay_visible(
    monkeypatch: pytest.MonkeyPatch, type_in: TypeIn
) -> None:
    with Master("127.0.0.1:0", learn_s=0.0) as master:
        node = nep.Node("teller", master=master.address)
        node.new_pub("/odom", "json")
        eventually(lambda: "/odom" in view(master.address).topics)
        seen = view(master.address)
        node.close()
        monkeypatch.setattr(top, "view", lambda _address: views.pop(0)())

        def gone() -> GraphView:
            return view("127.0.0.1:1", 0.01)

        views = [lambda: seen, gone, lambda: seen]
        done = type_in("top", "--every", "0.2", "--count", "3", "--master", master.address)
    assert done.returncode == 0
    assert "127.0.0.1:1" in done.stderr
    assert sum(line.startswith("/odom") for line in done.stdout.splitlines()) == 2


def test_terminal_view_fits_reports_hidden_rows_and_marks_new_losses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("LINES", "20")
    monkeypatch.setenv("COLUMNS", "100")
    out = io.StringIO()
    screen = Console(file=out, force_terminal=True, width=100, height=20, color_system="standard")
    live = Live(console=screen, auto_refresh=False)
    shown = top._LiveTables(top._GraphPrinter("", TopicOrder.NAME), live)
    many = [topic(f"/t{number:02}", 1.0, 0) for number in range(50)]
    with live:
        shown.show(graph(*many), "")
        before = out.tell()
        shown.show(graph(replace(many[0], lost=3), *many[1:]), "the master has gone")
        painted = out.getvalue()[before:]  # before the context exits, which renders once more
    assert "the master has gone" in painted
    assert "(+39)" in painted  # 11 of 50 rows fit
    assert "camera" in painted
    row = next(line for line in painted.splitlines() if "/t00" in line)
    assert "33m3" in row  # yellow
    assert "33m" not in next(line for line in painted.splitlines() if "/t01" in line)
    lines = [
        line for line in painted.splitlines() if "\x1b[1A" not in line
    ]  # without the lines that erase the previous frame
    assert sum("/t" in line for line in lines) == 11
    assert len(lines) <= 20
