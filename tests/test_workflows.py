"""Tests of the workflows in .github with a linter, and of the results of their shell steps."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from nep.version import __version__
from tools.versions import SUPPORTED

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / ".github" / "workflows"
PROGRAMS = Path(sys.executable).parent
TAG = f"v{__version__}"
SUMS = "SHA256SUMS"


def workflow(name: str) -> dict[str, Any]:
    return YAML(typ="safe", pure=True).load((FOLDER / f"{name}.yml").read_text(encoding="utf-8"))


def checked(*arguments: str | Path, given: str | None = None) -> subprocess.CompletedProcess[str]:
    """Run the workflow linter, which calls shellcheck for scripts; both are in the environment."""
    program = shutil.which("jactionlint", path=PROGRAMS)
    if program is None:
        pytest.skip("needs jactionlint (the extra dev)")
    return subprocess.run(
        [program, "--no-online", "--strict-exit", "--color=never", *arguments],
        input=given,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PATH": f"{PROGRAMS}{os.pathsep}{os.environ['PATH']}"},
    )


def test_workflow_linter_finds_no_problems() -> None:
    # Runners retired at a date must not fail a test; docs/release.md lists the check for a release.
    done = checked("--ignore", "GitHub retired it", *sorted(FOLDER.glob("*.yml")))
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)


def test_workflow_linter_detects_mistakes() -> None:
    text = (FOLDER / "release.yml").read_text(encoding="utf-8")
    for good, bad, rule in (
        ("github.ref_type", "github.ref_typo", "undefined-property"),
        ("contents: read", "contents: reed", "permissions"),
        ("runner: macos-26", "runner: macos-62", "unknown-runner-label"),
        ('"$SYSTEM"', "$(echo $SYSTEM", "shellcheck"),
        (f"@{'3d3c42e5aac5ba805825da76410c181273ba90b1'}", "@v7", "unpinned-uses"),
    ):
        assert good in text
        done = checked("-", given=text.replace(good, bad))
        assert done.returncode == 1
        assert rule in done.stdout, done.stdout


def test_actions_are_official_and_pinned_with_their_version() -> None:
    for path in FOLDER.glob("*.yml"):
        for line in re.findall(r"uses: (.+)", path.read_text(encoding="utf-8")):
            assert re.fullmatch(r"actions/[a-z-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line), line


def test_only_the_draft_job_has_write_permission() -> None:
    for name in ("ci", "release"):
        told = workflow(name)
        assert told["permissions"] == {"contents": "read"}
        writing = {job for job, about in told["jobs"].items() if about.get("permissions")}
        assert writing == ({"draft"} if name == "release" else set())


def test_ci_runs_the_readme_command_on_three_systems_with_oldest_and_newest_python() -> None:
    job = workflow("ci")["jobs"]["test"]
    assert "\npython3 dev.py test " in (ROOT / "README.md").read_text(encoding="utf-8")
    assert job["steps"][-1]["run"] == "python dev.py test"
    matrix = job["strategy"]["matrix"]
    assert matrix["python"] == [SUPPORTED[0], SUPPORTED[-1]]
    assert [runner.partition("-")[0] for runner in matrix["runner"]] == ["windows", "macos", "ubuntu"]


def test_nightly_job_runs_all_tests() -> None:
    ci = workflow("ci")
    nightly = ci["jobs"]["nightly"]
    assert "schedule" in ci["on"]
    assert "schedule" in nightly["if"]
    assert nightly["steps"][-1]["run"] == "python dev.py test -- --long"


# ---- workflow steps, run locally ------------------------------------------------------------------


def run(folder: Path, script: str, environ: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    """Run a step like a GitHub runner; programs in `folder`/bin take precedence."""
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **environ, "PATH": f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"},
    )


def steps(job: str, *names: str) -> list[dict[str, Any]]:
    """Return the steps of a job of release.yml that run a script; those with these names, or all."""
    found = [step for step in workflow("release")["jobs"][job]["steps"] if "run" in step]
    return [step for step in found if step["name"] in names] if names else found


def program(folder: Path, name: str, script: str) -> None:
    path = folder / "bin" / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/usr/bin/env bash\n{script}\n", encoding="utf-8")
    path.chmod(0o755)


def with_sums(folder: Path, files: Mapping[str, bytes], newline: str = "\n") -> None:
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    lines = [f"{hashlib.sha256(content).hexdigest()}  {name}{newline}" for name, content in files.items()]
    (folder / SUMS).write_bytes("".join(lines).encode())


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Working directory of a runner: the sources that the steps need, and packages with checksum lists."""
    if sys.platform != "linux":
        pytest.skip("these steps run on Linux only")
    for name in ("tools/__init__.py", "tools/release_notes.py", "nep/__init__.py", "nep/version.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copyfile(ROOT / name, tmp_path / name)
    (tmp_path / "CHANGELOG.md").write_text(
        f"# Changelog\n\n## {__version__}\n\n- [A thing](docs/web.md)\n", encoding="utf-8"
    )
    with_sums(tmp_path / "packages" / "package-windows", {"one-setup.exe": b"1", "one.zip": b"2"}, "\r\n")
    with_sums(tmp_path / "packages" / "package-linux", {"one.deb": b"3", "one two.tar.xz": b"4"})
    program(tmp_path, "gh", 'printf "%s\\n" "$@" > gh-call; env | grep ^GH_ >> gh-call')
    return tmp_path


def drafted(place: Path) -> int:
    """Run all steps of the jobs "notes" and "draft"; return the exit code of the first failure, or 0."""
    runner = {
        "GITHUB_REF_NAME": TAG,
        "GITHUB_SERVER_URL": "https://example.org",
        "GITHUB_REPOSITORY": "nep/studio",
        "GH_TOKEN": "a token",
        "GH_REPO": "nep/studio",
    }
    for step in (*steps("notes"), *steps("draft")):
        done = run(place, step["run"], runner)
        if done.returncode != 0:
            return done.returncode
    return 0


def test_draft_has_all_packages_one_checksum_list_and_the_notes(place: Path) -> None:
    assert drafted(place) == 0
    files = {"one-setup.exe": b"1", "one.zip": b"2", "one.deb": b"3", "one two.tar.xz": b"4"}
    release = place / "release"
    assert {path.name for path in release.iterdir()} == {*files, SUMS}
    assert sorted((release / SUMS).read_text(encoding="utf-8").splitlines()) == sorted(
        f"{hashlib.sha256(content).hexdigest()}  {name}" for name, content in files.items()
    )
    assert (place / "notes.md").read_text(encoding="utf-8") == (
        f"- [A thing](https://example.org/nep/studio/blob/{TAG}/docs/web.md)\n"
    )
    said = (place / "gh-call").read_text(encoding="utf-8").splitlines()
    assert said[:9] == [
        "release", "create", TAG, "--draft", "--verify-tag", "--title", f"NEP Studio {__version__}",
        "--notes-file", "notes.md",
    ]  # fmt: skip
    assert set(said[9:14]) == {f"release/{name}" for name in (*files, SUMS)}
    assert "GH_REPO=nep/studio" in said


def test_package_with_a_wrong_checksum_is_not_drafted(place: Path) -> None:
    (place / "packages" / "package-linux" / "one.deb").write_bytes(b"another")
    assert drafted(place) != 0
    assert not (place / "gh-call").exists()


def test_two_packages_with_the_same_name_are_not_drafted(place: Path) -> None:
    with_sums(place / "packages" / "package-macos", {"one.deb": b"3"})
    assert drafted(place) != 0
    assert not (place / "gh-call").exists()


def test_tag_that_differs_from_the_version_stops_the_release(place: Path) -> None:
    (place / "nep" / "version.py").write_text('__version__ = "99.0.0"\n', encoding="utf-8")
    assert drafted(place) == 1
    assert not (place / "release").exists()
    jobs = workflow("release")["jobs"]
    assert [jobs[name]["needs"] for name in ("library", "clients", "package")] == ["notes"] * 3
    assert (jobs["try"]["needs"], jobs["draft"]["needs"]) == ("package", ["library", "clients", "try"])


# ---- tests of the packages, with fake programs of each system --------------------------------------

STUDIO = """#!/usr/bin/env bash
[ "$1" = --selftest ] && mkdir -p "$2" && echo '{"ok": true}' > "$2/report.json" && echo "$0" >> {said}
"""
STAND_INS = {
    "windows": {
        "cygpath": 'echo "${@: -1}"',
        "reg": '[ -e "$HOME/registry" ]',
        "7z": 'for word in "$@"; do case $word in -o*) mkdir "${word#-o}/NEP Studio"; '
        'cp studio "${word#-o}/NEP Studio/nep-studio.exe";; esac; done',
        "sleep": "true",
    },
    "macos": {
        "hdiutil": '[ "$1" = detach ] && exec rm -R "$2"; mkdir -p "$5/NEP Studio.app/Contents/MacOS"; '
        'cp studio "$5/NEP Studio.app/Contents/MacOS/nep-studio"; [ -f "$6" ]',
        "ditto": 'cp -R "$1" "$2"',
        "codesign": '[ -d "${@: -1}" ]',
    },
    "linux": {
        "sudo": 'exec "$@"',
        "apt-get": 'case "$*" in *.deb) [ -f "${@: -1}" ] && cp studio bin/nep-studio;; '
        "purge*) rm bin/nep-studio;; esac",
        "dpkg-query": 'echo /; echo "$PWD/bin/nep-studio"',
        "xvfb-run": 'while [[ $1 == --* ]]; do shift; done; exec "$@"',
    },
}
SETUP = """#!/usr/bin/env bash
[ "$1" = /S ] || exit 9
mkdir -p "$LOCALAPPDATA/Programs/NEP Studio" && touch "$HOME/registry"
cp studio "$LOCALAPPDATA/Programs/NEP Studio/nep-studio.exe"
cp remove "$LOCALAPPDATA/Programs/NEP Studio/uninstall.exe"
"""
REMOVE = """#!/usr/bin/env bash
[ "$1" = /S ] && rm -R "$(dirname "$0")" "$HOME/registry"
"""


@pytest.fixture
def runner(tmp_path: Path, request: pytest.FixtureRequest) -> tuple[Path, str]:
    """Directory of a new computer with the packages, and the name of its system."""
    system: str = request.param
    if sys.platform != "linux":
        pytest.skip("needs bash, with fake programs of other systems on PATH")
    place = tmp_path / "a computer"
    (place / "dist").mkdir(parents=True)
    for name, script in STAND_INS[system].items():
        program(place, name, script)
    for name, script in (
        ("studio", STUDIO.replace("{said}", f"'{place}/started'")),
        ("remove", REMOVE),
        ("dist/NEP-Studio-1.2.3-setup.exe", SETUP),
    ):
        (place / name).write_text(script, encoding="utf-8")
        (place / name).chmod(0o755)
    packages = (
        "NEP-Studio-1.2.3-macos-arm64.dmg",
        "NEP-Studio-1.2.3-windows-x64.zip",
        "nep-studio_1.2.3_amd64.deb",
    )
    for name in packages:
        (place / "dist" / name).touch()
    with tarfile.open(place / "dist" / "NEP-Studio-1.2.3-linux-x86_64.tar.xz", "w:xz") as archive:
        archive.add(place / "studio", "NEP Studio/nep-studio")
    return place, system


def tried(place: Path, system: str) -> str:
    """Run the steps of the job "try" for a system; return the name of the failed step, or "" for none."""
    temporary = place / "temporary"
    temporary.mkdir()
    known = {"HOME": str(place), "LOCALAPPDATA": str(place / "Ñandú"), "RUNNER_TEMP": str(temporary)}
    kept = place / "environment"
    for step in steps("try"):
        condition = step.get("if", "")
        if f"!= '{system}'" in condition or ("== '" in condition and f"== '{system}'" not in condition):
            continue
        kept.touch()
        given = dict(line.split("=", 1) for line in kept.read_text(encoding="utf-8").splitlines())
        done = run(place, step["run"], {**known, **given, "GITHUB_ENV": str(kept)})
        if done.returncode != 0:
            return str(step["name"])
    return ""


@pytest.mark.parametrize(
    ("runner", "installed", "portable"),
    [
        (
            "windows",
            "Ñandú/Programs/NEP Studio/nep-studio.exe",
            "temporary/a folder/NEP Studio/nep-studio.exe",
        ),
        ("macos", "Applications/NEP Studio.app/Contents/MacOS/nep-studio", None),
        ("linux", "bin/nep-studio", "temporary/a folder/NEP Studio/nep-studio"),
    ],
    indirect=["runner"],
)
def test_package_is_installed_self_tested_and_removed(
    runner: tuple[Path, str], installed: str, portable: str | None
) -> None:
    place, system = runner
    assert tried(place, system) == ""
    started = (place / "started").read_text(encoding="utf-8").splitlines()
    assert started == [str(place / name) for name in (installed, portable) if name]
    assert (place / "out" / "installed" / "report.json").is_file()
    assert not (place / installed).exists()


@pytest.mark.parametrize("runner", STAND_INS, indirect=True)
def test_failed_self_test_fails_the_package_test(runner: tuple[Path, str]) -> None:
    place, system = runner
    (place / "studio").write_text("#!/usr/bin/env bash\nexit 1\n", encoding="utf-8")
    assert tried(place, system).startswith("Self-test of the installed package")


@pytest.mark.parametrize(
    ("runner", "name"), [("windows", "remove"), ("linux", "bin/apt-get")], indirect=["runner"]
)
def test_files_left_by_the_uninstaller_fail_the_package_test(runner: tuple[Path, str], name: str) -> None:
    place, system = runner
    script = (place / name).read_text(encoding="utf-8")
    (place / name).write_text(re.sub(r"rm (-R )?", "true ", script), encoding="utf-8")
    assert tried(place, system).startswith("Uninstall")
