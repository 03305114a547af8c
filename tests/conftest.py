"""What all tests share: a master, and the guard against threads and sockets that are left behind."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Generator, Iterator

import psutil
import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling

from nep.masters.master import Master
from nep.text import escaped
from tests.nep.programs import GREETINGS_S

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that starts tests in the background lets them, and all they start, ignore Ctrl+C.
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ["NEP_LANG"] = "en"  # what tests read is English, also on a computer that is set to something else
WITH_FIXED_PORTS = ("tests/interop/", "tests/e2e/test_rize.py")
_GRACE_S = 20.0
_OURS = ("nep-", "studio-", "runner ", "deep json")


def _our_threads() -> set[threading.Thread]:
    return {thread for thread in threading.enumerate() if thread.name.startswith(_OURS)}


def _listening() -> set[tuple[str, int]]:
    """Addresses on which this process listens."""
    connections = psutil.Process(os.getpid()).net_connections(kind="tcp")
    return {each.laddr for each in connections if each.status == psutil.CONN_LISTEN}


class ByFile(LoadScopeScheduling):
    """Tests of one file stay in one process; so do all that bind fixed ports, which exist once.

    By name, not by mark: pytest-xdist 3.8 can't tell its groups to pytest 9.2.
    """

    def _split_scope(self, nodeid: str) -> str:
        return "ports" if nodeid.startswith(WITH_FIXED_PORTS) else nodeid.partition("::")[0]


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--driver FILE``: hold the contract of robots against the drivers of this file."""
    told = "a driver of yours to hold tests/robots/test_contract.py against (may be given again)"
    parser.addoption("--driver", action="append", default=[], metavar="FILE", help=told)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> ByFile:
    """How pytest-xdist gives tests to its processes."""
    return ByFile(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """What a test logged may have halves of letters, which pytest-xdist can't carry to its first process."""
    report = yield
    report.sections = [(title, escaped(text, lines=True)) for title, text in report.sections]
    return report


@pytest.fixture(autouse=True)
def _nothing_is_left() -> Iterator[None]:
    """Fails a test that leaves a thread of ours, or a listening socket, behind."""
    threads, sockets = _our_threads(), _listening()
    yield
    deadline = time.monotonic() + _GRACE_S
    for thread in _our_threads() - threads:
        thread.join(max(0.0, deadline - time.monotonic()))
    left = sorted(thread.name for thread in _our_threads() - threads)
    if left:
        pytest.fail(f"threads are left behind: {left}")
    # libzmq closes sockets in a thread of its own, which a busy computer lets wait.
    while (opened := _listening() - sockets) and time.monotonic() < deadline:
        threading.Event().wait(0.02)
    if opened:
        pytest.fail(f"listening sockets are left behind: {sorted(opened)}")


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nodes of this process wait long for greetings: however busy the computer is, they come in time.

    Whoever had to give up waiting needs this long.
    """
    monkeypatch.setattr("nep.backends.zeromq.transport.HANDSHAKE_S", GREETINGS_S)


@pytest.fixture
def pseudo(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is marked for translators is said in the pseudo-language (`tests.pseudo` finds what is not)."""
    from tests.pseudo import words

    monkeypatch.setattr("nep.i18n._now", words())


@pytest.fixture
def master(monkeypatch: pytest.MonkeyPatch) -> Iterator[Master]:
    """A running native master on a free port of loopback; NEP_MASTER names it."""
    with Master("127.0.0.1:0", learn_s=0.0) as running:
        monkeypatch.setenv("NEP_MASTER", running.address)
        yield running
