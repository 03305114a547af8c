"""What all tests share: a master, the order of files, and the guard against what is left behind."""

from __future__ import annotations

import faulthandler
import gc
import importlib.util
import os
import signal
import time
from collections.abc import Generator, Iterator

import hypothesis
import pytest
from _pytest.faulthandler import fault_handler_stderr_fd_key
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

from nep.masters.master import Master
from nep.text import escaped
from tests import leftovers, long_groups
from tests.nep.programs import GREETINGS_S

gc.disable()  # until all tests are read: what is made meanwhile stays
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that starts tests in the background lets them, and all they start, ignore Ctrl+C.
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Python from 3.12 on warns who forks with threads; that it goes well is what tests of forks are about.
os.environ["PYTHONWARNINGS"] = "ignore:This process:DeprecationWarning"
# However busy the computer is: a value may take long to make, and an example to run.
hypothesis.settings.register_profile(
    "nep", hypothesis.settings(), deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("nep")
pytest.register_assert_rewrite("tests.robots.whose_words_count")  # a contract: others hold to it
os.environ["NEP_LANG"] = "en"  # what tests read is English, also on a computer that is set to something else
WITH_FIXED_PORTS = ("tests/interop/", "tests/e2e/test_rize.py")
MOSTLY_WAITING = ("tests/nep/", "tests/clients/", "tests/core/", "tests/robots/", "tests/blocks/")
"""They open no window, and wait for timeouts and other processes for two thirds of their time and more."""
USUAL_S, USUAL_OF_STUDIO_S = 0.2, 12.0
"""What a test takes, all in all, and one that starts Studio, ..."""
LONG_S = {
    "ports": 200.0,
    "tests/e2e/test_hour_mouse.py": 130.0,
    "tests/e2e/test_hour_keys.py": 120.0,
    "tests/core/run/test_run_file.py": 50.0,
    "tests/nep/backends/test_ros2.py": 85.0,
    "tests/e2e/test_path_mouse.py": 70.0,
    "tests/e2e/test_path_keys.py": 60.0,
    "tests/e2e/test_soak.py": 65.0,
    "tests/nep/bridges/test_bridge.py": 50.0,
    "tests/nep/bridges/test_command.py": 40.0,
    "tests/nep/bridges/test_loops.py": 30.0,
    "tests/ui/shell/test_layout_orders.py": 50.0,
    "tests/core/robots/test_stop_model.py": 60.0,
    "tests/core/robots/test_claims.py": 33.0,
    "tests/ui/theme/test_high_dpi.py": 32.0,
    "tests/core/test_session.py": 32.0,
    "tests/core/robots/test_robot_bad_days.py": 30.0,
    "tests/core/robots/test_refused_stop.py": 25.0,
    "tests/core/network/test_no_network.py": 21.0,
    "tests/faults/test_faults.py": 25.0,
    "tests/nep/cli/test_streams.py": 28.0,
    "tests/nep/services/test_bad_days.py": 24.0,
    "tests/nep/cli/test_command.py": 23.0,
    "tests/clients/test_javascript.py": 30.0,
    "tests/nep/nodes/test_processes.py": 17.0,
    "tests/robots/driver/test_process.py": 20.0,
    "tests/robots/virtual/test_simulated.py": 20.0,
    "tests/robots/virtual/test_turtle.py": 16.0,
    "tests/ui/shell/test_small_windows.py": 20.0,
    "tests/ui/theme/test_text_sizes.py": 25.0,
    "tests/test_readme.py": 15.0,
    "tests/test_distribution.py": 25.0,
    "tests/blocks/compiler/test_expressions.py": 20.0,
    "tests/blocks/compiler/test_hostile.py": 20.0,
    "tests/robots/driver/test_contract_of_any_file.py": 16.0,
}
"""... and files that take longer than so many tests would. Speed alone depends on it."""
_GRACE_S = 20.0
_GRACE_AFTER_LEAK_S = 1.0
_PAST_TIMEOUT_S = 60.0
_SKIPPED = "skipped_groups"
_selection = pytest.StashKey[tuple[tuple[str, ...], str | None]]()
_allowances = leftovers.Allowances()
_grace = leftovers.Grace(_GRACE_S, _GRACE_AFTER_LEAK_S)


def may_take(worker: str, workers: int, processors: int, scope: str) -> bool:
    """Whether a process of pytest-xdist may run the tests of `scope`: see `ByFile`."""
    is_last = workers > processors + 1 and worker == f"gw{workers - 1}"
    return not is_last or scope.startswith(MOSTLY_WAITING)


class ByFile(LoadScopeScheduling):
    """Tests of one file stay in one process; so do all that bind fixed ports, which exist once.

    By name, not by mark: pytest-xdist 3.8 can't tell its groups to pytest 9.2. What takes long begins first:
    at the end no process waits long for another. Where there are more processes than processors and one
    (`tools.check.side_by_side`), the last is given only what is `MOSTLY_WAITING`: it fills the time in which
    the others wait, and no more windows are open at a time than without it.
    """

    def _may_take(self, node: WorkerController, scope: str) -> bool:
        return may_take(node.gateway.id, self.numnodes, os.cpu_count() or 1, scope)

    def _split_scope(self, nodeid: str) -> str:
        return "ports" if nodeid.startswith(WITH_FIXED_PORTS) else nodeid.partition("::")[0]

    def _assign_work_unit(self, node: WorkerController) -> None:
        """Give a process the file that takes longest of those that are left for it."""
        left = [each for each in self.workqueue if self._may_take(node, each)] or list(self.workqueue)
        longest = max(left, key=self._seconds)
        self.workqueue.move_to_end(longest, last=False)
        super()._assign_work_unit(node)

    def _reschedule(self, node: WorkerController) -> None:
        """Give a process more than it has in hand: it begins a test only when it knows the one after it."""
        while not node.shutting_down and self._pending_of(self.assigned_work[node]) <= 2:
            if self.workqueue and not any(self._may_take(node, each) for each in self.workqueue):
                node.shutdown()
            super()._reschedule(node)  # gives it a file, or tells it that there is no other

    def remove_node(self, node: WorkerController) -> str | None:
        """Give what a process that crashed had not done to the others, but for the test that it died of.

        pytest-xdist gives that test away once more, and with it all files that were done: a process that
        gets one of those has nothing to do or to report, is never given another, and the run never ends.
        """
        had = self.assigned_work.pop(node)
        left = [
            (scope, test) for scope, tests in had.items() for test, is_done in tests.items() if not is_done
        ]
        if not left:
            return None
        (its_scope, crashed), *_others = left
        had[its_scope][crashed] = True
        self.workqueue.update({scope: tests for scope, tests in had.items() if not all(tests.values())})
        for other in self.nodes:
            self._reschedule(other)
        return crashed

    def _seconds(self, scope: str) -> float:
        each = USUAL_OF_STUDIO_S if scope.startswith("tests/e2e/") else USUAL_S
        return LONG_S.get(scope, each * len(self.workqueue[scope]))


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--driver FILE`` (test the drivers of this file, too) and ``--long`` (run all tests)."""
    told = "a driver of yours to hold tests/robots/driver/test_contract.py against (may be given again)"
    told_long = (
        "run all tests: also those marked long, the groups of tests/long_groups.py, and each fault alone"
    )
    parser.addoption("--long", action="store_true", help=told_long)
    parser.addoption("--driver", action="append", default=[], metavar="FILE", help=told)
    told = "the same for a driver program in any language, by its command (docs/write-a-driver.md)"
    parser.addoption("--driver-command", action="append", default=[], metavar="COMMAND", help=told)
    if importlib.util.find_spec("pytestqt") is None:
        # The library's tests run without Qt too (dev.py versions): its options are known, and mean nothing.
        for name in ("qt_api", "qt_log_level_fail", "qt_log_ignore"):
            parser.addini(name, "an option of pytest-qt, which is not here", type="linelist")


def _selected(config: pytest.Config) -> tuple[tuple[str, ...], str | None]:
    """Return the names of skipped groups, and the revision that the files were compared with."""
    if _selection not in config.stash:
        if config.getoption("--long"):
            config.stash[_selection] = ((), None)
        else:
            changes = long_groups.changes()
            given = long_groups.relative_arguments(config.args, config.invocation_params.dir)
            config.stash[_selection] = (long_groups.skipped_groups(changes.paths, given), changes.base)
    return config.stash[_selection]


def pytest_configure_node(node: WorkerController) -> None:
    """Pass the skipped groups to a worker: each must collect the same tests, also when a file changes."""
    node.workerinput[_SKIPPED] = _selected(node.config)[0]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect tests that are marked "long" and those of skipped groups, unless ``--long`` is given."""
    if config.getoption("--long"):
        return
    worker = getattr(config, "workerinput", None)
    skipped = _selected(config)[0] if worker is None else worker[_SKIPPED]
    long = {
        item
        for item in items
        if item.get_closest_marker("long") or long_groups.is_skipped(item.nodeid, skipped)
    }
    config.hook.pytest_deselected(items=[item for item in items if item in long])
    items[:] = [item for item in items if item not in long]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Name the skipped groups of long tests, and how to run them."""
    if line := long_groups.report(*_selected(config)):
        terminalreporter.write_line(line)


def pytest_collection_finish() -> None:
    """What stands now, modules and tests, stands to the end: no collection of garbage looks at it again."""
    gc.collect()
    gc.freeze()
    gc.enable()


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
def _nothing_is_left(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail a test that leaves a thread, a socket, a pipe or a file open (0.4 ms per test)."""
    threads, open_before = leftovers.threads(), leftovers.descriptors()
    yield
    deadline = time.monotonic() + _grace.seconds(request.path)
    for thread in leftovers.threads() - threads:
        thread.join(max(0.0, deadline - time.monotonic()))
    left = sorted(thread.name for thread in leftovers.threads() - threads)
    if left:
        _grace.add_leak(request.path)
        pytest.fail(f"threads are left behind: {left}")
    refused = _allowances.refused(open_before, deadline)
    if refused:
        _grace.add_leak(request.path)
        pytest.fail(f"descriptors are left behind: {refused}")


def _end_if_stuck(item: pytest.Item) -> None:
    """Dump all stacks and end this process if `item` runs long beyond its timeout.

    pytest-timeout raises an exception in the main thread, which does not reach a test that waits in C++, and
    which Qt discards when it is raised in a slot. pytest-xdist then names the test and goes on without it.
    """
    marker = item.get_closest_marker("timeout")
    timeout_s = float(marker.args[0] if marker else item.config.getini("timeout"))
    file = item.config.stash[fault_handler_stderr_fd_key]
    faulthandler.dump_traceback_later(timeout_s + _PAST_TIMEOUT_S, exit=True, file=file)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Start the watchdog of the test."""
    _end_if_stuck(item)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    """Restart the watchdog for the teardown: pytest cancels it when a test has failed."""
    _end_if_stuck(item)


def pytest_runtest_logfinish() -> None:
    """Cancel the watchdog."""
    faulthandler.cancel_dump_traceback_later()


@pytest.fixture(autouse=True)
def _crashes_are_told(pytestconfig: pytest.Config) -> Iterator[None]:
    """What Studio does of its own crashes takes pytest's away: a worker would die without a word."""
    yield
    told_to = pytestconfig.stash.get(fault_handler_stderr_fd_key, None)  # pytest keeps it from its capturing
    if told_to is not None:
        faulthandler.enable(told_to)


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

    monkeypatch.setattr("nep.i18n._current", words())


@pytest.fixture
def master(monkeypatch: pytest.MonkeyPatch) -> Iterator[Master]:
    """A running native master on a free port of loopback; NEP_MASTER names it."""
    with Master("127.0.0.1:0", learn_s=0.0) as running:
        monkeypatch.setenv("NEP_MASTER", running.address)
        yield running
