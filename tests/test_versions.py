"""Tests of ``dev.py versions``: the Pythons it finds, the commands it runs in each, and failed steps."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import dev
from installers.macos import information
from tools.computer import ROOT, CommandError, Computer, venv_python
from tools.versions import OLDEST_MACOS, SUPPORTED, environment, find_interpreters, versions

HERE = "{}.{}".format(*sys.version_info[:2])
OTHERS = [each for each in SUPPORTED if each != HERE]
QT = {"pyside6", "pyside6-essentials", "pyside6-addons", "shiboken6", "pytest-qt"}


@dataclass
class Pythons:
    """Fake computer with chosen interpreters; venv creates empty folders, and a chosen step fails."""

    answers: Mapping[str, str]
    path: Mapping[str, str] = field(default_factory=dict)
    fails: str = "nothing at all"
    ran: list[list[str]] = field(default_factory=list)

    def ask(self, command: Sequence[str]) -> str:
        return self.answers.get(" ".join(command[: command.index("-c")]), "")

    def do(self, command: Sequence[str], environ: Mapping[str, str], log: Path | None) -> int:
        self.ran.append([str(each) for each in command])
        if "venv" in command:
            Path(command[-1]).mkdir(parents=True)
        return int(any(Path(each).name == self.fails for each in self.ran[-1]))

    def computer(self, platform: str = "linux", machine: str = "x86_64") -> Computer:
        return Computer(platform, machine, {}, which=self.path.get, ask=self.ask, do=self.do)


def here(**others: str) -> dict[str, str]:
    return {sys.executable: f"{HERE} cpython {sys.executable}\n", **others}


def test_pythons_are_found_on_the_path_by_the_launcher_and_in_pyenv(tmp_path: Path) -> None:
    first, second, third = OTHERS
    folders = [tmp_path / ".pyenv" / "versions" / f"{third}.{last}" for last in ("9", "10", "0t")]
    for each in folders:
        each.mkdir(parents=True)
    answers = here(
        **{
            "/bin/first": f"{first} cpython /bin/first\n",
            f"/py -{second}": f"{second} cpython C:/Program Files/python.exe\n",
            **{
                str(venv_python(each, "linux")): f"{third} cpython {each}/bin/real python\n"
                for each in folders
            },
        }
    )
    system = Pythons(answers, {f"python{first}": "/bin/first", "py": "/py"})
    assert find_interpreters(system.computer(), tmp_path) == {
        HERE: sys.executable,
        first: "/bin/first",
        second: "C:/Program Files/python.exe",
        third: f"{folders[1]}/bin/real python",
    }


@pytest.mark.parametrize("said", ["", "3.9 cpython /bin/x\n", "pyenv: python3.12: command not found", "\0"])
def test_interpreter_that_does_not_report_the_expected_version_is_ignored(said: str, tmp_path: Path) -> None:
    system = Pythons({"/shim": said, sys.executable: said}, {f"python{each}": "/shim" for each in SUPPORTED})
    assert find_interpreters(system.computer(), tmp_path) == {}
    with pytest.raises(CommandError, match="none of these Python versions was found; install one"):
        versions(system.computer(), [], tmp_path / "made", tmp_path)


def test_pypy_interpreter_is_ignored(tmp_path: Path) -> None:
    system = Pythons({sys.executable: f"{HERE} pypy {sys.executable}\n"})
    assert find_interpreters(system.computer(), tmp_path) == {}


def test_environments_are_created_once_with_hashes_and_missing_pythons_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for expected in (2, 0):
        system = Pythons(here())
        assert versions(system.computer(), [], tmp_path, tmp_path) == 0
        assert sum("venv" in command for command in system.ran) == expected
        assert sum("--require-hashes" in command for command in system.ran) == expected
    said = capsys.readouterr()
    assert f"not found on this computer: Python {', '.join(OTHERS)}\n" in said.out
    assert re.search(rf"Python {HERE}\s+ok", said.err)
    assert system.ran[-1][1:] == ["-m", "pytest", "-q", "tests/nep", "tests/interop"]
    assert all((ROOT / each).is_dir() for each in system.ran[-1][-2:])
    assert system.ran[2][1:2] == ["-I"], "the installed package is tested, not the sources"


def test_arguments_reach_pytest_and_given_folders_replace_the_default(tmp_path: Path) -> None:
    for given, rest in (
        (["-k", "wire"], ["-k", "wire", "tests/nep", "tests/interop"]),
        (
            ["tests/nep/protocol/test_wire.py::test_x", "-x"],
            ["tests/nep/protocol/test_wire.py::test_x", "-x"],
        ),
    ):
        system = Pythons(here())
        versions(system.computer(), ["--only", HERE, "--", *given], tmp_path, tmp_path)
        assert system.ran[-1][4:] == rest


def test_mac_package_uses_wheels_for_the_oldest_macos(tmp_path: Path) -> None:
    system = Pythons({})
    mac = system.computer("darwin", "arm64")
    environment(mac, "python3", tmp_path / "env", "package", is_for_oldest=True)
    _venv, download, install = system.ran
    assert download[2:4] == ["pip", "download"]
    assert f"macosx_{OLDEST_MACOS}_arm64" in download
    assert {"--no-deps", "--only-binary=:all:", "--require-hashes"} <= set(download)
    assert {"--no-index", "--no-deps", "--require-hashes"} <= set(install)
    assert download[download.index("--dest") + 1] == install[install.index("--find-links") + 1]
    assert {OLDEST_MACOS} == {each.replace(".", "_") for each in information.OLDEST_MACOS.values()}


@pytest.mark.parametrize(("platform", "is_for_oldest"), [("darwin", False), ("linux", True), ("win32", True)])
def test_pip_selects_the_wheels_except_for_the_oldest_macos(
    platform: str, is_for_oldest: bool, tmp_path: Path
) -> None:
    system = Pythons({})
    environment(
        system.computer(platform), "python3", tmp_path / "env", "package", is_for_oldest=is_for_oldest
    )
    _venv, install = system.ran
    assert install[2:4] == ["pip", "install"]
    assert "--no-index" not in install


@pytest.mark.parametrize(
    ("fails", "told"),
    [
        ("--force-reinstall", "plain: install"),
        ("check", "plain: pip check"),
        ("library_alone.py", "plain: use"),
    ],
)
def test_failed_step_is_reported_and_the_tests_still_run(
    fails: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    system = Pythons(here(), fails=fails)
    assert versions(system.computer(), [], tmp_path, tmp_path) == 1
    assert "pytest" in system.ran[-1]
    assert f"Python {HERE}  FAILED: {told}" in capsys.readouterr().err


def test_built_file_is_installed_instead_of_the_source_folder(tmp_path: Path) -> None:
    built = tmp_path / "nep_studio-1.0.0-py3-none-any.whl"
    system = Pythons(here())
    with pytest.raises(CommandError, match=f"there is no file {re.escape(str(built))}"):
        versions(system.computer(), ["--plain", "--install", str(built)], tmp_path, tmp_path)
    assert system.ran == []
    built.touch()
    assert versions(system.computer(), ["--plain", "--install", str(built)], tmp_path, tmp_path) == 0
    (ours,) = (command for command in system.ran if "--force-reinstall" in command)
    assert ours[-1] == str(built)


def test_failed_environment_is_recreated_and_failed_tests_are_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(CommandError, match="could not be created"):
        versions(Pythons(here(), fails="--require-hashes").computer(), [], tmp_path, tmp_path)
    for left in tmp_path.iterdir():
        left.rmdir()  # like venv --clear
    capsys.readouterr()
    assert versions(Pythons(here(), fails="pytest").computer(), [], tmp_path, tmp_path) == 1
    assert f"Python {HERE}  FAILED: tests" in capsys.readouterr().err


def test_unsupported_python_version_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        versions(Pythons(here()).computer(), ["--only", "3.9"], tmp_path, tmp_path)


def test_versions_command_needs_no_qt_libraries(tmp_path: Path) -> None:
    system = Pythons({})
    with pytest.raises(CommandError, match="none of these"):
        dev.run(system.computer(), "versions", ["--only", "3.13"])
    assert system.ran == []


@pytest.mark.parametrize("name", ["library", "test"])
def test_requirements_of_the_versions_environments_exclude_qt(name: str) -> None:
    ours = pinned(name)
    assert {"pyzmq", "orjson", "hatchling"} <= ours.keys()
    assert ours.keys().isdisjoint(QT)
    assert all(versions <= pinned("dev")[each] for each, versions in ours.items()), "the same everywhere"


def pinned(name: str) -> dict[str, set[str]]:
    """Return the pinned versions of each package in a requirements file; older Pythons may have their own."""
    text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    made: dict[str, set[str]] = {}
    for package, version in re.findall(r"^([\w.-]+)==(\S+)", text, re.MULTILINE):
        made.setdefault(package.lower(), set()).add(version)
    return made
