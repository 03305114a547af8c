"""Tests of the command `nep bridge`: forwarding, output, and exit."""

from __future__ import annotations

import itertools
import json
import os
import re
import signal
import subprocess
import sys

import pytest

import nep
from nep.cli.screen import UNKNOWN
from nep.masters.master import Master
from tests.nep.bridges.joined import taken
from tests.nep.cli.conftest import type_in as type_in
from tests.nep.programs import ROOT, eventually, running

COMMAND = "from nep.cli import main; main()"
_numbers = itertools.count()
INTERRUPTED = 130


@pytest.fixture
def place():
    return f"local/bridge-command-{os.getpid()}-{next(_numbers)}"


@pytest.fixture
def file(tmp_path, master, place):
    """Function that writes a configuration file that joins the master's network with a Zenoh network."""

    def write(topics, address=master.address):
        path = tmp_path / "lab.toml"
        sides = f'[a]\nbackend = "zeromq"\nmaster = "{address}"\n[b]\nbackend = "zenoh"\nmaster = "{place}"\n'
        path.write_text(sides + topics, encoding="utf-8")
        return str(path)

    return write


@pytest.fixture
def nodes(master, place, patient):
    with nep.node("on-a", master=master.address) as a, nep.node("on-b", "zenoh", master=place) as b:
        yield a, b


def reports(program):
    """Yield the JSON reports that the command prints."""
    while True:
        yield json.loads(program.line())


def when(program, is_met):
    """Return the first report that meets a condition."""
    return next(each for each in reports(program) if is_met(each))


def way(report, side):
    return next(each for each in report["routes"] if each["from"]["side"] == side)


def test_every_message_between_processes_is_forwarded_or_counted(file, nodes):
    on_a, on_b = nodes
    path = file('[[topics]]\na = "/count"\nb = "zenoh/count"\n[[topics]]\na = "/thin"\nmax_rate_hz = 0.001\n')
    with running(COMMAND, "bridge", path, "--json") as program:
        when(program, lambda report: report["is_ready"])
        hears, says, thin = on_b.new_sub("zenoh/count"), on_a.new_pub("/count"), on_a.new_pub("/thin")
        answers, back = on_b.new_pub("zenoh/count"), on_a.new_sub("/count")
        for number in range(500):
            says.publish(number)
            thin.publish(number)
        report = when(
            program,
            lambda it: all(
                each["received"] >= 500 and each["waiting"] == (each["from"]["topic"] == "/thin")
                for each in it["routes"]
                if each["from"]["side"] == "a"
            ),
        )
        routes = {each["from"]["topic"]: each for each in report["routes"] if each["from"]["side"] == "a"}
        for topic, pub in (("/count", says), ("/thin", thin)):
            told = routes[topic]
            assert pub.count == told["received"] + told["lost"] == 500
            parts = ("sent", "thinned", "failed", "dropped", "waiting")
            assert told["received"] == sum(told[each] for each in parts)
        assert (routes["/thin"]["sent"], routes["/thin"]["thinned"]) == (1, 498)
        assert routes["/count"]["sent"] == 500
        eventually(lambda: hears.received + hears.lost == 500)
        assert taken(back, 500) == list(range(500))
        answers.publish("from b")
        assert taken(back, 1) == ["from b"]
        report = when(program, lambda it: way(it, "b")["received"] == 1)
        assert way(report, "b")["sent"] == 1
        if sys.platform == "win32":  # Windows has no signal for a graceful shutdown
            return
        program.signal(signal.SIGTERM)
        out, err = program.end()
        assert program.process.returncode == 0
        assert err == ""
        thinned = next(each for each in json.loads(out.splitlines()[-1])["routes"] if each["thinned"])
        assert (thinned["sent"], thinned["waiting"]) in {(1, 1), (2, 0)}


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_ctrl_c_exits_silently_and_removes_the_bridge_nodes(file, nodes):
    on_a, on_b = nodes
    with running(COMMAND, "bridge", file('[[topics]]\na = "/t"\n')) as program:
        heads = "topic rate received sent lost throttled failed dropped waiting returned"
        assert program.line().split() == heads.split()
        for node, name in ((on_a, "bridge-lab-to-zenoh"), (on_b, "bridge-lab-to-zeromq")):
            eventually(
                lambda node=node, name=name: name in {each.name for each in node.graph().nodes.values()}
            )
        program.signal(signal.SIGINT)
        _out, err = program.end()
        assert program.process.returncode == INTERRUPTED
        assert re.fullmatch(
            r"lab: forwarding between a \(zeromq:127\.0\.0\.1:\d+@.*\) and b \(zenoh:local/bridge-.*\); .*\n",
            err,
        )
        for node in nodes:
            eventually(
                lambda node=node: (
                    not any(each.name.startswith("bridge") for each in node.graph().nodes.values())
                )
            )


def test_plain_output_prints_a_line_per_change(file, nodes):
    on_a, on_b = nodes
    with running(COMMAND, "bridge", file('[[topics]]\na = "/t"\nb = "/u"\ndirection = "a->b"\n')) as program:
        program.line()
        assert program.line().split() == ["zeromq", "→", "zenoh", "/t", "→", "/u", UNKNOWN, *["0"] * 8]
        eventually(lambda: "/t" in on_a.graph().topics)
        hears, says = on_b.new_sub("/u"), on_a.new_pub("/t")
        for number in range(3):
            says.publish(number)
        assert taken(hears, 3) == [0, 1, 2]
        figures = program.line().split()[-8:]
        while figures[0] != "3":
            figures = program.line().split()[-8:]
        assert figures == ["3", "3", "0", "0", "0", "0", "0", "0"]


def test_bridge_between_two_command_line_ends_forwards_one_topic(nodes, master, place):
    on_a, on_b = nodes
    words = (f"zmq@{master.address}:/chatter", f"Zenoh@{place}:")
    with running(COMMAND, "bridge", *words, "--direction", "b->a", "--rate", "100", "--json") as program:
        when(program, lambda report: report["is_ready"])
        hears = on_a.new_sub("/chatter")
        on_b.new_pub("/chatter").publish({"hello": "there"})
        assert taken(hears, 1) == [{"hello": "there"}]
        name = f"bridge-{program.process.pid}-to-zenoh"
        assert name in {each.name for each in on_a.graph().nodes.values()}


def test_bridge_command_waits_for_a_master_that_starts_later(file, place):
    with Master("127.0.0.1:0", learn_s=0.0) as first:
        address = first.address
    path = file('[[topics]]\na = "/t"\ndirection = "b->a"\n', address)
    with running(COMMAND, "bridge", path, "--json") as program, nep.node("b", "zenoh", master=place) as on_b:
        report = when(program, lambda it: it["sides"][0]["problem"])
        assert re.match(f"no master .*'{address}' .*'nep master'", report["sides"][0]["problem"])
        assert not report["is_ready"]
        eventually(lambda: "/t" in on_b.graph().topics)
        on_b.new_pub("/t").publish("early")
        report = when(program, lambda it: it["routes"][0]["waiting"] == 1)
        with Master(address, learn_s=0.0):
            report = when(program, lambda it: it["is_ready"] and it["routes"][0]["sent"] == 1)
            assert report["sides"][0]["problem"] == ""
            program.signal(signal.SIGTERM)
            _out, err = program.end()
        lines = err.splitlines()
        assert len(lines) == 2
        assert "side a of the bridge" in lines[0]
        assert "waiting for side" in lines[0]
        assert lines[1].endswith("is connected")


class OnTerminal:
    """Command that runs on its own pseudo-terminal, with all its output."""

    def __init__(self, *words):
        self._keys, terminal = os.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-c", COMMAND, *words],
            stdin=subprocess.DEVNULL,
            stdout=terminal,
            stderr=terminal,
            env={**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm", "COLUMNS": "140", "LINES": "40"},
        )
        os.close(terminal)
        self.text = ""

    def shows(self, word):
        """Read output until it contains this text."""
        while word not in self.text:
            self.text += self._read()

    def _read(self):
        try:
            said = os.read(self._keys, 100_000).decode()
        except OSError:  # the terminal was closed
            said = ""
        assert said, f"it ended: {self.text}"
        return said

    def end(self):
        """Press Ctrl+C. Return the output that follows and the exit code."""
        self.process.send_signal(signal.SIGINT)
        before = len(self.text)
        with pytest.raises(AssertionError, match="it ended"):
            self.shows("what it never says")
        return self.text[before:], self.process.wait(60)

    def close(self):
        self.process.kill()
        self.process.wait(60)
        os.close(self._keys)


@pytest.mark.skipif(sys.platform == "win32", reason="terminals of Unix")
def test_terminal_table_updates_in_place_with_warnings_above(file, nodes):
    on_a, _on_b = nodes
    topics = '[[topics]]\na = "/t"\ndirection = "a->b"\nb_type = "string"\n[[topics]]\na = "/[/red][bold]"\n'
    shown = OnTerminal("bridge", file(topics))
    try:
        shown.shows("/[/red][bold]")
        shown.shows("zeromq → zenoh  /t")
        assert "returned" not in shown.text, "columns that are all 0 need no room"
        eventually(lambda: "/t" in on_a.graph().topics)
        pub = on_a.new_pub("/t")
        pub.publish({"no": "text"})
        shown.shows("a message on '/t' can't be sent (1 so far): can't encode a 'dict' as 'string'")
        shown.shows("! zeromq → zenoh  /t: can't encode")
        shown.shows("\x1b[1A")  # cursor up: the next report replaces this one
        rest, code = shown.end()
        assert code == INTERRUPTED
        assert "Traceback" not in shown.text
        assert "\x1b[?25h" in rest, "the cursor is back"
    finally:
        shown.close()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "specify a file or two ends, such as"),
        (("zeromq:/t",), "'zeromq:/t' is only one end of the bridge; add the other one"),
        (("zeromq:/t", "zeromk:/t"), "unknown back end 'zeromk'; did you mean 'zeromq'?"),
        (("zeromq", "zenoh:/t"), "'zeromq' isn't in the form BACKEND:TOPIC; write it as 'zeromq:/topic' or"),
        (("zeromq:", "zenoh:"), "the topic name is missing; write it as 'zeromq:/topic ros:/topic'"),
        (("zeromq:/a/*", "zenoh:/b"), "'/a/*' and '/b' have different wildcards; use the same '*' or '**'"),
        (("zeromq:/t", "zmq:/u"), "both sides are the network 'zeromq:"),
        (("zeromq:/t", "zenoh:/t", "--direction", "a-b"), "unknown direction 'a-b'; did you mean 'a->b'?"),
        (("zenoh@nowhere:/t", "zeromq:/t"), "'nowhere' isn't a zenoh address; use 'local'"),
        (("zeromq:/t", "memory:/t"), "the back end 'memory' connects nodes of one program only"),
        (("zeromq:/a b", "zenoh:/t"), "'/a b' isn't a valid topic name: the character ' ' isn't allowed"),
        (("missing.toml",), "'missing.toml' can't be read: no such file or directory; 'nep bridge --ex"),
        (("missing.toml", "--rate", "3"), "--direction and --rate can't be used with a file"),
    ],
)  # fmt: skip
def test_invalid_bridge_arguments_are_reported_in_one_sentence(type_in, words, said):
    code, out, err = type_in("bridge", *words)
    assert (code, out) == (1, "")
    assert err.startswith("nep: ")
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("rate", ["0", "-1", "nan", "inf", "1e300"])
def test_invalid_rate_is_rejected(type_in, rate):
    code, _out, err = type_in("bridge", "zeromq:/t", "zenoh:/t", "--rate", rate)
    assert code == 2
    assert "use messages per second" in re.sub(r"[\s│]+", " ", err)


def test_check_option_validates_a_file_without_connecting(type_in, file):
    path = file(
        '[[topics]]\na = "/t"\nmax_rate_hz = 5\n[[topics]]\na = "/r/*"\nb = "/s/*"\ndirection = "b->a"\n'
    )
    code, out, err = type_in("bridge", "--check", path)
    assert (code, out) == (0, "/t ↔ /t  ≤ 5 /s\n/r/* ← /s/*\n")
    assert err.startswith("the file is valid: lab connects zeromq:127.0.0.1:")
    code, _out, err = type_in("bridge", "--check", file('[[topics]]\na = "/t"\nmax_rate = 5\n'))
    assert code == 1
    assert re.fullmatch(
        r"nep: line 9 of '.*lab\.toml', topics\[1\]\.max_rate: unknown key; did you mean "
        r"'max_rate_hz'\?\n",
        err,
    )
