"""What the tests of the library share."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import pytest

from nep.masters.master import Master
from tests.nep.meeting import BACKENDS, Make, meeting, place_for


@pytest.fixture(params=BACKENDS)
def make(request: pytest.FixtureRequest, master: Master) -> Iterator[Make]:
    """Makes nodes that can meet, over each back end."""
    with meeting(request.param, place_for(request.param, master.address)) as new:
        yield new


@pytest.fixture
def frequent_switching() -> Iterator[None]:
    """Let threads take turns a hundred times as often as usual, so that races show."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(usual / 100)
    yield
    sys.setswitchinterval(usual)
