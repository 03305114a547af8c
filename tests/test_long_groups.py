"""Tests of the groups of long tests, which are skipped while their files are unchanged."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.long_groups import GROUPS, ROOT, changes, is_skipped, relative_arguments, report, skipped_groups

NAMES = tuple(group.name for group in GROUPS)
E2E_NAMES = (
    "films",
    "restarts of the window",
    "questions and edits of running programs",
    "menus and drags of the window",
    "concurrent self-tests",
    "interop",
    "soak",
)


def git(folder: Path, *arguments: str) -> None:
    identity = ("-c", "user.name=Test", "-c", "user.email=test@example.org", "-c", "tag.gpgSign=false")
    command = ("git", "-C", str(folder), *identity, "-c", "commit.gpgSign=false", *arguments)
    subprocess.run(command, check=True, capture_output=True)


def commit(folder: Path, name: str) -> None:
    (folder / name).write_text(name, encoding="utf-8")
    git(folder, "add", name)
    git(folder, "commit", "--quiet", "--message", name)


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """Repository with three commits, each of which adds a file."""
    folder = tmp_path / "repository"
    git(tmp_path, "init", "--quiet", "--initial-branch=main", str(folder))
    for name in ("first", "second", "third"):
        commit(folder, name)
    return folder


def test_changed_and_new_files_are_compared_with_the_last_release(repository: Path) -> None:
    git(repository, "tag", "v0.1.0", "HEAD^^")
    (repository / "first").write_text("changed", encoding="utf-8")
    (repository / "näw file").touch()
    assert changes(repository) == ("v0.1.0", {"first", "second", "third", "näw file"})


def test_release_commit_is_compared_with_the_previous_release(repository: Path) -> None:
    git(repository, "tag", "v0.1.0", "HEAD^")
    git(repository, "tag", "v0.2.0")
    assert changes(repository) == ("v0.1.0", {"third"})


def test_changes_without_a_tag_are_compared_with_the_parent_or_branch_point(repository: Path) -> None:
    assert changes(repository).paths == {"third"}
    git(repository, "checkout", "--quiet", "-b", "topic")
    for name in ("fourth", "fifth"):
        commit(repository, name)
    assert changes(repository).paths == {"fourth", "fifth"}


def test_changes_are_unknown_in_a_shallow_clone_and_outside_a_repository(
    repository: Path, tmp_path: Path
) -> None:
    shallow = tmp_path / "shallow"
    git(tmp_path, "clone", "--quiet", "--depth=1", repository.as_uri(), str(shallow))
    plain = tmp_path / "plain"
    plain.mkdir()
    assert changes(shallow).base is None
    assert changes(plain).base is None
    assert "changed files unknown" in report(NAMES, None)


@pytest.mark.parametrize(
    ("path", "run"),
    [
        ("installers/linux/packer.py", {"installers"}),
        ("dev.py", {"installers"}),
        ("nep/backends/ros2/names.py", {"ROS 2"}),
        ("nep/backends/ros/transport.py", {"ROS 1"}),
        ("nep/programs/gateway/relay.py", {"interop"}),
        ("clients/csharp/src/Node.cs", {"clients in other languages", "interop"}),
        ("app/blocks/editor/src/drag.ts", {"build of the block editor", "menus and drags of the window"}),
        ("tests/nep/backends/test_ros2.py", {"ROS 2"}),
        ("bench/soak.py", {"soak"}),
        ("app/ui/theme/fonts.py", {"high DPI"}),
        ("app/ui/shell/docking/dock.py", {"high DPI", "layout permutations", "restarts of the window"}),
        ("app/blocks/runtime/child.py", {"questions and edits of running programs"}),
        ("app/ui/blockly/bridge.py", {"menus and drags of the window"}),
        ("tests/e2e/teacher_session.py", {"films"}),
        ("README.md", set()),
    ],
)
def test_changed_file_runs_the_groups_that_depend_on_the_file(path: str, run: set[str]) -> None:
    assert set(NAMES) - set(skipped_groups([path])) == run


def test_groups_named_on_the_command_line_run() -> None:
    assert skipped_groups([]) == NAMES
    assert skipped_groups([], ["tests/installers/test_linux.py::test_x", "tests/robots/"]) == ()
    assert skipped_groups([], ["tests/e2e/"]) == E2E_NAMES
    assert relative_arguments(["ui", "../dev.py::x"], ROOT / "tests") == ("tests/ui/", "dev.py::x")


def test_each_group_has_tests_and_sources_that_exist() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("needs git and a clone")
    files = listed.stdout.splitlines()
    for group in GROUPS:
        for prefix in (*group.files, *group.sources, *group.quick):
            path, _, test = prefix.partition("::")
            found = [file for file in files if file.startswith(path)]
            assert found, prefix
            assert not test or f"def {test}" in (ROOT / found[0]).read_text(encoding="utf-8"), prefix


def test_only_tests_of_skipped_groups_are_skipped() -> None:
    assert is_skipped("tests/installers/test_linux.py::test_x", ["installers"])
    assert not is_skipped("tests/installers/test_linux.py::test_x", ["soak"])
    assert not is_skipped("tests/installers/test_contents.py::test_x", ["installers"])
    ask = "tests/e2e/test_ask.py::test_"
    assert is_skipped(f"{ask}stop_removes_the_choices_of_a_question", NAMES)
    assert not is_skipped(f"{ask}question_is_answered_by_typing_and_enter", NAMES)
    ros2 = "tests/nep/backends/test_ros2.py::test_inside"
    assert is_skipped(f"{ros2}[ros2_child.py-]", ["ROS 2"])
    assert not is_skipped(f"{ros2}[test_contract.py-]", ["ROS 2"])


def test_report_names_skipped_groups_and_the_command_to_run_them() -> None:
    line = report(("soak", "films"), "v0.1.0")
    assert "v0.1.0" in line
    assert "soak, films" in line
    assert line.endswith("dev.py test -- --long")
    assert report((), "v0.1.0") == ""
