"""Tests of surveys, requests to all respondents, over every back end that supports them."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator

import pytest

import nep
from nep.backends.zeromq.transport import ZeromqTransport
from nep.masters.master import Master
from tests.nep.meeting import place_for
from tests.nep.programs import eventually, running

LONG_S = 30.0
LONG_MS = LONG_S * 1000
Make = Callable[[str], nep.Node]


@pytest.fixture(params=["zeromq", "memory", pytest.param("zenoh", marks=pytest.mark.long)])
def make(request: pytest.FixtureRequest, master: Master, patient: None) -> Iterator[Make]:
    """Function that creates nodes in the same network; the nodes are closed after the test."""
    made: list[nep.Node] = []
    where = place_for(request.param, master.address)

    def new(name: str) -> nep.Node:
        made.append(nep.node(name, request.param, master=where))
        return made[-1]

    yield new
    for node in made:
        node.close()


def respond(make: Make, *answers: object) -> list[nep.Respondent]:
    """Create a node with a respondent for each of these replies; an exception is raised instead."""

    def callback(answer):
        def answered(question):
            if isinstance(answer, Exception):
                raise answer
            return {"asked": question, "says": answer}

        return answered

    return [
        make(f"respondent {number}").new_respondent("/who", callback(answer), threads=1)
        for number, answer in enumerate(answers)
    ]


def test_all_existing_respondents_reply(make: Make) -> None:
    respondents = respond(make, 1, 2, 3)
    surveyor = make("surveyor").new_surveyor("/who", LONG_MS)
    answers = surveyor.ask({"n": 0})
    assert sorted(each["says"] for each in answers) == [1, 2, 3]
    assert all(each["asked"] == {"n": 0} for each in answers)
    assert surveyor.respondents == 3
    assert [each.calls for each in respondents] == [1, 1, 1]
    assert (surveyor.failures, surveyor.late) == (0, 0)
    assert respondents[0].survey == surveyor.survey == "/who"


def test_survey_includes_new_respondents_and_excludes_closed_respondents(make: Make) -> None:
    surveyor = make("surveyor").new_surveyor("/who", LONG_MS)
    assert surveyor.ask({}) == []
    first, _second = respond(make, 1, 2)
    eventually(lambda: surveyor.respondents == 2)
    assert len(surveyor.ask({})) == 2
    first.close()
    eventually(lambda: surveyor.respondents == 1)
    assert [each["says"] for each in surveyor.ask({})] == [2]


def test_survey_returns_replies_received_before_its_timeout(make: Make) -> None:
    go_on = threading.Event()
    slow = make("slow").new_respondent("/who", lambda _question: go_on.wait(LONG_S) and "late", threads=1)
    respond(make, 1)
    surveyor = make("surveyor").new_surveyor("/who", 2000)
    assert [each["says"] for each in surveyor.ask({})] == [1]
    assert surveyor.failures == 0
    go_on.set()
    eventually(lambda: slow.calls == 1)
    eventually(lambda: surveyor.late == 1)
    assert len(surveyor.ask({}, LONG_S)) == 2


def test_survey_ends_early_with_the_expected_number_of_replies(make: Make) -> None:
    go_on = threading.Event()
    make("slow").new_respondent("/who", lambda _question: go_on.wait(LONG_S) and "late", threads=1)
    respond(make, 1, 2)
    surveyor = make("surveyor").new_surveyor("/who", None)
    assert len(surveyor.ask({}, expect=2)) == 2
    go_on.set()


def test_replies_are_yielded_in_the_order_received(make: Make) -> None:
    go_on = threading.Event()
    make("slow").new_respondent("/who", lambda _question: go_on.wait(LONG_S) and "late", threads=1)
    respond(make, "quick")
    surveyor = make("surveyor").new_surveyor("/who", LONG_MS)
    answers = surveyor.answers({})
    assert next(answers)["says"] == "quick"
    go_on.set()
    assert list(answers) == ["late"]


def test_failing_respondent_is_counted_and_gives_no_reply(
    make: Make, caplog: pytest.LogCaptureFixture
) -> None:
    respond(make, 1, LookupError("no eyes"))
    surveyor = make("surveyor").new_surveyor("/who", LONG_MS)
    assert [each["says"] for each in surveyor.ask({})] == [1]
    assert surveyor.failures == 1
    assert "a respondent of '/who' failed (1 so far): LookupError: no eyes" in caplog.text


def test_concurrent_surveys_of_several_surveyors_and_threads_receive_all_replies(make: Make) -> None:
    respond(make, *range(5))
    surveyors = [make(f"surveyor {n}").new_surveyor("/who", LONG_MS) for n in range(3)]
    counts: list[int] = []

    def ask(surveyor: nep.Surveyor, n: int) -> None:
        counts.extend(len(surveyor.ask([n, again])) for again in range(5))

    threads = [
        threading.Thread(target=ask, args=(surveyor, n), name=f"asker-{n}")
        for n, surveyor in enumerate(surveyors * 2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LONG_S)
    assert counts == [5] * 30


def test_respondent_replies_in_the_spinning_thread(make: Make) -> None:
    node = make("respondent")
    node.new_respondent("/who", lambda _question: threading.current_thread().name)
    spinner = threading.Thread(target=node.spin, name="spinner")
    spinner.start()
    assert make("surveyor").new_surveyor("/who", LONG_MS).ask({}) == ["spinner"]
    node.stop_spin()
    spinner.join(LONG_S)


def test_send_json_and_listen_json_work_as_in_the_original_nep(make: Make) -> None:
    respondent = make("respondent").new_respondent("/who")
    surveyor = make("surveyor").new_surveyor("/who", LONG_MS)
    assert respondent.listen_json() == (False, {})
    with pytest.raises(nep.NepError, match="'send_json'"):
        surveyor.listen_json()
    surveyor.send_json({"n": 1})
    assert respondent.listen_json(block_mode=True) == (True, {"n": 1})
    respondent.send_json({"me": 1})
    assert surveyor.listen_json() == (True, {"me": 1})
    assert surveyor.listen_json() == (False, {})
    surveyor.send_json(None)
    assert respondent.listen_json(block_mode=True) == (True, None)


def test_closing_the_surveyor_ends_its_survey(make: Make) -> None:
    has_waiting_calls, go_on = threading.Event(), threading.Event()

    def answer(_question):
        has_waiting_calls.set()
        return go_on.wait(LONG_S)

    make("slow").new_respondent("/who", answer, threads=1)
    surveyor = make("surveyor").new_surveyor("/who", None)
    errors: list[BaseException] = []

    def ask() -> None:
        try:
            surveyor.ask({})
        except nep.NepError as error:
            errors.append(error)

    asker = threading.Thread(target=ask, name="asker")
    asker.start()
    assert has_waiting_calls.wait(LONG_S)
    surveyor.close()
    surveyor.close()
    asker.join(LONG_S)
    assert isinstance(errors[0], nep.ClosedError)
    with pytest.raises(nep.ClosedError, match="surveyor of '/who' is closed"):
        surveyor.ask({})
    go_on.set()


def test_closing_node_closes_its_surveys(make: Make) -> None:
    a, b = make("a"), make("b")
    respondent = a.new_respondent("/who", lambda _question: 1, threads=1)
    surveyor = b.new_surveyor("/who", LONG_MS)
    assert surveyor.ask({}) == [1]
    a.close()
    b.close()
    assert respondent.is_closed
    assert surveyor.is_closed
    with pytest.raises(nep.ClosedError):
        b.new_surveyor("/who")
    with pytest.raises(nep.ClosedError):
        a.new_respondent("/who")


def test_surveys_are_listed_in_the_graph_and_raise_no_alert(make: Make) -> None:
    respond(make, 1, 2)
    node = make("surveyor")
    surveyor = node.new_surveyor("/who", LONG_MS)
    surveyor.ask({})

    def is_counted() -> bool:  # the three nodes report their counts one after the other
        info = node.graph().services["survey:/who"]
        return (info.calls, info.clients[0].answered) == (2, 2)

    eventually(is_counted)
    graph = node.graph()
    assert len(graph.services["survey:/who"].servers) == 2
    assert not graph.topics
    assert not graph.alerts
    surveyor.close()
    eventually(lambda: not node.graph().services["survey:/who"].clients)


def test_survey_and_service_of_the_same_name_are_independent(make: Make) -> None:
    respond(make, 1)
    make("server").new_server("/who", lambda _request: "the server", threads=1)
    node = make("caller")
    assert node.new_client("/who", timeout_s=LONG_S).call({}) == "the server"
    assert [each["says"] for each in node.new_surveyor("/who", LONG_MS).ask({})] == [1]
    for make_one in (node.new_server, node.new_client, node.new_surveyor, node.new_respondent):
        with pytest.raises(nep.BadTopicError, match=r"'survey:/who'.*'survey:'"):
            make_one("survey:/who")


def test_survey_returns_large_replies_and_bytes(make: Make) -> None:
    make("large").new_respondent("/who", lambda _question: b"\0" * 8_000_000, threads=1)
    surveyor = make("surveyor").new_surveyor("/who", LONG_MS, msg_type="msgpack")
    assert surveyor.ask(b"\xff") == [b"\0" * 8_000_000]


def test_invalid_survey_arguments_are_rejected(make: Make) -> None:
    node = make("node")
    for name in ("", "a b", "x" * 190, 7):
        with pytest.raises(nep.BadTopicError):
            node.new_surveyor(name)
    for timeout in (-1, float("nan"), "soon"):
        with pytest.raises(ValueError, match="timeout must be"):
            node.new_surveyor("/who", timeout)
    surveyor = node.new_surveyor("/who")
    with pytest.raises(ValueError, match=r"timeout_s must be .*, not -1"):
        surveyor.ask({}, -1)
    with pytest.raises(ValueError, match=r"expect must be .*, not 0"):
        surveyor.ask({}, expect=0)
    with pytest.raises(nep.EncodeError):
        surveyor.ask({1, 2})
    with pytest.raises(ValueError, match="callback must be a function, not 'str'"):
        node.new_respondent("/who", "json")
    with pytest.raises(nep.NepError, match=rf"'{node._backend.name}' .*(master|direct connections)"):
        node.new_surveyor("/who", 1000, node.direct("127.0.0.1", 9000))


def test_back_end_without_surveys_or_services_raises(master: Master, monkeypatch: pytest.MonkeyPatch) -> None:
    with nep.node("here") as node:
        monkeypatch.delattr(ZeromqTransport, "create_surveyor")
        for make_one in (node.new_surveyor, node.new_respondent):
            with pytest.raises(nep.NepError, match=r"'zeromq' .*surveys"):
                make_one("/who")
        monkeypatch.delattr(ZeromqTransport, "create_server")
        for make_one in (node.new_server, node.new_client, node.new_surveyor, node.new_respondent):
            with pytest.raises(nep.NepError, match=r"'zeromq' .*services"):
                make_one("/who")


RESPONDENT = """
    import sys, threading, nep
    node = nep.node("respondent")
    def answer(question):
        if question == "hang":
            print("asked")
            threading.Event().wait()
        return "there"
    node.new_respondent("/who", answer, threads=1)
    print("ready")
    sys.stdin.read()
"""


def test_survey_without_a_timeout_ends_when_its_respondent_is_killed(master: Master) -> None:
    with nep.node("here") as node, running(RESPONDENT) as program:
        assert program.line() == "ready"
        node.new_respondent("/who", lambda _question: "here", threads=1)
        surveyor = node.new_surveyor("/who", None)
        answers = surveyor.answers("hang")
        assert program.line() == "asked"
        assert next(answers) == "here"
        program.kill()
        assert list(answers) == []  # returns at once, despite no time limit
        assert surveyor.failures == 1


def test_surveys_continue_while_the_master_is_unreachable() -> None:
    master = Master("127.0.0.1:0", learn_s=0.0).start()
    address = master.address
    with nep.node("a", master=address) as a, nep.node("b", master=address) as b:
        a.new_respondent("/who", lambda question: question, threads=1)
        surveyor = b.new_surveyor("/who", LONG_MS)
        assert surveyor.ask(1) == [1]
        master.close()
        assert surveyor.ask(2) == [2]
        with Master(address):
            eventually(lambda: "survey:/who" in b.graph(LONG_S).services)
            eventually(lambda: b.graph(LONG_S).services["survey:/who"].clients)
            assert surveyor.ask(3) == [3]
            with nep.node("c", master=address) as c:
                c.new_respondent("/who", lambda question: question, threads=1)
                eventually(lambda: surveyor.respondents == 2)
                assert surveyor.ask(4) == [4, 4]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_fork_closes_surveys_in_the_child(master: Master) -> None:
    with nep.node("a") as a, nep.node("b") as b:
        respondent = a.new_respondent("/who", lambda question: question, threads=1)
        surveyor = b.new_surveyor("/who", LONG_MS)
        assert surveyor.ask(1) == [1]
        child = os.fork()
        if child == 0:
            code = 1
            try:
                surveyor.ask(2)
            except nep.ClosedError:
                code = 0 if respondent.is_closed and surveyor.is_closed else 2
            finally:
                surveyor.close()
                os._exit(code)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        assert surveyor.ask(3) == [3]
