"""Groups of tests that run only with ``--long``, or when files that they depend on have changed.

A group runs when a file of its tests or its sources differs from the last release, is changed in the working
tree or is new; or when the command line names its tests. Without a release tag, the comparison is with the
branch point from ``main`` or, on ``main``, with the parent commit. A shallow clone may have neither: then no
group runs. CI runs all groups nightly with ``--long`` (.github/workflows/ci.yml).

Each group leaves at least one quick test of its area in every run.
"""

from __future__ import annotations

import subprocess
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
_MAIN = ("origin/HEAD", "origin/main", "main")
_GIT_TIMEOUT_S = 30.0


class Group(NamedTuple):
    """A group of long tests.

    Attributes:
        name: Name shown to the developer.
        tests: Prefixes of the paths of its tests; ``path::part``: only node IDs that contain the part.
        sources: Prefixes of other paths that the tests depend on.
        quick: Prefixes of the paths or node IDs of tests that run always.
    """

    name: str
    tests: tuple[str, ...]
    sources: tuple[str, ...]
    quick: tuple[str, ...] = ()

    @property
    def files(self) -> tuple[str, ...]:
        """Prefixes of the paths of the test files."""
        return _files(self)

    def includes(self, node_id: str) -> bool:
        """Return True for a test of the group."""
        return (
            node_id.startswith(_files(self))
            and not node_id.startswith(self.quick)
            and any(
                node_id.startswith(path) and part in node_id
                for path, _, part in (prefix.partition("::") for prefix in self.tests)
            )
        )


@cache
def _files(group: Group) -> tuple[str, ...]:
    return tuple(prefix.partition("::")[0] for prefix in group.tests)


GROUPS = (
    Group(
        "films",  # every run includes the film of test_path_mouse.py
        tests=(
            "tests/e2e/test_teacher_mouse.py",
            "tests/e2e/test_teacher_keyboard.py",
            "tests/e2e/test_path_keys.py",
        ),
        sources=("tests/e2e/film.py", "tests/e2e/fingers.py", "tests/e2e/teacher_session.py"),
    ),
    Group(
        "restarts of the window",  # every run includes the other tests of test_unsaved_work.py
        tests=(
            "tests/e2e/test_backpack.py",
            "tests/e2e/test_first_steps.py",
            "tests/e2e/test_layouts.py",
            "tests/e2e/test_report.py",
            "tests/e2e/test_tabs.py",
            "tests/e2e/test_two_studios.py",
            "tests/e2e/test_unsaved_work.py::tab_order",
            "tests/e2e/test_unsaved_work.py::after_quit",
            "tests/e2e/test_unsaved_work.py::discarded",
            "tests/e2e/test_virtual_robots.py",
        ),
        sources=(
            "app/core/projects/",
            "app/core/reports/",
            "app/core/storage/",
            "app/ui/shell/docking/",
            "app/ui/shell/projects.py",
            "app/ui/shell/window_state.py",
            "app/ui/startup/",
        ),
        quick=("tests/e2e/test_first_steps.py::test_first_steps_are_not_offered_again_after_kill_9",),
    ),
    Group(
        "questions and edits of running programs",  # every run includes test_behaviour.py
        tests=(
            "tests/e2e/test_ask.py",
            "tests/e2e/test_fights.py",
            "tests/e2e/test_run_habits.py",
            "tests/e2e/test_tries.py",
        ),
        sources=(
            "app/blocks/runtime/",
            "app/core/run/",
            "app/ui/panels/build/",
            "app/ui/shell/commands/behaviours.py",
            "app/ui/shell/dialogs/",
        ),
        quick=("tests/e2e/test_ask.py::test_question_is_answered_by_typing_and_enter",),
    ),
    Group(
        "menus and drags of the window",  # every run includes the film of test_path_mouse.py
        tests=(
            "tests/e2e/test_alerts.py",
            "tests/e2e/test_carrying.py",
            "tests/e2e/test_habits.py",
            "tests/e2e/test_menu_keys.py",
        ),
        sources=(
            "app/blocks/editor/src/",
            "app/ui/blockly/",
            "app/ui/shell/actions/",
            "app/ui/shell/bars/",
            "app/ui/shell/commands/",
        ),
        quick=(
            "tests/e2e/test_carrying.py::test_blocks_dropped_on_another_tab",
            "tests/e2e/test_menu_keys.py::test_alt_and_a_letter",
        ),
    ),
    Group(
        "ROS 1",  # every run includes a bridge, a topic and the services of a ROS client: see quick
        tests=(
            "tests/core/networks/test_looking.py::ros_1",
            "tests/nep/backends/test_ros.py",
            "tests/nep/backends/test_ros_faults.py",
            "tests/nep/backends/test_ros_services.py",
            "tests/nep/bridges/test_ros_bridge.py",
        ),
        sources=(
            "app/core/networks/",
            "nep/backends/base.py",
            "nep/backends/bases/",
            "nep/backends/connection.py",
            "nep/backends/ros/",
            "nep/backends/ros_types/",
            "nep/backends/services.py",
            "nep/programs/bridges/",
            "nep/protocol/service_wire.py",
            "tests/core/networks/watching_child.py",
            "tests/nep/backends/ros_",
            "tests/nep/backends/test_contract",
            "tests/nep/bridges/joined.py",
            "tests/nep/services/test_calls.py",
        ),
        quick=(
            "tests/nep/backends/test_ros.py::test_nep_receives_messages_from_a_ros_program",
            "tests/nep/backends/test_ros_services.py::test_ros_client_calls_a_nep_server",
        ),
    ),
    Group(
        "concurrent self-tests",  # every run includes a self-test with the editor and one that fails
        tests=("tests/e2e/test_self_test.py::without_editor",),
        sources=("app/__main__.py", "app/core/self_test/", "app/ui/self_test.py"),
    ),
    Group(
        "ROS 2",  # every run includes the contract over Cyclone DDS: test_ros2.py[test_contract.py-]
        tests=("tests/nep/backends/test_ros2.py::[ros2_", "tests/nep/bridges/test_ros2_bridge.py"),
        sources=(
            "nep/backends/ros2/",
            "nep/backends/base.py",
            "nep/backends/ros_types/typed_services.py",
            "nep/programs/bridges/",
            "tests/nep/backends/cyclone_service_peer.py",
            "tests/nep/backends/dust_",
            "tests/nep/backends/fastdds_peer.cpp",
            "tests/nep/backends/ros2_",
            "tests/nep/backends/test_contract",
            "tests/nep/bridges/joined.py",
            "tests/nep/bridges/ros2_",
        ),
    ),
    Group(
        "example back end",  # every run includes its topics without variants: test_example_backend.py
        tests=(
            "tests/nep/backends/test_example_backend.py::[",
            "tests/nep/backends/test_example_backend.py::many_threads",
            "tests/nep/backends/test_example_backend.py::without_loss",
            "tests/nep/backends/test_example_backend_services.py",
        ),
        sources=(
            "examples/backend/",
            "nep/backends/bases/",
            "nep/backends/base.py",
            "nep/backends/services.py",
            "nep/protocol/service_wire.py",
            "tests/nep/backends/example_backend.py",
            "tests/nep/backends/test_contract.py",
            "tests/nep/services/test_calls.py",
        ),
    ),
    Group(
        "interop",  # every run includes tests/interop/gateway and the programs of test_javascript.py
        tests=(
            "tests/interop/test_csharp.py",
            "tests/interop/test_matrix.py",
            "tests/interop/test_pictures.py",
            "tests/interop/test_programs.py",
            "tests/interop/test_services.py",
            "tests/interop/test_under_attack.py",
            "tests/e2e/test_rize.py",
        ),
        sources=(
            "clients/",
            "nep/backends/zeromq/",
            "nep/masters/",
            "nep/messages/",
            "nep/programs/gateway/",
            "nep/protocol/",
            "tests/clients/mono_programs.py",
            "tests/clients/node_programs.py",
            "tests/clients/test_directions.py",
            "tests/interop/",
        ),
    ),
    Group(
        "clients in other languages",  # every run includes the exchange of messages and services
        tests=(
            "tests/clients/test_csharp",
            "tests/clients/test_directions.py::listings",
            "tests/clients/test_javascript.py::_beyond_the_in_flight_limit",
            "tests/clients/test_javascript.py::blocked_subscriber",
            "tests/clients/test_javascript.py::conformance_rule",
            "tests/clients/test_javascript.py::driver_contract",
            "tests/clients/test_javascript.py::its_own_tests",
            "tests/clients/test_javascript.py::killed",
        ),
        sources=(
            "app/robots/description/",
            "clients/",
            "nep/backends/base.py",
            "nep/backends/bases/",
            "nep/backends/tcp.py",
            "nep/backends/zeromq/",
            "nep/masters/",
            "nep/messages/",
            "nep/programs/conformance/",
            "nep/protocol/",
            "tests/clients/mono_programs.py",
            "tests/clients/node_programs.py",
            "tests/nep/backends/test_other_clocks.py",
            "tests/nep/backends/test_unheard_publishers.py",
            "tests/nep/masters/test_attacks.py",
            "tests/robots/conftest.py",
            "tests/robots/driver/driver_program.py",
            "tests/robots/driver/test_contract.py",
        ),
        quick=(
            "tests/clients/test_csharp.py::test_late_subscriber_receives_latched_message_and_history",
            "tests/clients/test_csharp.py::test_listing_",
            "tests/clients/test_csharp.py::test_master_restart_under_traffic_loses_nothing",
            "tests/clients/test_csharp.py::test_payloads_of_every_type_arrive_in_both_directions",
            "tests/clients/test_csharp.py::test_services_are_called_in_both_directions",
            "tests/clients/test_csharp_vectors.py::test_messages_are_decoded_and_encoded_as_in_the_vectors",
            "tests/clients/test_csharp_zmtp.py::test_sub_socket_sends_sorted_filters",
        ),
    ),
    Group(
        "rules of the conformance check",  # every run checks a correct client and nep's own with all rules
        tests=("tests/nep/conformance/test_rules.py::one_error",),
        sources=(
            "nep/masters/graph.py",
            "nep/messages/codecs.py",
            "nep/programs/conformance/",
            "nep/protocol/",
            "tests/nep/conformance/",
        ),
    ),
    Group(
        "build of the block editor",  # every run checks the files of the committed bundle
        tests=(
            "tests/ui/blockly/test_bundle.py::failed_build",
            "tests/ui/blockly/test_bundle.py::rebuild",
            "tests/ui/blockly/test_bundle.py::type_checking",
        ),
        sources=("app/blocks/editor/", "app/ui/blockly/messages.py", "resources/blockly/"),
    ),
    Group(
        "soak",
        tests=("tests/e2e/test_soak.py",),
        sources=(
            "app/core/messages/",
            "app/core/network/",
            "app/core/series/",
            "app/ui/pictures/",
            "bench/soak.py",
            "bench/studio_window.py",
            "nep/backends/zeromq/",
        ),
    ),
    Group(
        "high DPI",  # every run includes tests/ui/theme/test_text_sizes.py
        tests=("tests/ui/theme/test_high_dpi.py",),
        sources=(
            "app/ui/shell/",
            "app/ui/theme/",
            "app/ui/widgets/",
            "tests/ui/clipping.py",
            "tests/ui/theme/",
        ),
    ),
    Group(
        "layout permutations",
        tests=("tests/ui/shell/test_layout_orders.py",),
        sources=("app/ui/panels/base.py", "app/ui/panels/registry.py", "app/ui/shell/"),
    ),
    Group(
        "installed wheel",  # every run includes the other tests of the wheel
        tests=("tests/test_distribution.py::installed_wheel",),
        sources=(
            "hatch_build.py",
            "nep/__init__.py",
            "nep/public.py",
            "pyproject.toml",
            "requirements/",
            "tools/library_alone.py",
        ),
    ),
    Group(
        "installers",
        tests=("tests/installers/",),
        sources=("dev.py", "installers/", "nep/locale/", "nep/version.py", "pyproject.toml", "requirements/"),
        quick=("tests/installers/test_contents.py",),
    ),
)


class Changes(NamedTuple):
    """Paths of changed files, and the revision that they are compared with; None when it is unknown."""

    base: str | None
    paths: frozenset[str] = frozenset()


def changes(root: Path = ROOT) -> Changes:
    """Return the files of the working tree that differ from the last release or its replacement."""
    base = _base(root)
    changed = _git(root, "diff", "--name-only", "--no-renames", "-z", base, "--") if base else None
    new = _git(root, "ls-files", "--others", "--exclude-standard", "-z")
    if changed is None or new is None:
        return Changes(None)
    return Changes(base, frozenset(filter(None, f"{changed}\0{new}".split("\0"))))


def _base(root: Path) -> str | None:
    parent = _git(root, "rev-parse", "--verify", "--quiet", "HEAD^")
    if not parent:
        return None
    # Start at the parent: the commit of a release is compared with the previous release.
    if tag := _git(root, "describe", "--tags", "--abbrev=0", "--match=v[0-9]*", parent):
        return tag
    head = _git(root, "rev-parse", "HEAD")
    for main in _MAIN:
        base = _git(root, "merge-base", "HEAD", main)
        if base and base != head:
            return base[:12]
    return parent[:12]


def _git(root: Path, *arguments: str) -> str | None:
    # None when git is missing or fails, as outside a repository.
    try:
        done = subprocess.run(
            ["git", *arguments],
            cwd=root,
            capture_output=True,
            encoding="utf-8",
            errors="surrogateescape",
            timeout=_GIT_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def skipped_groups(changed: Iterable[str], arguments: Sequence[str] = ("tests",)) -> tuple[str, ...]:
    """Return the names of groups to skip, in the order of `GROUPS`.

    Args:
        changed: Paths of changed files, relative to the repository.
        arguments: Files, folders or node IDs given to pytest, relative to the repository. Groups outside of
            them are omitted, and so are those whose tests they name.
    """
    paths = tuple(changed)
    return tuple(
        group.name
        for group in GROUPS
        if not any(path.startswith((*group.sources, *group.files)) for path in paths)
        and any(name.startswith(argument) for argument in arguments for name in group.files)
        and not any(argument.startswith(group.files) for argument in arguments)
    )


def relative_arguments(arguments: Iterable[str], folder: Path) -> tuple[str, ...]:
    """Return pytest's arguments, given in `folder`, relative to the repository; "" is the repository."""
    found = []
    for argument in arguments:
        path, separator, test = argument.partition("::")
        full = (folder / path).resolve()
        if full.is_relative_to(ROOT):
            relative = full.relative_to(ROOT).as_posix().removeprefix(".")
            found.append(f"{relative}{'/' if relative and full.is_dir() else ''}{separator}{test}")
    return tuple(found)


def is_skipped(node_id: str, skipped: Sequence[str]) -> bool:
    """Return True for a test that belongs to a skipped group."""
    return any(group.name in skipped and group.includes(node_id) for group in GROUPS)


def report(skipped: Sequence[str], base: str | None) -> str:
    """Return the line that names the skipped groups and how to run them; "" when all run."""
    if not skipped:
        return ""
    reason = f"unchanged since {base}" if base else "changed files unknown in this clone"
    return f"Skipped ({reason}): {', '.join(skipped)}. To run all tests: python3 dev.py test -- --long"
