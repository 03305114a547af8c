"""Tests that child processes of a frozen Studio do not inherit the loader's environment variables."""

from __future__ import annotations

import pytest

from app.ui.other_programs import original_environment

OURS = {"LD_LIBRARY_PATH": "/opt/nep-studio/_internal", "_PYI_ARCHIVE_FILE": "/opt/nep-studio/nep-studio"}


@pytest.mark.parametrize(
    ("original", "inherited"),
    [({}, {}), ({"LD_LIBRARY_PATH_ORIG": "/usr/games"}, {"LD_LIBRARY_PATH": "/usr/games"})],
)
def test_child_process_receives_the_original_library_paths(
    original: dict[str, str], inherited: dict[str, str]
) -> None:
    environ = {"HOME": "/home/ana", **OURS, **original}
    before = dict(environ)
    with original_environment(environ, is_frozen=True):
        assert environ == {"HOME": "/home/ana", **inherited}
    assert environ == before


def test_library_paths_are_restored_after_an_exception() -> None:
    environ = dict(OURS)
    with pytest.raises(OSError, match="gone"), original_environment(environ, is_frozen=True):
        raise OSError("gone")
    assert environ == OURS


def test_source_checkout_leaves_the_environment_unchanged() -> None:
    environ = {"LD_LIBRARY_PATH": "/opt/ros/lib"}
    with original_environment(environ, is_frozen=False):
        assert environ == {"LD_LIBRARY_PATH": "/opt/ros/lib"}
    assert environ == {"LD_LIBRARY_PATH": "/opt/ros/lib"}
