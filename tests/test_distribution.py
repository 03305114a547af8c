"""Tests of `python -m build`: reproducibility, contents of the distributions, nep in a new environment."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import pytest
from packaging.metadata import Metadata
from packaging.requirements import Requirement
from trove_classifiers import classifiers

from nep.version import __version__
from tools.computer import venv_python
from tools.versions import SUPPORTED

# time for two builds and an installation on a busy computer
pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]
ROOT = Path(__file__).parents[1]
EDITOR = "app/blocks/editor/"
A_TIME = "1700000000"
"""Value of SOURCE_DATE_EPOCH during a build."""


class Built(NamedTuple):
    """Distributions of one run of `python -m build`, and the files they were built from."""

    sdist: Path
    wheel: Path
    sources: frozenset[str]

    def in_wheel(self) -> set[str]:
        """Return the names in the wheel, except its metadata."""
        with zipfile.ZipFile(self.wheel) as archive:
            return {name for name in archive.namelist() if ".dist-info/" not in name}

    def in_sdist(self) -> set[str]:
        """Return the names in the source distribution, without its top folder."""
        with tarfile.open(self.sdist) as archive:
            return {each.name.partition("/")[2] for each in archive.getmembers() if not each.isdir()}

    def metadata(self) -> Metadata:
        """Return the metadata that the package index reads."""
        with zipfile.ZipFile(self.wheel) as archive:
            text = archive.read(f"nep_studio-{__version__}.dist-info/METADATA")
        return Metadata.from_email(text, validate=True)


def sources() -> list[str]:
    """Return the files tracked by git that exist; skip the test without git or a checkout."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    names = [name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]
    if not names:
        pytest.skip("needs git and a checkout: what is built is what git knows")
    return names


def build(folder: Path, *arguments: str) -> Built:
    """Build from a copy of the sources, because a build compiles files that other tests use."""
    names = sources()
    tree, made = folder / "tree", folder / "dist"
    for name in names:
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, tree / name)
    done = subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", made, *arguments, tree],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "SOURCE_DATE_EPOCH": A_TIME},
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    (sdist,), (wheel,) = made.glob("*.tar.gz"), made.glob("*.whl")
    return Built(sdist, wheel, frozenset(names))


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """Source distribution, and the wheel that was built from it."""
    return build(tmp_path_factory.mktemp("built"))


@pytest.mark.long
def test_builds_are_reproducible(built: Built, tmp_path: Path) -> None:
    again = build(tmp_path / "another place", "--sdist", "--wheel")
    for one, other in ((built.sdist, again.sdist), (built.wheel, again.wheel)):
        assert one.name == other.name
        assert hashlib.sha256(one.read_bytes()).digest() == hashlib.sha256(other.read_bytes()).digest()


def test_wheel_contains_exactly_the_expected_files(built: Built) -> None:
    ours = {name for name in built.sources if name.startswith(("nep/", "app/"))}
    read_by_people = {name for name in ours if name.startswith(EDITOR) or name.endswith((".po", ".pot"))}
    expected = ours - read_by_people
    expected |= {f"app/_{name}" for name in built.sources if name.startswith("resources/")}
    words = [PurePosixPath(name).parent for name in read_by_people if name.endswith(".po")]
    assert PurePosixPath("nep/locale/es/LC_MESSAGES") in words
    for folder in words:  # excludes the pseudo-language, which is for developers only
        expected |= {f"{folder}/nep-studio.mo", f"{folder}/editor.json"}
    assert built.in_wheel() == {*expected, "nep/locale/languages.json"}


def test_source_distribution_contains_exactly_the_tracked_files(built: Built) -> None:
    assert built.in_sdist() == {*built.sources, "PKG-INFO"}


def test_distribution_metadata_matches_the_version_licence_and_supported_pythons(built: Built) -> None:
    told = built.metadata()
    assert (told.name, str(told.version), told.license_expression) == ("nep-studio", __version__, "MIT")
    assert f" {told.author}\n" in (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert told.classifiers is not None
    assert set(told.classifiers) <= classifiers
    assert told.requires_python is not None
    named = {found[1] for each in told.classifiers if (found := re.search(r":: (3\.\d+)$", each))}
    assert named == set(SUPPORTED)
    assert {minor for minor in range(30) if f"3.{minor}" in told.requires_python} == {
        int(version.partition(".")[2]) for version in SUPPORTED
    }
    with zipfile.ZipFile(built.wheel) as archive:
        about = f"nep_studio-{__version__}.dist-info"
        assert archive.read(f"{about}/licenses/LICENSE") == (ROOT / "LICENSE").read_bytes()
        assert "nep=nep.cli:main" in archive.read(f"{about}/entry_points.txt").decode().replace(" ", "")


def test_long_description_renders_without_links_to_local_files(built: Built) -> None:
    # The renderer of PyPI; without it, `twine check` accepts any Markdown.
    pytest.importorskip("comrak", reason="readme-renderer[md] has no wheels for this system")
    from readme_renderer.markdown import render

    told = built.metadata()
    assert told.description_content_type == "text/markdown"
    assert told.description is not None
    page = render(told.description)
    assert page is not None
    assert "<img" not in page
    assert [
        link for link in re.findall(r'(?:href|src)="([^"]*)"', page) if not re.match("https?:|#", link)
    ] == []
    headings = re.findall(r"^## (.+)$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert re.findall(r"<h2[^>]*>([^<]+)", page) == headings
    assert "pip install ." not in told.description
    for name in re.findall(r"`((?:docs/|[A-Z]+\.md|LICENSE)[^`]*)`", told.description):
        assert name in built.sources or any(each.startswith(f"{name}/") for each in built.sources), name


def needed(asked_for: Iterable[Requirement]) -> Iterable[metadata.Distribution]:
    """Return the installed distributions of these requirements and, recursively, of theirs; no extras."""
    found: dict[str, metadata.Distribution] = {}
    left = list(asked_for)
    while left:
        wanted = left.pop()
        if wanted.name not in found and (wanted.marker is None or wanted.marker.evaluate({"extra": ""})):
            found[wanted.name] = metadata.distribution(wanted.name)
            left += [Requirement(line) for line in found[wanted.name].requires or ()]
    return found.values()


def fresh_environment(folder: Path, asked_for: Iterable[Requirement]) -> Path:
    """Return the interpreter of a new environment with only these requirements, copied from this one."""
    venv.create(folder, symlinks=os.name != "nt")
    scheme = {"base": str(folder), "platbase": str(folder)}
    layout = "venv" if "venv" in sysconfig.get_scheme_names() else sysconfig.get_default_scheme()
    packages = Path(sysconfig.get_path("purelib", layout, scheme))
    for distribution in needed(asked_for):
        for file in distribution.files or ():
            if ".." not in file.parts and Path(str(file.locate())).is_file():
                (packages / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(Path(str(file.locate())), packages / file)
    return venv_python(folder, sys.platform)


def test_installed_wheel_runs_messages_services_and_commands_in_a_fresh_environment(
    built: Built, tmp_path: Path
) -> None:
    python = fresh_environment(tmp_path / "fresh", built.metadata().requires_dist or ())
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index"]
    for step in (
        [*pip, "--no-compile", built.wheel],
        [python, "-I", ROOT / "tools" / "library_alone.py"],
    ):
        done = subprocess.run(step, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "messages, services and commands work" in done.stdout
