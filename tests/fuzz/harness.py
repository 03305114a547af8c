"""Run fuzz targets with atheris. Started by tools/fuzz.py in a separate environment.

    python tests/fuzz/harness.py --list
    python tests/fuzz/harness.py FOLDER TARGET=SECONDS ...
    python tests/fuzz/harness.py --again FOLDER/findings/TARGET-...

Each target runs in its own process, forked from one that has imported everything. A finding does not
stop the target, because it can hide others. Each source location is reported once.
"""

from __future__ import annotations

import json
import os
import re
import sys
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.fuzz.target import Target

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
SLOW_S = 5.0
"""Limit of processor time in seconds for one input; coverage instrumentation slows all code down."""
MAX_LENGTH = 8192
HANG_S = 25
MEMORY_MB = 3000


class Findings:
    """Folder with the inputs that failed and their tracebacks."""

    def __init__(self, folder: Path, name: str) -> None:
        self._folder, self._name = folder, name
        self._known: set[object] = set()

    def add(self, where: object, data: bytes, told: str) -> None:
        if where in self._known:
            return
        self._known.add(where)
        path = self._folder / f"{self._name}-{len(self._known)}.bin"
        path.write_bytes(data)
        path.with_suffix(".txt").write_text(f"{told}\n{data[:300]!r}\n", encoding="utf-8", errors="replace")


def place_of(error: BaseException) -> tuple[object, ...]:
    """Return the key of an exception: its type and two innermost source lines. Equal keys are one finding."""
    frames = traceback.extract_tb(error.__traceback__)
    return (type(error), *((each.filename, each.lineno) for each in frames[-2:]))


def fuzz_all(folder: Path, plan: Mapping[str, int]) -> int:
    """Fuzz the targets one after the other. Return 1 if any process failed or ended early, otherwise 0."""
    import atheris

    with atheris.instrument_imports(include=["nep", "app", "json.decoder", "tomllib"]):
        from tests.fuzz.targets import TARGETS
    broken = 0
    for name, seconds in plan.items():
        sys.stdout.flush()
        log = folder / f"{name}.log"
        child = os.fork()
        if not child:
            with log.open("wb") as out:
                os.dup2(out.fileno(), 1)
                os.dup2(out.fileno(), 2)
                fuzz(TARGETS[name], seconds, folder)
        _pid, status = os.waitpid(child, 0)
        done = re.findall(
            r"^Done (\d+) runs in (\d+) second", log.read_text("utf-8", "replace"), re.MULTILINE
        )
        if status or not done:
            broken = 1
            sys.stdout.write(f"  {name} ended early; see {log}\n")
        else:
            sys.stdout.write(f"  {name}: {int(done[-1][0]):,} runs in {done[-1][1]} s\n")
    return broken


def fuzz(target: Target, seconds: int, folder: Path) -> None:
    """Fuzz one target for some seconds. Does not return: libFuzzer ends the process."""
    import atheris

    from tests.fuzz.mutation import mutated

    name = target.name
    findings = Findings(folder / "findings", name)
    corpus, seeds = folder / "corpus" / name, folder / "seeds" / name
    for each in (corpus, seeds):
        each.mkdir(parents=True, exist_ok=True)
    for number, seed in enumerate(target.seeds()):
        (seeds / str(number)).write_bytes(seed)
    words = folder / "seeds" / f"{name}.dict"
    words.write_text(
        "".join(f'"{_escaped(word)}"\n' for word in (*target.words, b"\xff\xff\xff\xff")), encoding="ascii"
    )

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        """Apply a structural mutation (`tests.fuzz.mutation`) to half of the inputs, else libFuzzer's."""
        chance = Random(seed)
        other = mutated(data, chance) if chance.random() < 0.5 else None
        made: bytes = atheris.Mutate(data, most) if other is None else other
        return made[:most]

    def one(data: bytes) -> None:
        began = time.thread_time()
        try:
            target.try_bytes(data)
        except Exception as error:  # noqa: BLE001 - that is what is looked for
            findings.add(place_of(error), data, traceback.format_exc(limit=-8))
        if time.thread_time() - began > SLOW_S * target.slower**0.5:
            findings.add("slow", data, f"it took {time.thread_time() - began:.1f} s")

    options = {
        "max_total_time": seconds,
        "max_len": MAX_LENGTH,
        "timeout": HANG_S,
        "rss_limit_mb": MEMORY_MB,
        "artifact_prefix": f"{folder / 'findings'}/{name}-",
        "dict": words,
        "verbosity": 1,
        "print_final_stats": 1,
    }
    atheris.Setup(
        [name, *(f"-{key}={value}" for key, value in options.items()), str(corpus), str(seeds)],
        one,
        custom_mutator=mutate,
    )
    atheris.Fuzz()


def _escaped(word: bytes) -> str:
    return "".join(f"\\x{each:02X}" for each in word)


def main() -> None:
    if sys.argv[1:] == ["--list"]:
        from tests.fuzz.targets import TARGETS

        sys.stdout.write(json.dumps({name: each.slower for name, each in TARGETS.items()}))
    elif sys.argv[1] == "--again":
        from tests.fuzz.targets import TARGETS

        path = Path(sys.argv[2])
        TARGETS[path.name.partition("-")[0]].try_bytes(path.read_bytes())
    else:
        plan = {name: int(seconds) for name, _is, seconds in (each.partition("=") for each in sys.argv[2:])}
        sys.exit(fuzz_all(Path(sys.argv[1]), plan))


if __name__ == "__main__":
    main()
