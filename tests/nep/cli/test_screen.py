from __future__ import annotations

import io
import json

import pytest
from rich.cells import cell_len

from nep.cli.screen import (
    UNKNOWN,
    TextColumn,
    format_bandwidth,
    format_rate,
    format_rounded_duration,
    format_size,
    print_error_message,
    show_alerts,
    show_json,
    show_table,
)
from nep.protocol.graph_view import Alert, SubscriberInfo, TopicInfo


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, UNKNOWN), (0.0, "0.0 /s"), (29.97, "30.0 /s"), (123.4, "123 /s"), (45_000.0, "45000 /s")],
)
def test_rates_are_formatted(value, text):
    assert format_rate(value) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, UNKNOWN),
        (0, "0 B"),
        (999, "999 B"),
        (1500, "1.5 kB"),
        (250_000, "250 kB"),
        (8_300_000, "8.3 MB"),
        (2e10, "20.0 GB"),
    ],
)
def test_sizes_are_formatted(value, text):
    assert format_size(value) == text


@pytest.mark.parametrize(
    ("seconds", "text"), [(-1, "0 s"), (59, "59 s"), (300, "5 min"), (7200, "2.0 h"), (200_000, "2.3 d")]
)
def test_durations_are_formatted(seconds, text):
    assert format_rounded_duration(seconds) == text


def test_table_has_a_header_and_one_row_per_entry(capsys):
    show_table(
        [TextColumn("topic"), TextColumn("rate", "right")],
        [("/camera", "30.0 /s"), ("[red]odd[/red]", UNKNOWN)],
    )
    lines = capsys.readouterr().out.splitlines()
    assert "topic" in lines[0]
    assert any("/camera" in line and "30.0 /s" in line for line in lines)
    assert any("[red]odd[/red]" in line for line in lines)


def test_long_table_is_aligned_like_a_short_one(capsys):
    columns = [TextColumn("topic"), TextColumn("rate", "right")]
    rows = [(f"/robot{number}", f"{number}.0 /s") for number in range(1000)]
    show_table(columns, rows)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1002
    assert lines[0].split() == ["topic", "rate"]
    assert lines[2].index("0.0 /s") == lines[11].index("9.0 /s")
    assert lines[-1] == "/robot999   999.0 /s"
    show_table(columns, [*rows, ("/two\nlines", "1.0 /s")])
    assert "lines" in capsys.readouterr().out


def test_long_topic_is_not_wrapped_on_a_narrow_terminal(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "72")
    monkeypatch.setenv("FORCE_COLOR", "1")
    columns = [
        TextColumn("topic", is_folded_last=True),
        TextColumn("type"),
        TextColumn("subscribers"),
        TextColumn("rate", "right"),
    ]
    show_table(
        columns, [("/Pepper/a_very_long_name_of_a_topic", "robot/description", "nep-topic-echo-1", "30.0 /s")]
    )
    out = capsys.readouterr().out
    assert "/Pepper/a_very_long_name_of_a_topic" in out
    assert "30.0 /s" in out


def test_output_to_a_file_or_pipe_is_not_wrapped(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    show_table([TextColumn("topic"), TextColumn("publishers")], [("t" * 50, "p" * 50)])
    assert "p" * 50 in capsys.readouterr().out


def test_alerts_are_printed_to_stderr_with_advice(capsys):
    show_alerts([Alert("port:7000", "Port 7000 is taken", "Close that program.")])
    captured = capsys.readouterr()
    assert not captured.out
    assert "Port 7000 is taken" in captured.err
    assert "Close that program." in captured.err


def test_error_is_one_sentence_on_stderr(capsys):
    print_error_message("no master answers")
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "nep: no master answers\n")


def test_json_is_one_line_also_with_bytes_number_keys_and_nan(capfdbinary):
    show_json({1: b"\x00\xff", "a": float("nan"), "text": "Grüße\n日本"})
    line = capfdbinary.readouterr().out
    assert line.count(b"\n") == 1
    assert json.loads(line) == {"1": "00ff", "a": None, "text": "Grüße\n日本"}


def test_terminal_too_narrow_for_a_table_shows_rows_as_blocks(monkeypatch):
    class Terminal(io.StringIO):
        encoding = "utf-8"

        def isatty(self):
            return True

    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setattr("sys.stdout", screen := Terminal())
    columns = [
        TextColumn("topic", is_folded_last=True),
        TextColumn("type"),
        TextColumn("publishers"),
        TextColumn("rate", "right"),
    ]
    show_table(
        columns, [("/Pepper/battery", "json", "one\ntwo", UNKNOWN), ("/b", "string", UNKNOWN, "1.0 /s")]
    )
    assert screen.getvalue() == (
        "/Pepper/battery\n  type: json\n  publishers: one, two\n/b\n  type: string\n  rate: 1.0 /s\n"
    )


WIDE = [("/日本語カメラ", "1"), ("/e\u0301te\u0301", "2"), ("/😀😀", "3"), ("/plain", "4")]


@pytest.mark.parametrize("rows", [WIDE, WIDE * 60], ids=["short", "long"])
def test_columns_with_wide_and_combining_characters_are_aligned(rows, capsys):
    show_table(
        [TextColumn("topic"), TextColumn("rate"), TextColumn("lost", "right")], [(*row, "9") for row in rows]
    )
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("/")]
    assert len(lines) == len(rows), "each takes one line"
    ends = {cell_len(line.rstrip()) for line in lines}
    starts = {cell_len(line[: line.index(number)]) for line, (_, number) in zip(lines, rows, strict=True)}
    assert len(ends) == 1
    assert len(starts) == 1


def test_wide_characters_are_not_truncated_if_they_fit(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "30")
    show_table(
        [TextColumn("topic", is_folded_last=True), TextColumn("type")],
        [("/" + "日本" * 5, "a/type/that/is/folded")],
    )
    assert "/" + "日本" * 5 in capsys.readouterr().out


def test_bandwidth_without_subscribers_is_unknown_unless_the_rate_is_zero():
    subscriber = SubscriberInfo(1, "n", 0, 0)
    assert "B/s" not in format_bandwidth(TopicInfo("/t", "json", "json", rate_hz=50.0, bandwidth_Bps=0.0))
    heard = TopicInfo("/t", "json", "json", (), (subscriber,), rate_hz=50.0, bandwidth_Bps=0.0)
    assert format_bandwidth(heard) == "0 B/s"
    assert format_bandwidth(TopicInfo("/t", "json", "json", rate_hz=0.0, bandwidth_Bps=0.0)) == "0 B/s"
