"""Fixtures of the tests of the core."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.core.session import Session
from app.core.storage.settings import Settings
from nep.masters.master import Master


@pytest.fixture(scope="module", autouse=True)
def _own_home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Set Studio's home to a temporary folder, so that tests don't write to the developer's own."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("NEP_STUDIO_HOME", str(tmp_path_factory.mktemp("home")))
        yield


@pytest.fixture
def session(
    master: Master, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, patient_robots: None
) -> Iterator[Session]:
    """Session on the test's own master, with all its files in the test's folder.

    Robots get half a minute to reply, because a busy computer may need more than the default; see
    `tests.blocks.wire_robot.usual_time_limits` for robots that don't reply.
    """
    monkeypatch.setenv("NEP_STUDIO_HOME", str(tmp_path))
    made = Session(
        Settings(tmp_path),
        address=master.address,
        journal_folder=tmp_path / "journal",
        start_processes=False,
    )
    made.start()
    yield made
    made.close()
