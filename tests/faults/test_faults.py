"""Tests of network faults: vanishing hosts, pulled cables and packet loss cause no uncounted loss.

`--long` measures the table in `docs/faults.md`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.faults import scenarios
from tests.faults.day import Day, day
from tests.faults.hosts import CannotMakeHostsError, network

_OUT_S, _OUT_LONG_S = 1.0, 10.0
"""How long a fault lasts."""
_each_backend = pytest.mark.parametrize(
    "today", ["zeromq", pytest.param("nanomsg", marks=pytest.mark.long)], indirect=True
)


@pytest.fixture
def is_long(pytestconfig: pytest.Config) -> bool:
    """Return whether the tests run with the long faults of `--long`."""
    return bool(pytestconfig.getoption("--long"))


@pytest.fixture
def _with_long(is_long: bool) -> None:
    if not is_long:
        pytest.skip("with --long")


@pytest.fixture
def today(request: pytest.FixtureRequest) -> Iterator[Day]:
    """Network of hosts with a master on a host of its own; the parameter is the back end."""
    try:
        with network() as hosts, day(hosts, getattr(request, "param", "zeromq")) as made:
            made.begin_master(hosts.host("m"))
            yield made
    except CannotMakeHostsError as error:
        pytest.skip(f"no computers can be made here: {error}")


def _name(scenario: scenarios.Scenario) -> str:
    return str(getattr(scenario, "__name__", scenario))


def _tell(scenario: scenarios.Scenario, measured: scenarios.Measured) -> None:
    """Print the measured values of a scenario; visible with `-s` or when the test fails."""
    sys.stdout.write(
        f"{_name(scenario)}: {json.dumps({each: round(value, 2) for each, value in measured.items()})}\n"
    )


@pytest.mark.timeout(400)
@_each_backend
def test_every_message_is_received_or_counted_as_lost_under_network_faults(today: Day) -> None:
    with ThreadPoolExecutor(len(scenarios.SIDE_BY_SIDE)) as side_by_side:
        begun = {each: side_by_side.submit(each, today, _OUT_S) for each in scenarios.SIDE_BY_SIDE}
    failures = {_name(each): done.exception() for each, done in begun.items() if done.exception()}
    for each, done in begun.items():
        if _name(each) not in failures:
            _tell(each, done.result())
    assert not failures, failures


@pytest.mark.timeout(400)
@pytest.mark.parametrize("scenario", [scenarios.master_again, scenarios.master_moved])
def test_failover_to_another_master_loses_no_message(
    today: Day, scenario: scenarios.Scenario, is_long: bool
) -> None:
    _tell(scenario, scenario(today, _OUT_LONG_S if is_long else _OUT_S))


@pytest.mark.timeout(400)
@_each_backend
@pytest.mark.usefixtures("_with_long")
@pytest.mark.parametrize("scenario", [*scenarios.SIDE_BY_SIDE, *scenarios.ALONE])
def test_long_network_fault_causes_no_uncounted_loss(today: Day, scenario: scenarios.Scenario) -> None:
    _tell(scenario, scenario(today, _OUT_LONG_S))
