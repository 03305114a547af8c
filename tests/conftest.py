"""Fixtures and hooks of all tests: the master, the order of files, and the check for leaked resources."""

from __future__ import annotations

import faulthandler
import gc
import importlib.util
import os
import signal
import sys
import time
from collections.abc import Generator, Iterator

import hypothesis
import pytest
from _pytest.faulthandler import fault_handler_stderr_fd_key
from xdist.remote import Producer
from xdist.workermanage import WorkerController

from nep.masters.master import Master
from nep.text import escaped
from tests import examples, leftovers, long_groups, syntax
from tests.nep.meeting import extend_handshakes
from tests.scheduler import FileScheduling

gc.disable()  # during collection: its objects stay alive, so scanning them is wasted time
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # Shells start background jobs with SIGINT ignored, and child processes inherit this.
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Python 3.12 and later warn about forks in processes with threads; the fork tests cover this.
os.environ["PYTHONWARNINGS"] = "ignore:This process:DeprecationWarning"
pytest.register_assert_rewrite("tests.robots.message_senders")  # shared contract tests
os.environ["NEP_LANG"] = "en"  # tests compare English texts, whatever the system language
_GRACE_S = 20.0
_GRACE_AFTER_LEAK_S = 1.0
_PAST_TIMEOUT_S = 60.0
PATIENCE_S = 30.0
_SKIPPED = "skipped_groups"
_selection = pytest.StashKey[tuple[tuple[str, ...], str | None]]()
_allowances = leftovers.Allowances()
_grace = leftovers.Grace(_GRACE_S, _GRACE_AFTER_LEAK_S)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--driver FILE`` (test the drivers of this file, too) and ``--long`` (run all tests)."""
    long_help = (
        "run all tests: also those marked long, the groups of tests/long_groups.py, and each fault alone"
    )
    driver_help = "also test the driver in this file with tests/robots/driver/test_contract.py (repeatable)"
    command_help = "the same for a driver program in any language, by its command (docs/write-a-driver.md)"
    parser.addoption("--long", action="store_true", help=long_help)
    parser.addoption("--driver", action="append", default=[], metavar="FILE", help=driver_help)
    parser.addoption("--driver-command", action="append", default=[], metavar="COMMAND", help=command_help)
    if importlib.util.find_spec("pytestqt") is None:
        # Without pytest-qt (dev.py versions), its options must still be accepted; they have no effect.
        for name in ("qt_api", "qt_log_level_fail", "qt_log_ignore"):
            parser.addini(name, "an option of pytest-qt, which is not installed", type="linelist")


def pytest_configure(config: pytest.Config) -> None:
    """Set the number of examples of property tests."""
    examples.is_long = config.getoption("--long")
    # No deadline: on a busy computer, generating a value or running an example may be slow.
    hypothesis.settings.register_profile(
        "nep",
        hypothesis.settings(),
        deadline=None,
        max_examples=examples.examples(examples.DEFAULT_EXAMPLES),
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
    )
    hypothesis.settings.load_profile("nep")


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
    """Print the skipped groups of long tests, and how to run them."""
    if line := long_groups.report(*_selected(config)):
        terminalreporter.write_line(line)


def pytest_collection_finish() -> None:
    """Exclude modules and tests from garbage collection, because they exist until the end of the process."""
    gc.collect()
    gc.freeze()
    gc.enable()


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> FileScheduling | None:
    """Return the scheduler for ``--dist loadfile``; other values select those of pytest-xdist."""
    return FileScheduling(config, log) if config.getvalue("dist") == "loadfile" else None


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Escape lone surrogates in captured output, which pytest-xdist can't send to its main process."""
    report = yield
    report.sections = [(title, escaped(text, lines=True)) for title, text in report.sections]
    return report


@pytest.fixture(autouse=True)
def _fail_on_leaks(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail a test that leaves a thread, socket, pipe or file open; the check takes 0.4 ms per test."""
    threads, open_before = leftovers.threads(), leftovers.descriptors()
    yield
    deadline = time.monotonic() + _grace.seconds(request.path)
    for thread in leftovers.threads() - threads:
        thread.join(max(0.0, deadline - time.monotonic()))
    left = sorted(thread.name for thread in leftovers.threads() - threads)
    if left:
        _grace.add_leak(request.path)
        pytest.fail(f"leaked threads: {left}")
    leaked = _allowances.leaked(open_before, deadline)
    if leaked:
        _grace.add_leak(request.path)
        pytest.fail(f"leaked descriptors: {leaked}")


def _end_if_stuck(item: pytest.Item) -> None:
    """Dump all stacks and end this process if `item` runs long beyond its timeout.

    pytest-timeout raises an exception in the main thread. It does not reach a test that waits in C++,
    and Qt discards it when it is raised in a slot. pytest-xdist reports the test and continues.
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
def _restore_fault_handler(pytestconfig: pytest.Config) -> Iterator[None]:
    """Restore pytest's fault handler, which Studio's own crash handler replaces.

    Without it, a worker that crashes would leave no message.
    """
    yield
    stderr = pytestconfig.stash.get(fault_handler_stderr_fd_key, None)  # pytest's copy of the real stderr
    if stderr is not None:
        faulthandler.enable(stderr)


@pytest.fixture(autouse=True)
def _restore_recursion_limit() -> Iterator[None]:
    """Restore the recursion limit, which a program's runtime raises for its process.

    With a higher limit, indenting JSON with deep nesting takes many times as long before it fails.
    """
    limit = sys.getrecursionlimit()
    yield
    sys.setrecursionlimit(limit)


@pytest.fixture(scope="module")
def syntax_trees() -> Iterator[None]:
    """Pause garbage collection for a module that parses all sources; free their syntax trees afterwards.

    Collections would scan a million nodes again and again and take three quarters of the time of parsing.
    """
    gc.disable()
    yield
    syntax.clear()
    gc.enable()


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Extend the handshake timeout of nodes in this process, so that a busy computer doesn't exceed it.

    A test that waits for a handshake to time out needs this time.
    """
    extend_handshakes(monkeypatch)


@pytest.fixture
def patient_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Extend the time limits for replies of robots in this process for busy computers.

    A test whose robot doesn't reply shortens them again (`tests.blocks.wire_robot.usual_time_limits`).
    """
    for name in ("STOP_TIMEOUT_S", "MAX_STOP_TIMEOUT_S", "FIRST_REPLY_TIMEOUT_S", "MIN_SILENCE_S"):
        monkeypatch.setattr(f"app.robots.client.limits.{name}", PATIENCE_S)
    monkeypatch.setattr("app.core.robots.invocations.FIRST_REPLY_TIMEOUT_S", PATIENCE_S)
    monkeypatch.setattr("app.robots.driver.tasks.STOP_REPLY_TIMEOUT_S", PATIENCE_S / 2)


@pytest.fixture
def pseudo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Install the pseudo-language as translation; `tests.pseudo` finds text that isn't translated."""
    from tests.pseudo import words

    monkeypatch.setattr("nep.i18n._current", words())


@pytest.fixture
def master(monkeypatch: pytest.MonkeyPatch) -> Iterator[Master]:
    """Running native master on a free port of the loopback interface; `NEP_MASTER` is set to its address."""
    with Master("127.0.0.1:0", learn_s=0.0) as running:
        monkeypatch.setenv("NEP_MASTER", running.address)
        yield running
