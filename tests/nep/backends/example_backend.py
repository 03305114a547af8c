"""Fixtures that install the back end in examples/backend as an entry point and start its broker."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.nep.meeting import Make, meeting

EXAMPLE = Path(__file__).parents[3] / "examples" / "backend"


@pytest.fixture(scope="module", autouse=True)
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the example as pip does: its modules, and an entry point in its metadata."""
    site = tmp_path_factory.mktemp("site")
    metadata = site / "nep_broker-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: nep-broker\nVersion: 1\n", "utf-8")
    (metadata / "entry_points.txt").write_text("[nep.backends]\nbroker = nep_broker:BACKEND\n", "utf-8")
    sys.path[:0] = [str(site), str(EXAMPLE)]
    importlib.invalidate_caches()
    yield
    for each in (site, EXAMPLE):
        sys.path.remove(str(each))
    for module in ("broker", "nep_broker"):
        sys.modules.pop(module, None)
    importlib.invalidate_caches()


@pytest.fixture
def make() -> Iterator[Make]:
    """Factory of nodes at a new broker; they are closed after the test."""
    from broker import Broker

    with closing(Broker()) as broker, meeting("broker", broker.address) as new:
        yield new


@pytest.fixture
def registered(make: Make) -> Make:
    """The fixture `make`, because the back end knows all nodes."""
    return make
