"""Tests of the alarm file: rules round-trip, and errors are reported with their line."""

from __future__ import annotations

import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nep.errors import NepError
from nep.programs.alarms import AlarmAction, AlarmFile, AlarmRule
from nep.programs.alarms.history import ActionResult, AlarmHistory, AlarmRecord, record_to_plain
from nep.programs.alarms.rule import (
    ACTION_KINDS,
    KINDS,
    KINDS_WITH_LIMIT,
    NODE_KINDS,
    VALUE_KINDS,
    problem_of,
)
from nep.programs.alarms.rule_file import EXAMPLE, encode_alarms, parse_alarms, read_alarms
from nep.programs.alarms.sentences import rule_text
from tests.nep.alarms.scene import rule


def read(text: str, **how: bool) -> AlarmFile:
    return parse_alarms(text.encode("utf-8", "surrogatepass"), "f.json", **how)


def of(*alarms: object) -> str:
    return json.dumps({"format": 1, "alarms": list(alarms)}, indent=1)


def every_rule() -> list[AlarmRule]:
    actions = tuple(
        AlarmAction(kind, "name" if kind in {"run", "call", "send"} else "", {} if kind == "call" else None)
        for kind in ACTION_KINDS
    )
    made = []
    for kind in KINDS:
        more: dict[str, object] = {"id": kind, "for_s": 3.0}
        if kind in VALUE_KINDS:
            more["path"] = "a[0].b"
        if kind in KINDS_WITH_LIMIT:
            more["limit"] = 5
        made.append(rule(kind, "n" if kind in NODE_KINDS else "/t", *actions, **more))
    return made


def test_every_rule_round_trips() -> None:
    rules = every_rule()
    rules[0] = rule("silent", "/t", for_s=2.0, is_enabled=False, calm_s=9.0, snoozed_until_s=5.0)
    rules.append(rule("is_not", "/t", path='["a key"]', limit='“quoted” \n"', margin=0.5, id="text"))
    rules.append(rule("equals", "/t", path=".", limit=True, id="yes"))
    assert [problem_of(each) for each in rules] == [None] * len(rules)
    assert parse_alarms(encode_alarms(rules), "f").rules == tuple(rules)
    assert len({rule_text(each) for each in rules}) == len(rules)


def test_example_file_is_valid() -> None:
    assert len(read(EXAMPLE).rules) == 5


@pytest.mark.parametrize(
    ("alarm", "said"),
    [
        (
            {"when": {"topic": "/t", "is": "bellow", "than": 1}},
            "unknown condition 'bellow'; did you mean 'below'",
        ),
        ({"when": {"topic": "/t"}}, "alarms[2].when: the condition is missing"),
        ({"when": {"is": "silent"}}, "the topic name is missing"),
        ({"when": {"node": "n", "is": "silent"}}, "'silent' needs a topic"),
        ({"when": {"topic": "/t", "is": "below", "value": "x"}}, 'write "than"'),
        ({"when": {"topic": "/t", "is": "below", "value": "x", "than": "1"}}, "must be a number"),
        (
            {"when": {"topic": "/t", "is": "below", "value": "x[", "than": 1}},
            "'x[' isn't a valid field path; use a path such as 'pose.x' or 'joints[3]'",
        ),
        ({"when": {"topic": "/t", "is": "above", "value": "", "than": 1}}, "needs a name"),
        ({"when": {"topic": "/a b", "is": "silent"}}, "alarms[2].when.topic: "),
        ({"when": {"topic": "/*/b", "is": "silent"}}, "wildcards"),
        ({"when": {"topic": "/t", "is": "silent", "for_s": 0}}, "0.1 to 86400"),
        ({"when": {"topic": "/t", "is": "silent", "for_s": -1}}, "0.1 to 86400"),
        ({"when": {"topic": "/t", "is": "silent", "for_s": True}}, "must be a number"),
        ({"when": {"topic": "/t", "is": "loses", "than": 101}}, "0 to 100"),
        ({"when": {"topic": "/t", "is": "rate_below", "than": 0}}, "0.001 to 1e+06"),
        ({"when": {"topic": "/t", "is": "silent"}, "do": ["baner"]}, "did you mean 'banner'"),
        ({"when": {"topic": "/t", "is": "silent"}, "do": [{"cal": "x"}]}, "an action must be"),
        ({"when": {"topic": "/t", "is": "silent"}, "do": [{"call": ""}]}, "do[1].call: the name is missing"),
        ({"when": {"topic": "/t", "is": "silent"}, "do": ["stop", {"run": 1}]}, "do[2].run: must be"),
        ({"when": {"topic": "/t", "is": "silent"}, "do": [{"keep_s": 1, "run": "x"}]}, "do[1].run: unknown"),
        ({"when": {"topic": "/t", "is": "silent", "margin": "1"}}, "when.margin: must be a number"),
        ({"when": {"topic": "/t", "is": "silent"}, "on": 1}, "alarms[2].on: must be true or false"),
        ({"when": {"topic": "/t", "is": "silent"}, "id": "x" * 65}, "id: must be a string of at most 64"),
        ({"when": {"topic": "/t", "is": "silent"}, "do": ["stop"] * 11}, "at most 10 actions"),
        ({"when": {"topic": "/t", "is": "silent"}, "calm_s": 0}, "0.5 to 3600"),
        ({"when": {"topic": "/t", "is": "silent"}, "onn": True}, "[2].onn: unknown key; did you mean 'on'"),
        ([], ": not an alarm;"),
    ],
)  # fmt: skip
def test_invalid_alarm_is_rejected_with_its_line(alarm: object, said: str) -> None:
    good = {"when": {"topic": "/t", "is": "silent"}, "do": ["banner"]}
    text = of(good, alarm)
    with pytest.raises(NepError) as error:
        read(text)
    assert said in str(error.value)
    line = int(str(error.value).split()[1])
    begin = text[: text.index("silent")].count("\n") + 4
    assert begin <= line <= text.count("\n") + 1
    kept = read(text, lenient=True)
    assert len(kept.rules) == 1
    assert said in kept.problems[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "'f.json' isn't valid JSON: line 1"),
        ('{"alarms": [\n{"when": }]}', "'f.json' isn't valid JSON: line 2, column 9"),
        ("[]", ": not an alarm file;"),
        ('{"format": 2, "alarms": []}', "newer version"),
        ('{"format": true, "alarms": []}', "line 1 of 'f.json', format: must be 1"),
        ('{"alarm": []}', "alarm: unknown key; did you mean 'alarms'"),
        ('{"format": 1}', "alarms: the list of alarms is missing"),
        ('{"alarms": [' + "1" * 5000 + "]}", ""),
        ("[" * 100_000, ""),
        (json.dumps({"alarms": [{}] * 201}), "more than 200"),
    ],
)
def test_invalid_alarm_file_is_rejected_also_in_lenient_mode(text: str, said: str) -> None:
    for lenient in (False, True):
        if lenient and "1" * 5000 in text:
            continue
        with pytest.raises(NepError, match=r"f\.json") as error:
            read(text, lenient=lenient)
        assert said in str(error.value)


def test_non_utf_8_missing_and_oversized_files_are_rejected(tmp_path) -> None:
    with pytest.raises(NepError, match=r"line 2 of 'f' .*UTF-8"):
        parse_alarms(b'{\n"\xff": 1}', "f")
    with pytest.raises(NepError, match="can't be read"):
        read_alarms(tmp_path / "none.json")
    with pytest.raises(NepError, match="too large for an alarm file"):
        parse_alarms(b" " * 4_000_001, "f")


def test_duplicate_alarm_id_is_rejected() -> None:
    alarm = {"id": "a", "when": {"topic": "/t", "is": "silent"}}
    with pytest.raises(NepError, match=r"line 12 of .*, alarms\[2\]\.id: another alarm"):
        read(of(alarm, alarm))


def test_history_round_trips_and_damaged_records_are_skipped() -> None:
    history = AlarmHistory([AlarmRecord("a", "x is 1", 12.5, 3.0, count=2, was_snoozed=True)])
    history.records[0].add(ActionResult("call", "not responding"))
    history.records[0].add(ActionResult("call", "answered"))
    again = parse_alarms(encode_alarms([], history), "f").history
    assert again is not None
    assert [record_to_plain(each) for each in again] == [record_to_plain(each) for each in history]
    assert again.records[0].action_results == [ActionResult("call", "answered")]
    strange = [
        None,
        {},
        {"alarm": 1, "words": "", "at_s": 1},
        {"alarm": "a", "words": "w", "at_s": 1e300},
        {"alarm": "a", "words": "w", "at_s": 1, "did": [1, ["a"], "x"], "count": -1, "lasted_s": "no"},
    ]
    found = read(json.dumps({"alarms": [], "history": strange})).history
    assert found is not None
    assert [(each.cause, each.action_results, each.count, each.duration_s) for each in found] == [
        ("w", [], 1, None)
    ]


KEYS = st.sampled_from(["when", "do", "topic", "node", "is", "than", "for_s", "value", "on", "id", "call"])
FLAT = st.sampled_from(
    [None, True, False, math.nan, -math.inf, -0.0, 1e300, 0, -1, 2**64 - 1, 10**400, "", "\ud800", "“",
     "topic", "is", "silent", "when", "banner", "/t", "below", "call", [], {}]
)  # fmt: skip
"""Scalars to choose from; `hypothesis` takes far longer to generate deep values than they take to parse."""
DEEPER = FLAT | st.lists(FLAT, max_size=2) | st.dictionaries(KEYS, FLAT, max_size=4)
VALUES = DEEPER | st.lists(DEEPER, max_size=2) | st.dictionaries(KEYS, DEEPER, max_size=4)


@given(st.lists(VALUES, max_size=3))
def test_every_alarm_in_a_file_is_loaded_or_reported(alarms: list[object]) -> None:
    text = json.dumps({"alarms": alarms})
    kept = read(text, lenient=True)
    assert len(kept.rules) + len(kept.problems) == len(alarms)
    assert parse_alarms(encode_alarms(kept.rules), "f").rules == kept.rules
