"""Shared fixtures of the library's tests."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

from nep.masters.master import Master
from tests.nep.meeting import BACKENDS, Make, meeting, place_for


@pytest.fixture(params=BACKENDS)
def make(request: pytest.FixtureRequest, master: Master) -> Iterator[Make]:
    """Function that creates nodes in the same network, for each back end."""
    with meeting(request.param, place_for(request.param, master.address)) as new:
        yield new


@pytest.fixture
def frequent_switching() -> Iterator[None]:
    """Switch threads a hundred times as often as usual, so that races occur."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(usual / 100)
    yield
    sys.setswitchinterval(usual)
