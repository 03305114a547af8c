"""Tests of dev.py: the packages it finds missing, the commands it runs and the files it removes."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

import dev
from tools import system_packages

ROOT = Path(dev.__file__).parent
PACKAGES = [name.split("|")[-1] for name in system_packages.QT_LIBRARIES]


@dataclass
class FakeSystem:
    """Fake Debian whose installed and available packages a test chooses."""

    installed: set[str] = field(default_factory=set)
    listed: set[str] = field(default_factory=set)
    served: set[str] = field(default_factory=set)
    ran: list[tuple[str, ...]] = field(default_factory=list)
    fails: bool = False

    def which(self, name: str) -> str | None:
        return f"/usr/bin/{name}"

    def ask(self, command: Sequence[str]) -> str:
        if command[0] == "dpkg-query":
            known = self.installed.intersection(command)
            return "".join(f"{name} installed\n" for name in sorted(known)) + "libgone config-files\n"
        assert command[:2] == ["apt-cache", "policy"]
        return "".join(
            f"{name}:\n  Installed: (none)\n  Candidate: {'1.0' if name in self.listed else '(none)'}\n"
            for name in command[2:]
            if name in self.listed | self.installed | {"libasound2"}
        )

    def do(self, command: Sequence[str], environ: Mapping[str, str], log: Path | None) -> int:
        self.ran.append(tuple(command))
        if log:
            log.parent.mkdir(exist_ok=True)
            log.write_text("E: no space left\n", encoding="utf-8")
        if "update" in command:
            self.listed |= self.served
        elif "install" in command:
            if self.fails:
                return 100
            self.installed.update(command[command.index("install") + 1 :])
        return 0

    def computer(self, **changes: object) -> dev.Computer:
        known: dict[str, object] = {
            "platform": "linux",
            "environ": {"DISPLAY": ":0"},
            "root": True,
            "version": (3, 11),
            "has_ensurepip": True,
        }
        return dev.Computer(which=self.which, ask=self.ask, do=self.do, **(known | changes))


def test_no_command_runs_when_no_package_is_missing() -> None:
    system = FakeSystem(installed=set(PACKAGES))
    dev.install_system_packages(system.computer())
    assert system.ran == []


def test_only_missing_packages_are_installed_without_refreshing_valid_lists() -> None:
    system = FakeSystem(installed=set(PACKAGES) - {"libnss3"}, listed={"libnss3"})
    dev.install_system_packages(system.computer())
    assert [command[-1] for command in system.ran] == ["libnss3"]
    assert "DPkg::Lock::Timeout=600" in system.ran[0]


def test_missing_package_lists_are_refreshed_first() -> None:
    system = FakeSystem(served={*PACKAGES, "xvfb", "python3.11-venv"})
    dev.install_system_packages(system.computer(environ={}, has_ensurepip=False))
    assert ["update" in command for command in system.ran] == [True, False]
    assert {*PACKAGES, "xvfb", "python3.11-venv"} <= system.installed


def test_package_lists_are_refreshed_after_a_failure_and_a_second_failure_is_reported() -> None:
    system = FakeSystem(listed=set(PACKAGES), fails=True)
    with pytest.raises(dev.CommandError, match="no space left"):
        dev.install_system_packages(system.computer())
    assert [("update" in command) for command in system.ran] == [False, True, False]


def test_unavailable_package_is_named() -> None:
    system = FakeSystem(served=set(PACKAGES) - {"libnss3"})
    with pytest.raises(dev.CommandError, match="no package for libnss3"):
        dev.install_system_packages(system.computer())


@pytest.mark.parametrize("name", ["libasound2", "libasound2t64"])
def test_package_is_recognized_by_its_former_and_current_name(name: str) -> None:
    system = FakeSystem(installed=set(PACKAGES) - {"libasound2"} | {name})
    assert system_packages.missing_packages(system.computer()) == []
    found, unknown = system_packages.available(
        FakeSystem(listed={name}).computer(), ["libasound2t64|libasound2"]
    )
    assert (found, unknown) == ([name], [])


def test_user_without_root_is_shown_the_install_command() -> None:
    system = FakeSystem(installed=set(PACKAGES) - {"libnss3", "libgl1"}, listed={"libgl1"})
    with pytest.raises(dev.CommandError) as raised:
        dev.install_system_packages(system.computer(root=False))
    line = str(raised.value).splitlines()[-1]
    assert line.startswith("  sudo apt-get update && sudo apt-get install -y")
    assert line.endswith("libgl1 libnss3")
    assert system.ran == []


def test_test_packages_are_installed_by_root_and_printed_for_users_without_root(
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = {name for packages in system_packages.TEST_PACKAGES.values() for name in packages}
    system = FakeSystem(listed=names)
    system_packages.install_test_packages(system.computer(root=False))
    assert system.ran == []
    printed = capsys.readouterr().out
    assert all(name in printed for name in names)
    system_packages.install_test_packages(system.computer())
    assert system.installed >= names
    ran = len(system.ran)
    system_packages.install_test_packages(system.computer())
    assert len(system.ran) == ran


def test_unavailable_test_packages_do_not_block_installing_the_available_packages(
    capsys: pytest.CaptureFixture[str],
) -> None:
    mono, *others = system_packages.TEST_PACKAGES.values()
    system = FakeSystem(served={name for packages in others for name in packages})
    system_packages.install_test_packages(system.computer())
    assert system.installed.isdisjoint(mono)
    assert system.installed >= {name for packages in others for name in packages}
    assert "mono-mcs" in capsys.readouterr().out


def test_system_packages_command_installs_or_prints_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    system = FakeSystem(installed=set(PACKAGES) - {"libnss3"}, listed={"libnss3"})
    assert system_packages.main(system.computer(root=False)) == 2
    assert "sudo apt-get install" in capsys.readouterr().err
    assert system_packages.main(system.computer()) == 0
    assert "libnss3" in system.installed


def test_system_packages_are_not_installed_outside_linux_or_without_apt() -> None:
    system = FakeSystem()
    for platform in ("win32", "darwin"):
        computer = system.computer(platform=platform, environ={})
        assert computer.has_screen
        dev.install_system_packages(computer)
    dev.install_system_packages(replace(system.computer(), which=lambda name: None))
    assert system.ran == []


def test_unsupported_python_version_is_rejected_with_the_range() -> None:
    for version in ((3, 9), (3, 14)):
        with pytest.raises(dev.CommandError, match=r"3\.10 to 3\.13 is needed"):
            dev.run(FakeSystem().computer(version=version), "test", [])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Checkout with a virtual environment."""
    (tmp_path / "requirements").mkdir()
    for name in ("pyproject.toml", "requirements/studio.txt", "requirements/dev.txt"):
        (tmp_path / name).write_text(name, encoding="utf-8")
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    (tmp_path / ".venv" / "bin" / "python").touch()
    return tmp_path


def fake_pip(system: FakeSystem) -> dev.Computer:
    """Return a computer with a virtual environment in which pip works."""
    return replace(system.computer(), ask=lambda command: "26.0\n")


def test_packages_are_installed_once_and_again_when_the_pins_change(folder: Path) -> None:
    system = FakeSystem()
    for _ in range(2):
        assert dev.make_environment(fake_pip(system), folder, "dev") == folder / ".venv" / "bin" / "python"
    assert [("install" in command) for command in system.ran] == [True, True, True, False, False]
    assert "compileall" in system.ran[4], "the first start must not compile"
    (folder / "requirements" / "dev.txt").write_text("other", encoding="utf-8")
    dev.make_environment(fake_pip(system), folder, "dev")
    assert len(system.ran) == 10


@pytest.mark.parametrize("extra", ["studio", "dev"])
def test_packages_are_installed_by_hash_and_the_project_without_dependencies(
    folder: Path, extra: str
) -> None:
    system = FakeSystem()
    dev.make_environment(fake_pip(system), folder, extra)
    installer, packages, ours = (command for command in system.ran if "install" in command)
    assert installer[-3:] == ("--require-hashes", "-r", "requirements/installer.txt")
    assert packages[-3:] == ("--require-hashes", "-r", f"requirements/{extra}.txt")
    assert ours[-4:] == ("--no-deps", "--no-build-isolation", "-e", ".")


@pytest.mark.parametrize("missing", ["requirements/installer.txt", "uv"])
def test_pip_is_used_if_uv_cannot_be_installed_or_fails(
    folder: Path, missing: str, capsys: pytest.CaptureFixture[str]
) -> None:
    system = FakeSystem()

    def do(command: Sequence[str], environ: Mapping[str, str], log: Path | None) -> int:
        system.do(command, environ, log)
        return 1 if missing in command else 0

    dev.make_environment(replace(fake_pip(system), do=do), folder, "studio")
    assert "installing with pip, which takes longer" in capsys.readouterr().out
    packages, ours = [command for command in system.ran if "install" in command][-2:]
    assert "uv" not in packages
    assert packages[-3:] == ("--require-hashes", "-r", "requirements/studio.txt")
    assert ours[-1] == "."
    assert dev.is_fresh(folder, "studio")


def test_dev_environment_satisfies_studio_and_studio_environment_does_not_satisfy_dev(folder: Path) -> None:
    system = FakeSystem()
    dev.make_environment(fake_pip(system), folder, "studio")
    assert not dev.is_fresh(folder, "dev")
    dev.make_environment(fake_pip(system), folder, "dev")
    assert dev.is_fresh(folder, "studio")


def test_failed_installation_raises_and_the_environment_stays_outdated(folder: Path) -> None:
    failing = replace(fake_pip(FakeSystem()), do=lambda command, environ, log: 1)
    with pytest.raises(dev.CommandError, match="packages couldn't be installed"):
        dev.make_environment(failing, folder, "dev")
    assert not dev.is_fresh(folder, "dev")


def test_interpreter_path_of_the_environment_depends_on_the_operating_system() -> None:
    assert dev.venv_python(Path("v"), "win32") == Path("v/Scripts/python.exe")
    assert dev.venv_python(Path("v"), "darwin") == Path("v/bin/python")


def test_sandbox_is_disabled_only_for_root() -> None:
    system = FakeSystem()
    with dev.screen(system.computer(root=True)) as environ:
        assert environ["QTWEBENGINE_DISABLE_SANDBOX"] == "1"
    with dev.screen(system.computer(root=False)) as environ:
        assert environ == {"DISPLAY": ":0"}


@pytest.mark.skipif(sys.platform != "linux" or not shutil.which("Xvfb"), reason="no Xvfb")
def test_virtual_screen_is_closed_at_the_end_of_its_context() -> None:
    with dev.screen(FakeSystem().computer(environ={})) as environ:
        address = f"/tmp/.X11-unix/X{environ['DISPLAY'][1:]}"
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(address)
        assert Path(environ["XDG_RUNTIME_DIR"]).is_dir()
    assert not Path(environ["XDG_RUNTIME_DIR"]).exists()
    with socket.socket(socket.AF_UNIX) as client, pytest.raises((FileNotFoundError, ConnectionRefusedError)):
        client.connect(address)


WATCHING = """
import os, sys
from tools.computer import watch

STUBBORN = '''
import signal, sys
{handler}
print("up", flush=True)
sys.stdin.read()
'''

try:
    watch([sys.executable, "-c", STUBBORN], os.environ)
except KeyboardInterrupt:
    sys.exit(130)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="process groups of POSIX")
@pytest.mark.parametrize("handler", ["", "signal.signal(signal.SIGINT, signal.SIG_IGN)"])
def test_ctrl_c_ends_child_processes_that_ignore_the_signal(handler: str) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", WATCHING.replace("{handler}", handler)],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    with process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"up\n"
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(30) == 130
        # The pipe reaches its end only after the last process that holds it has exited.
        assert process.stdout.read() == b""


def test_missing_script_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    lacking = {"nothing": ("tools/nothing.py", "dev")}
    with pytest.raises(dev.CommandError, match=r"'nothing' needs 'tools/nothing.py'"):
        dev.script(FakeSystem().computer(), "nothing", [], lacking)


def test_unsupported_python_exits_with_code_2_and_an_error_message(
    capsys: pytest.CaptureFixture[str],
) -> None:
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    previous = [(number, signal.getsignal(number)) for number in numbers]
    try:
        code = dev.main(["demo"], FakeSystem().computer(version=(3, 9)))
    finally:
        for number, handler in previous:
            signal.signal(number, handler)
    assert code == 2
    assert capsys.readouterr().err.startswith("dev.py: Python 3.10 to 3.13 is needed")


def test_ci_runs_the_command_of_the_readme() -> None:
    last = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()[-1]
    assert last == "exec python3 dev.py test"
    assert "\npython3 dev.py test" in (ROOT / "README.md").read_text(encoding="utf-8")
