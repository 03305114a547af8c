"""Contract tests of histories over ROS 2. Run by test_ros2.py in a separate network namespace.

DDS keeps a number of messages of any size, so the bound in bytes is left out.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import nep
from tests.nep.backends import test_contract_history as contract
from tests.nep.meeting import Make, meeting

_DOMAIN = "6"
LEFT_OUT = {
    "test_history_is_bounded_in_bytes_and_keeps_the_newest",
    "test_killed_and_restarted_publisher_repeats_no_history_to_an_early_subscriber",
}
globals().update({
    name: test
    for name, test in vars(contract).items()
    if name.startswith("test_") and name not in LEFT_OUT
})  # fmt: skip


@pytest.fixture(scope="module", autouse=True)
def somebody_who_knows_the_domain() -> Iterator[None]:
    with nep.node("knows", "ros2", master=_DOMAIN) as node:
        node.graph()
        yield


@pytest.fixture
def make() -> Iterator[Make]:
    with meeting("ros2", _DOMAIN) as new:
        yield new
