"""Tests that the committed bundle of the block editor is reproducible from its sources and complete."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from app import resources

ROOT = Path(__file__).resolve().parents[3]
EDITOR = ROOT / "app" / "blocks" / "editor"

node, npm = shutil.which("node"), shutil.which("npm")
built = pytest.mark.skipif(
    node is None or npm is None, reason="needs node and npm, which this computer does not have"
)


@pytest.fixture(scope="module")
def tools() -> None:
    """Install the build tools of the editor, once per checkout; skip the tests if npm fails."""
    if (EDITOR / "node_modules" / "esbuild").is_dir():
        return
    command = [npm, "ci", "--no-audit", "--no-fund", "--silent"]
    done = subprocess.run(command, cwd=EDITOR, capture_output=True, text=True, timeout=240, check=False)
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines() or ["no reason given"]
        pytest.skip(f"npm could not bring what the editor is built with: {lines[-1]}")


def files(folder: Path) -> dict[str, bytes]:
    return {
        file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()
    }


@built
@pytest.mark.timeout(300)
def test_rebuild_reproduces_the_committed_bundle(tools, tmp_path):
    subprocess.run([node, "build.mjs", str(tmp_path / "out")], cwd=EDITOR, check=True, timeout=280)
    assert files(tmp_path / "out") == files(resources.path("blockly"))


@built
@pytest.mark.timeout(300)
def test_failed_build_keeps_the_existing_bundle(tools, tmp_path):
    here, out = tmp_path / "editor", tmp_path / "out"
    shutil.copytree(EDITOR / "src", here / "src")
    shutil.copy(EDITOR / "build.mjs", here)
    (here / "node_modules").symlink_to(EDITOR / "node_modules", target_is_directory=True)
    (here / "src" / "index.html").unlink()  # needed last, after the script is built
    out.mkdir()
    (out / "editor.js").write_text("the one before")
    done = subprocess.run(
        [node, "build.mjs", str(out)], cwd=here, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode != 0
    assert "index.html" in done.stderr
    assert files(out) == {"editor.js": b"the one before"}
    assert sorted(each.name for each in tmp_path.iterdir()) == ["editor", "out"]


@built
@pytest.mark.timeout(300)
def test_editor_sources_pass_strict_type_checking(tools):
    tsc = EDITOR / "node_modules" / "typescript" / "bin" / "tsc"
    done = subprocess.run(
        [node, str(tsc), "--noEmit"], cwd=EDITOR, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.stdout == ""
    assert done.returncode == 0


def cycle(imports: dict[str, set[str]]) -> list[str]:
    """Return the modules that are left when those without imports are removed, again and again."""
    left = dict(imports)
    while free := [name for name, others in left.items() if not others & left.keys()]:
        for name in free:
            del left[name]
    return sorted(left)


def test_editor_sources_have_no_import_cycles():
    pattern = re.compile(r"""(?:from|import) '\./(\w+)'""")
    imports = {file.stem: set(pattern.findall(file.read_text())) for file in (EDITOR / "src").glob("*.ts")}
    assert imports["drag"] & imports.keys()
    assert cycle(imports) == []


def test_import_cycle_is_detected():
    assert cycle({"a": {"b"}, "b": {"c", "d"}, "c": {"a"}, "d": set()}) == ["a", "b", "c"]


def test_lock_file_contains_no_registry_urls():
    lock = json.loads((EDITOR / "package-lock.json").read_text())
    assert lock["packages"]
    assert all("resolved" not in package for package in lock["packages"].values())


def test_bundle_loads_no_external_resources():
    bundle = resources.path("blockly", "editor.js").read_text()
    addresses = set(re.findall(r"https?://[a-z0-9.-]+", bundle))
    # Names of XML formats, a comment, help texts, and Blockly's default media folder, which the page
    # replaces; none is ever fetched (the page's security policy and the request filter block it, too).
    assert addresses <= {
        "http://www.w3.org",
        "https://bugzilla.mozilla.org",
        "https://developers.google.com",
        "https://static.blockly.com",
    }
    assert "url(http" not in resources.path("blockly", "style.css").read_text()


def test_bundle_contains_every_category_icon_and_the_apache_and_isc_licences():
    bundle = resources.path("blockly", "editor.js").read_text()
    tokens = json.loads(resources.path("theme", "tokens.json").read_text())
    for category in tokens["block"].values():
        assert re.search(rf"""['"]?\b{category["icon"]}['"]?:['"`]<""", bundle)
    legal = resources.path("blockly", "LEGAL.txt").read_text()
    assert "Apache License" in legal
    assert "ISC License" in legal
