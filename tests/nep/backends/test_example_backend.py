"""Contract tests of the back end in examples/backend, which is installed as an entry point."""

from __future__ import annotations

import pytest

import nep
from nep.backends.base import find_backend
from nep.errors import MasterUnreachable
from tests.nep.backends import test_contract as contract
from tests.nep.backends.example_backend import installed, make, registered  # noqa: F401 - fixtures

globals().update({name: test for name, test in vars(contract).items() if name.startswith("test_")})


def test_entry_point_makes_the_back_end_available_by_its_name() -> None:
    assert find_backend("broker").name == "broker"


def test_missing_broker_is_reported_with_its_address() -> None:
    with (
        nep.node("a", "broker", master="127.0.0.1:9", wait_s=0.0) as node,
        pytest.raises(MasterUnreachable, match=r"127\.0\.0\.1:9"),
    ):
        node.new_pub("topic")
