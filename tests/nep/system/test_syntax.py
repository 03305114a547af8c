"""Test of parsing Python source in several threads at once."""

from __future__ import annotations

import gc
import sys
from concurrent.futures import ThreadPoolExecutor

from nep.system.syntax import parse_expression, parse_module

SOURCE = "\n".join(
    f"def f{number}(a):\n    return [x + {number} for x in (a, (a, (a,)))]" for number in range(60)
)


class Yielding:
    """Object in a reference cycle whose finalizer lets other threads run."""

    def __init__(self) -> None:
        self.itself = self

    def __del__(self) -> None:
        sum(range(1000))


def parse_often(_worker: int) -> None:
    for _ in range(40):
        for _garbage in range(5):
            Yielding()
        assert len(parse_module(SOURCE).body) == 60
        assert parse_expression("1 + 2").body.lineno == 1


def test_source_is_parsed_in_several_threads_concurrently() -> None:
    switch_s, threshold = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.set_threshold(10)
    try:
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(parse_often, range(4)))
    finally:
        sys.setswitchinterval(switch_s)
        gc.set_threshold(*threshold)
