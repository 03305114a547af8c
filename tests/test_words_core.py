"""Tests that texts of the core, robots and nep are translated; the pseudo-language shows plain texts."""

from __future__ import annotations

import io
import logging
import re
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast, get_args

import pytest
from msgpack import packb  # type: ignore[import-untyped]

from app import errors as app_errors
from app.core.alerts.alerts import Alerts
from app.core.network import graph_changes
from app.core.network.decode_checks import CheckResult
from app.core.network.remote_access import RemoteAccess, RemoteAccessChanged
from app.core.network.topics import Topic, Topics
from app.core.projects.file_format import parse_file
from app.core.robots.fleet import Fleet
from app.core.robots.health import RESTART_TIMEOUT_S, Health
from app.core.robots.health_facts import health_items
from app.core.robots.motion.permission import MayNotMoveError, PermissionQuestion
from app.core.robots.reported_count import ReportedCount
from app.core.robots.robot_link import RobotLink
from app.core.run.view import RunState, clock_text, stop_text, view_of
from app.errors import DocumentError
from app.robots import simulated
from app.robots.client.stop_report import RobotStop, StopReport, unreached_result
from app.robots.description.description import parse, thing_description
from app.robots.description.inputs import Parameter, check_input, value_problem
from app.robots.description.validate import validate
from app.robots.driver.tasks import still_moving_message
from app.robots.identity import is_may_move_error, stop_error_text
from app.run import stop_lines
from nep import errors as nep_errors
from nep.i18n import _
from nep.nodes.log_handler import LogHandler
from nep.programs.doctor import Facts, findings
from nep.programs.doctor.facts import (
    ClockFact,
    FileFact,
    FolderFact,
    PackageFact,
    PortFact,
    ProcessFact,
    ProgramFact,
    ReachFailure,
)
from nep.protocol.encoding import decode_reply, decode_request
from nep.protocol.graph_view import GraphView, NodeInfo, PublisherInfo, TopicInfo
from nep.system.terminal import Terminal
from tests.pseudo import untranslated

PEPPER = parse(thing_description(simulated.ROBOT.thing_model, "Pepper"))
DONE = RobotStop("Pepper", True, 38.2)
SILENT = RobotStop("Turtle", False, None)
REFUSED = RobotStop("Turtle", False, 3.0, error="Xx", has_failed=True, program="zz")
RIZE = RobotStop("Nao", False, None, can_confirm=False)
LISTENS = RobotStop("Turtle", False, None, can_confirm=False, program="zz")
DATA = ("Turtle", "Nao", "Xx", "zz", "Greeting")

pytestmark = pytest.mark.usefixtures("pseudo")


def said(*texts: object, data: tuple[str, ...] = ()) -> None:
    """Fail if a text contains English words that are not data."""
    forgotten = {text: words for text in map(str, texts) if (words := untranslated(text, *DATA, *data))}
    assert forgotten == {}


def reports() -> list[StopReport]:
    one = [DONE, SILENT, REFUSED, RIZE, LISTENS, unreached_result("Turtle"), unreached_result("Turtle", "Xx")]
    many = [tuple(RobotStop(f"Turtle{number}", False, None) for number in range(9))]
    mixed = [(DONE, SILENT), (DONE, RIZE), (DONE, REFUSED), (DONE, replace(DONE, name="Turtle")), ()]
    return [
        StopReport(robots, 41.0, (("Pepper", "zz"),))
        for robots in (*((each,) for each in one), *many, *mixed)
    ]


def test_run_bar_is_translated_in_all_states() -> None:
    states = [
        RunState(),
        RunState(unrunnable_program=object()),
        RunState(unrunnable_program=object(), errors={"a": "Xx"}),
        RunState("running", "Greeting", is_started=False),
        RunState("running", "Greeting"),
        RunState("paused", "Greeting"),
        RunState("paused", "Greeting", paused_at="Xx"),
        RunState("stopping", "Greeting", elapsed_s=3.0, robots_to_stop=("Turtle", "Pepper"), replies=(DONE,)),
        RunState("proven", "Greeting", elapsed_s=3.0, errors={"a": "Xx"}),
        RunState("proven", "Greeting", is_finished=True),
        RunState("proven", "Greeting", has_stopped_blocks=True, elapsed_s=100.0),
        *(
            RunState("unanswered" if each.unconfirmed_robots else "proven", "Greeting", report=each)
            for each in reports()
        ),
    ]
    for state in states:
        for now in (0.01, 9.0):
            for elsewhere in (False, True):
                view = view_of(state, ["Pepper", "Turtle"], now, is_elsewhere=elsewhere)
                said(view.title, view.detail, view.compact_text, view.result or "", view.confirm_label or "")
                said(_(view.run_label), _(view.stop_label))
    said(view_of(RunState(), [], 0).detail)


def test_stop_reports_are_translated() -> None:
    for report in reports():
        said(*stop_lines(report), *(robot.message for robot in report.robots))
        said(*(stop_text(robot, clock_text(time.localtime(0))) for robot in report.robots))


def test_robot_that_may_still_move_is_recognized_in_english_and_the_pseudo_language() -> None:
    ours = still_moving_message("Turtle", ["Xx"])
    said(ours, stop_error_text("Turtle", None))
    assert stop_error_text("Turtle", ours) == ours
    assert is_may_move_error("Turtle", ours)
    assert stop_error_text("Turtle", "Turtle may still move: Xx") == "Turtle may still move: Xx"


def test_health_facts_of_robots_are_translated() -> None:
    topics = {sensor.topic: Topic(sensor.topic) for sensor in PEPPER.sensors}
    link = RobotLink("Pepper", PEPPER)
    sensors = tuple(sensor.title for sensor in PEPPER.sensors)
    links = [
        link,
        replace(link, is_connected=False),
        replace(link, is_connected=False, gone_s=3.0),
        replace(link, is_unresponsive=True),
        replace(link, is_unresponsive=True, last_reply_s=3.0),
        replace(link, last_reply_s=3.0, is_stopping=True, values={"battery": 4}),
        replace(link, values={"battery": 80}),
        replace(link, rejected_messages=ReportedCount(12, 8.0), driver_exceptions=ReportedCount(1)),
    ]
    for each in links:
        for silent_s in (None, 99.0):
            for topic in topics.values():
                topic.silent_s, topic.age_s, topic.rate_hz = silent_s, silent_s, 3.0
            each.silence_reason = "" if silent_s else None
            facts = health_items(each, cast("Topics", topics), 9.0, lambda age_s: f"{age_s:g} s")
            said(*(_(fact.title) for fact in facts), *(fact.text for fact in facts), data=sensors)
        said(each.state_label)


def test_health_alerts_are_translated() -> None:
    alerts, now = Alerts(), [0.0]
    real = replace(PEPPER, virtual=False)
    links = [
        SimpleNamespace(
            name=name,
            robot=robot,
            is_virtual=robot.virtual,
            is_connected=on,
            unended_actions="",
            rejected_messages=ReportedCount(12, now[0]),
            driver_exceptions=ReportedCount(1, now[0]),
            motion_warning="",
            stop_problem="",
            silence_reason=None,
        )
        for name, robot, on in (
            ("Nao", real, False),
            ("Turtle", PEPPER, False),
            ("Pepper", real, False),
            ("Xx", real, True),
        )
    ]
    fleet = cast("Fleet", SimpleNamespace(links=links, claims={}))
    health = Health(Topics(), fleet, alerts, lambda: now[0])
    health.check({"Pepper"}, {"Turtle"})
    now[0] = RESTART_TIMEOUT_S + 1
    health.check({"Pepper"}, {"Turtle"})
    for unchecked in (0, 7):
        health.update({f"/{unchecked}": CheckResult(3, 2, unchecked, "Xx", is_newest_readable=False)})
    health.report_journal_problem("Xx")
    health.confirm_discard("Greeting", "Xx")
    health.report_settings_problem("Xx")
    health.update_unreachable({"Nao": "Xx"})
    assert len(alerts.active) >= 8
    for alert in alerts.active:
        said(alert.title, alert.detail, alert.button or "")


def test_graph_changes_are_translated() -> None:
    def node(name: str, generation: str = "native") -> NodeInfo:
        return NodeInfo(name, name, "lab", 1, "Python", generation, 0)

    def view(*nodes: NodeInfo, topics: int = 0) -> GraphView:
        by = (PublisherInfo(1, nodes[0].id, (), False, 0, 0, 0, None, None, None),) if nodes else ()
        here = {f"/{place}": TopicInfo(f"/{place}", "json", "json", by) for place in range(topics)}
        return GraphView(1, 1, {each.id: each for each in nodes}, here, ())

    many = [node(f"Nao{number}") for number in range(20)]
    for before, after in (
        (view(), view(node("Nao"))),
        (view(), view(node("Nao", "A"))),
        (view(), view(node("Nao"), topics=9)),
        (view(node("Nao")), view(node("Nao"), topics=1)),
        (view(node("Nao")), view(node("Nao"), topics=20)),
        (view(node("Nao")), view()),
        (view(), view(*many)),
        (view(*many), view()),
    ):
        lines = graph_changes.change_messages(before, after)
        assert lines
        said(*lines)


def test_permission_question_and_errors_are_translated() -> None:
    question = PermissionQuestion({"Nao": ("Xx",), "Turtle": ("Xx", "zz")}, lambda: None)
    said(question.title, question.message, MayNotMoveError(["Nao", "Turtle"]))
    said(
        app_errors.SettingsError(Path("/Xx"), "Xx"),
        app_errors.DescriptionError("Xx", ("zz", "zz")),
        app_errors.DescriptionError("Xx", ()),
        app_errors.UnknownRobotError("Nao"),
        nep_errors.WaitTimeoutError("Xx", 1.5),
        nep_errors.ClosedError("Xx"),
        nep_errors.ClosedError("Xx", is_forked=True),
        nep_errors.UnknownBackendError("Xx", ["zz"]),
        nep_errors.TooManyFilesError("Xx", 1, 2),
        nep_errors.TooManyFilesError("Xx", None, None),
        nep_errors.AddressInUseError("zz:*"),
        nep_errors.AddressInUseError("zz:1", is_own=False),
        data=("ulimit",),
    )


@pytest.mark.parametrize(
    "content", [b"", b"{}", b'{"format": "nep-behaviour"}', b'{"format": "nep-behaviour", "version": 99}']
)
def test_errors_of_invalid_behaviour_files_are_translated(content: bytes) -> None:
    with pytest.raises(DocumentError) as caught:
        parse_file(content, Path("/Xx"))
    said(caught.value, data=("nepb",))


def test_errors_of_rejected_values_are_translated() -> None:
    number = Parameter("zz", "Xx", "number", minimum=1.0, maximum=9.0)
    text = Parameter("zz", "Xx", "text", min_length=2, max_length=3)
    items = Parameter("zz", "Xx", "list", min_length=2, max_length=3, item=number)
    for parameter, values in (
        (number, (0, "a", None)),
        (replace(number, maximum=None, unit="m"), (0,)),
        (replace(number, minimum=None), (99,)),
        (replace(number, kind="integer"), (1.5, "a")),
        (replace(number, kind="boolean"), (1,)),
        (replace(number, kind="colour"), (1,)),
        (text, ("", "abcd", 1)),
        (replace(text, min_length=1), ("",)),
        (items, ((), (1, 2, 3, 4), 1, (1, "a"))),
        (replace(items, max_length=2), ((1,),)),
        (Parameter("zz", "Xx", "object", fields=(number,)), (1, {"z": 3})),
    ):
        for value in values:
            wrong = value_problem(parameter, value)
            assert wrong is not None
            said(wrong)
    said(*check_input("Xx", (replace(number, is_required=True),), {"zy": 1}), data=("zy",))
    said(*check_input("Xx", (), 3))


def test_errors_of_invalid_descriptions_are_translated() -> None:
    good = simulated.ROBOT.thing_model
    for wrong in (
        3,
        {},
        {**good, "title": ""},
        {**good, "title": "a\u202eb"},
        {**good, "actions": 3},
        {**good, "x": {"$ref": "y"}},
        {**good, "x": float("nan")},
        {**good, "rb:safeStop": {"action": "zz"}},
    ):
        problems = validate(wrong)
        assert problems
        told = [re.sub(r"'[^']*'", "", problem) for problem in problems]  # quoted names aren't translated
        said(*told, data=("title", "actions", "ref", "rb:safeStop", "rb:profile", "safeStop"))


def test_doctor_findings_are_translated() -> None:
    now = 1_800_000_000.0
    master = ProcessFact(41, "zz", is_master=True, started_s=now - 7200)
    other = ProcessFact(77, "zz", started_s=now - 5)
    people = GraphView(1, 1, {"a": NodeInfo("a", "Nao", "zz", 1, "Python", "0.5.4.6", 0)}, {}, ())
    well = Facts(
        now, "127.0.0.1:7780", "linux", {}, "/zz", people, 0.004, PortFact(7780, "", True, master),
        (PortFact(7000, "", True, master), PortFact(7777, "", True, other), PortFact(12345, "", True, other)),
        ((master, 7780),),
    )  # fmt: skip
    for facts in (
        well,
        replace(well, reply_time_s=9.0, folders=(FolderFact("/zz", "Xx"), FolderFact("/zz", "Xx", "Xx"))),
        replace(well, view=None),
        replace(well, view=None, is_host_known=False),
        replace(well, view=None, master_port=PortFact(7780, "", True, other)),
        replace(well, view=None, master_port=None),
        replace(well, view=None, master_port=None, address="10.0.0.5:7780"),
        *(
            replace(well, view=None, master_port=None, reach_failure=reach)
            for reach in get_args(ReachFailure)
        ),
        replace(well, masters=((master, 7780), (other, None)), loopback_problem="Xx", now_s=1.0),
        replace(well, packages=(PackageFact("nep", "0.1", "/zz"),), is_gateway_enabled=False),
        replace(well, original_files=("zz.py",), shadowing_file="zz.py", clocks=(ClockFact("zz", 3.0),)),
        replace(well, files=FileFact(100, 100, 90, 100), programs=(ProgramFact(1, "zz", 99, 100),)),
    ):
        for finding in findings(facts):
            if finding.id != "versions":
                said(finding.sentence, finding.fix, data=("ip link", "py", "AirDrop", "Handoff"))


def test_remote_access_alerts_are_translated() -> None:
    alerts = Alerts()
    settings = SimpleNamespace(get=lambda _key, default: default, set=lambda _key, _value: None)
    reach = RemoteAccess("127.0.0.1:7780", settings, alerts, lambda _event: None)
    reach.on_changed(RemoteAccessChanged(("127.0.0.1",), "Xx"))
    for alert in alerts.active:
        said(alert.title, alert.detail, alert.button or "")


def test_errors_of_invalid_requests_and_replies_are_translated() -> None:
    for body in (
        packb(3), packb({"do": "xx"}), packb({"do": "leave", "what": []}), packb({"do": "leave"}),
        packb({"do": "leave", "what": {"node_id": 3}}),
    ):  # fmt: skip
        request = decode_request(body).request
        assert isinstance(request, nep_errors.WireError)
        said(request.reason, data=("xx", "Leave", "node_id", "str", "int", "array"))
    no_request = decode_request(b"").request
    assert isinstance(no_request, nep_errors.WireError)
    assert no_request.reason.startswith("[")  # the rest is a message of msgpack
    with pytest.raises(nep_errors.WireError) as caught:
        decode_reply(packb({"is": "xx"}))
    said(caught.value.reason, data=("xx",))


def test_dropped_log_and_terminal_lines_are_reported_in_translation() -> None:
    handler = LogHandler("zz", lambda: pytest.fail("nothing is published"), burst=0)
    handler.emit(logging.LogRecord("x", logging.INFO, "x.py", 1, "x" * 9000, (), None))
    said(handler._drop_record_locked()["text"])
    text = handler._to_plain(logging.LogRecord("x", logging.INFO, "x.py", 1, "x" * 9000, (), None))["text"]
    said(str(text).replace("x", ""))
    handler.close()
    terminal = Terminal(io.StringIO())
    terminal._dropped_lines, terminal._is_closing = 2, True
    said(terminal._next_text())
