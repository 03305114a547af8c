"""Tests of the Unity package: its contents, compilation against stubs of Unity's API, and conversions."""

from __future__ import annotations

import json
import math
import random
import re
import tarfile
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree as ET

import pytest

from tests.clients.mono_programs import (
    CSHARP,
    HAS_MONO,
    WITHOUT,
    MonoProgram,
    program,
    running,
    sources,
)
from tools import unity_package

needs_mono = pytest.mark.skipif(not HAS_MONO, reason=WITHOUT)
Numbers = Sequence[float]


def test_package_has_every_source_once_and_meta_files_with_unique_ids(tmp_path: Path) -> None:
    tarball = unity_package.build(tmp_path)
    assert tarball.read_bytes() == unity_package.build(tmp_path / "again").read_bytes()
    with tarfile.open(tarball) as archive:
        names = archive.getnames()
    files = unity_package.package_files()
    assert names == [f"package/{path}" for path in files]
    runtime = [path for path in files if path.endswith(".cs") and path.startswith("Runtime/Nep/")]
    assert len(runtime) == len(sources("src"))
    shown = [PurePosixPath(path) for path in files if not path.startswith("Documentation~/")]
    folders = {str(folder) for path in shown for folder in path.parents} - {".", "Samples~"}
    metas = [path for path in files if path.endswith(".meta")]
    assert sorted(metas) == sorted(
        f"{path}.meta" for path in {*map(str, shown), *folders} if not path.endswith(".meta")
    )
    ids = re.findall(r"guid: (\w{32})\n", "".join(files[path].decode() for path in metas))
    assert len(set(ids)) == len(metas)


def test_manifest_matches_package_contents() -> None:
    files = unity_package.package_files()
    manifest = json.loads(files["package.json"])
    project = ET.parse(CSHARP / "Nep.csproj")
    assert manifest["version"] == project.findtext("PropertyGroup/Version")
    assert "com.unity.nuget.newtonsoft-json" in manifest["dependencies"]
    for sample in manifest["samples"]:
        assert any(path.startswith(f"{sample['path']}/") for path in files), sample
    definitions = [json.loads(files[path]) for path in files if path.endswith(".asmdef")]
    assert {each["name"]: each["references"] for each in definitions} == {"Nep": [], "Nep.Unity": ["Nep"]}
    assert definitions[0]["precompiledReferences"] == ["Newtonsoft.Json.dll"]


def rotated(quaternion: Numbers, vector: Numbers) -> list[float]:
    """Rotate a vector by a unit quaternion (x, y, z, w)."""
    (x, y, z, w), (a, b, c) = quaternion, vector
    u, v, t = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return [a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u]


def converted(program: MonoProgram, kind: str, numbers: Numbers) -> tuple[list[float], list[float]]:
    """Return the numbers converted to Unity's coordinates, and the result converted back."""
    answer = [float(word) for word in program.ask(f"{kind} {' '.join(map(str, numbers))}").split()]
    half = len(answer) // 2
    return answer[:half], answer[half:]


@needs_mono
def test_package_compiles_and_converts_between_ros_and_unity() -> None:
    files = (*sources("unity"), *sources("tests/unity"), CSHARP / "tests" / "peer" / "Conversions.cs")
    with running(program("Nep.Unity.exe", *files)) as conversions:
        for ros, unity in (((1, 0, 0), [0, 0, 1]), ((0, 1, 0), [-1, 0, 0]), ((0, 0, 1), [0, 1, 0])):
            assert converted(conversions, "vector", ros)[0] == unity
        chance = random.Random(27)
        for _ in range(20):
            vector = [chance.uniform(-9, 9) for _ in range(3)]
            turn = [chance.gauss(0, 1) for _ in range(4)]
            turn = [each / math.hypot(*turn) for each in turn]
            unity_vector, back = converted(conversions, "vector", vector)
            unity_turn, turn_back = converted(conversions, "rotation", turn)
            assert back == pytest.approx(vector, abs=1e-5)
            assert turn_back == pytest.approx(turn, abs=1e-5)
            wanted = converted(conversions, "vector", rotated(turn, vector))[0]
            assert rotated(unity_turn, unity_vector) == pytest.approx(wanted, abs=1e-4)
