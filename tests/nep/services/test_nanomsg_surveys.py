"""Tests of surveys without a master: nanomsg's SURVEYOR and RESPONDENT as in other programs."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator

import pytest

import nep
from nep.masters.master import Master
from tests.nep.programs import eventually, running

pynng = pytest.importorskip("pynng")
LONG_S = 30.0
LONG_MS = LONG_S * 1000


@pytest.fixture
def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def node() -> Iterator[nep.Node]:
    with nep.node("here", "nanomsg", master="127.0.0.1:1") as made:
        yield made


def test_all_connected_respondents_reply(node: nep.Node, port: int) -> None:
    at = node.direct("127.0.0.1", port)
    respondents = [
        node.new_respondent("/who", lambda question, n=n: {"n": n, "asked": question}, at, threads=1)
        for n in range(3)
    ]
    surveyor = node.new_surveyor("/who", LONG_MS, at)
    eventually(lambda: surveyor.respondents == 3)
    for again in range(5):
        answers = surveyor.ask([again])
        assert sorted(each["n"] for each in answers) == [0, 1, 2]
        assert all(each["asked"] == [again] for each in answers)
    assert [each.calls for each in respondents] == [5, 5, 5]
    respondents[0].close()
    eventually(lambda: surveyor.respondents == 2)
    assert sorted(each["n"] for each in surveyor.ask({})) == [1, 2]


def test_survey_ends_at_its_timeout(node: nep.Node, port: int) -> None:
    go_on = threading.Event()
    at = node.direct("127.0.0.1", port)
    node.new_respondent("/who", lambda _question: go_on.wait(LONG_S) and "late", at, threads=1)
    node.new_respondent("/who", lambda _question: "quick", at, threads=1)
    surveyor = node.new_surveyor("/who", 2000, at)
    eventually(lambda: surveyor.respondents == 2)
    assert surveyor.ask({}) == ["quick"]
    go_on.set()
    assert sorted(surveyor.ask({}, LONG_S)) == ["late", "quick"]
    assert surveyor.failures == 0


def test_concurrent_surveys_receive_their_own_replies(node: nep.Node, port: int) -> None:
    at = node.direct("127.0.0.1", port)
    for _ in range(2):
        node.new_respondent("/who", lambda question: question, at, threads=2)
    surveyor = node.new_surveyor("/who", LONG_MS, at)
    eventually(lambda: surveyor.respondents == 2)
    wrong: list[object] = []

    def ask(n: int) -> None:
        wrong.extend(again for again in range(10) if surveyor.ask([n, again]) != [[n, again]] * 2)

    threads = [threading.Thread(target=ask, args=(n,), name=f"asker-{n}") for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LONG_S)
    assert wrong == []


def test_failing_respondent_is_counted(node: nep.Node, port: int) -> None:
    def answer(_question):
        raise LookupError("no eyes")

    at = node.direct("127.0.0.1", port)
    respondent = node.new_respondent("/who", answer, at, threads=1)
    surveyor = node.new_surveyor("/who", LONG_MS, at)
    eventually(lambda: surveyor.respondents == 1)
    assert surveyor.ask({}) == []
    assert (surveyor.failures, respondent.errors) == (1, 1)


def test_surveys_with_other_programs_use_plain_json(node: nep.Node, port: int) -> None:
    at = node.direct("127.0.0.1", port)
    with pynng.Surveyor0(listen=f"tcp://127.0.0.1:{port}", survey_time=30_000) as theirs:
        respondent = node.new_respondent("/who", lambda question: {"heard": question}, at, threads=1)
        eventually(lambda: len(theirs.pipes) == 1)
        theirs.send(b'{"n":1}')
        assert json.loads(theirs.recv()) == {"heard": {"n": 1}}
        theirs.send(b"{oops")
        assert json.loads(theirs.recv())["nep_error"] == ""
        assert (respondent.calls, respondent.refused) == (1, 1)
        respondent.close()
    surveyor = node.new_surveyor("/who", LONG_MS, at)
    with pynng.Respondent0(dial=f"tcp://127.0.0.1:{port}", recv_timeout=30_000) as theirs:
        eventually(lambda: surveyor.respondents == 1)
        answers = surveyor.answers({"n": 2})
        assert theirs.recv() == b'{"n":2}'
        theirs.send(b'{"me":1}')
        assert list(answers) == [{"me": 1}]
        answers = surveyor.answers({})
        theirs.recv()
        theirs.send(b"{oops")
        assert list(answers) == []
        assert surveyor.failures == 1


@pytest.mark.skipif(shutil.which("nanocat") is None, reason="nanocat is missing (Debian: nanomsg-utils)")
def test_nanocat_respondent_replies_to_a_nep_surveyor(node: nep.Node, port: int) -> None:
    surveyor = node.new_surveyor("/who", LONG_MS, node.direct("127.0.0.1", port))
    told = ["nanocat", "--respondent", "--connect-local", str(port), "--data", '{"cat":1}', "--raw"]
    with subprocess.Popen(told, stdout=subprocess.PIPE) as cat:
        eventually(lambda: surveyor.respondents == 1)
        assert surveyor.ask({"n": 1}) == [{"cat": 1}]
        assert cat.stdout is not None
        assert cat.stdout.read(7) == b'{"n":1}'
        cat.terminate()


def test_closing_the_surveyor_ends_its_survey(node: nep.Node, port: int) -> None:
    has_waiting_calls, go_on = threading.Event(), threading.Event()

    def answer(_question):
        has_waiting_calls.set()
        return go_on.wait(LONG_S)

    at = node.direct("127.0.0.1", port)
    node.new_respondent("/who", answer, at, threads=1)
    surveyor = node.new_surveyor("/who", None, at)
    eventually(lambda: surveyor.respondents == 1)
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
    with pytest.raises(nep.ClosedError):
        surveyor.ask({})
    go_on.set()


def test_respondent_replies_in_the_spinning_thread(node: nep.Node, port: int) -> None:
    at = node.direct("127.0.0.1", port)
    respondent = node.new_respondent("/who", lambda _question: threading.current_thread().name, at)
    spinner = threading.Thread(target=node.spin, name="spinner")
    spinner.start()
    with nep.node("asker", "nanomsg", master="127.0.0.1:1") as other:
        surveyor = other.new_surveyor("/who", LONG_MS, at)
        eventually(lambda: surveyor.respondents == 1)
        assert surveyor.ask({}) == ["spinner"]
    node.close()
    spinner.join(LONG_S)
    assert respondent.is_closed


def test_nanomsg_surveys_reject_ports_in_use_non_json_codecs_plain_tcp_and_closed_nodes(
    node: nep.Node, port: int
) -> None:
    at = node.direct("127.0.0.1", port)
    with node.new_surveyor("/who", 1000, at) as surveyor:
        assert surveyor.ask({}) == []
        with pytest.raises(nep.AddressInUseError):
            node.new_surveyor("/who", 1000, at)
    with pytest.raises(nep.NepError, match=r"JSON.*msg_type"):
        node.new_surveyor("/who", 1000, at, msg_type="msgpack")
    with pytest.raises(nep.NepError, match="wire='tcp'"):
        node.new_surveyor("/who", 1000, node.direct("127.0.0.1", port, wire="tcp"))
    node.close()
    for make in (node.new_surveyor, node.new_respondent):
        with pytest.raises(nep.ClosedError):
            make("/who", configuration=at)


def test_program_exits_without_closing_surveys(port: int) -> None:
    program = """
        import sys, threading, nep
        node = nep.node("forgetful", "nanomsg", master="127.0.0.1:1")
        at = node.direct("127.0.0.1", sys.argv[1])
        surveyor = node.new_surveyor("/who", 30_000, at)
        node.new_respondent("/who", lambda question: question, at, threads=1)
        while not surveyor.respondents:
            threading.Event().wait(0.01)
        print(surveyor.ask(1))
    """
    with running(program, str(port)) as forgetful:
        assert forgetful.end() == ("[1]\n", "")
        assert forgetful.process.returncode == 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_fork_closes_surveys_in_the_child(port: int) -> None:
    program = """
        import os, sys, threading, nep
        node = nep.node("here", "nanomsg", master="127.0.0.1:1")
        at = node.direct("127.0.0.1", sys.argv[1])
        surveyor = node.new_surveyor("/who", 30_000, at)
        respondent = node.new_respondent("/who", lambda question: question, at, threads=1)
        while not surveyor.respondents:
            threading.Event().wait(0.01)
        print(surveyor.ask(1), flush=True)
        if os.fork() == 0:
            try:
                surveyor.ask(2)
            except nep.ClosedError:
                print(respondent.is_closed, surveyor.is_closed, flush=True)
            surveyor.close()
            respondent.close()
        else:
            os.wait()
            print(surveyor.ask(3), flush=True)
    """
    with running(program, str(port)) as forking:
        assert forking.end() == ("[1]\nTrue True\n[3]\n", "")
        assert forking.process.returncode == 0


def test_nanomsg_and_zeromq_services_and_surveys_interoperate_through_the_master(master: Master) -> None:
    with nep.node("a", "nanomsg") as a, nep.node("b", "zeromq") as b:
        a.new_server("/x", lambda request: [request], threads=1)
        assert b.new_client("/x", timeout_s=LONG_S).call(1) == [1]
        b.new_respondent("/who", lambda question: [question], threads=1)
        assert a.new_surveyor("/who", LONG_MS).ask(2) == [[2]]
