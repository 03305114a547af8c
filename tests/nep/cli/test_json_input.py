"""Tests of JSON on the command line: errors name the position and the reason, and their advice works."""

from __future__ import annotations

import math
import re
import shlex

import pytest

from nep.cli.json_input import parse_json
from nep.cli.topics.publish import parse_payload
from nep.errors import NepError


def error_of(text: str, **named) -> str:
    with pytest.raises(NepError) as raised:
        parse_json(text, **named)
    return str(raised.value)


def test_incomplete_json_error_names_its_end_without_advice_about_quotes():
    said = error_of('{"fix": {"lat": 35.7}', suggest_types=True)
    assert "line 1, column 22" in said
    assert "quotes" not in said
    assert "--type" not in said


def test_nan_error_suggests_msgpack_which_accepts_it():
    assert error_of('{"lat": NaN}', suggest_types=True).endswith("use null, or use --type msgpack")
    assert "--type" not in error_of('{"lat": NaN}')
    value = parse_payload('{"lat": NaN}', "msgpack")
    assert isinstance(value, dict)
    assert math.isnan(value["lat"])


def test_second_json_value_is_an_error_with_its_position():
    assert "line 2, column 9" in error_of('{"a": 2}{"a": 3}', first_line=2)


def test_json_error_in_a_file_names_the_file_and_line(tmp_path):
    file = tmp_path / "pose.json"
    file.write_text('\ufeff{\n"a": 1,\n}', "utf-8")
    with pytest.raises(NepError, match=r"pose\.json' .* line 2, column 7"):
        parse_payload(f"@{file}", "json")
    assert "--type string" not in error_of("hello", file="x")


@pytest.mark.parametrize("text", ["hello", "it's 5 o'clock", 'say "hi"', "$HOME", "Grüße", "\x1b[31m"])
def test_quoting_advice_is_valid_json_after_shell_parsing(text, monkeypatch):
    monkeypatch.setattr("os.name", "posix")
    said = error_of(text, suggest_types=True)
    assert "--type string" in said
    assert "\x1b" not in said
    advice = re.search(r"such as (.*), or use", said)
    assert advice is not None
    assert parse_json(*shlex.split(advice[1])) == text
