"""Time from Run to the first event of the program, with and without a spare process, in turns.

python bench/run_start.py [ROUNDS]
"""

from __future__ import annotations

import statistics
import sys
import threading
import time

from app.blocks.compiler.compiler import compile_behaviour
from app.blocks.runtime.events import ProgramReady, RunnerEvent
from app.core.run.child_process import ChildProcess, child_command, source_root
from app.core.run.runner import Runner
from app.core.run.spare_child import SpareChild
from nep.masters.master import Master
from tests.blocks.samples import block, number, started, workspace

IMPORT_S = 3.0
"""Time in seconds that the spare gets for its imports."""
WORKSPACE = workspace(started(block("control_wait", SECONDS=number(60))))


def start_ms(address: str, spare: SpareChild | None) -> float:
    """Start a program, wait for its first event after "ready", and return the time in milliseconds."""
    is_running = threading.Event()

    def on_event(event: RunnerEvent) -> None:
        if not isinstance(event, ProgramReady):
            is_running.set()

    runner = Runner(on_event, spare=spare)
    started_s = time.perf_counter()
    runner.start(compile_behaviour(WORKSPACE, []), [], address)
    is_running.wait(60)
    elapsed_ms = (time.perf_counter() - started_s) * 1e3
    runner.close()
    return elapsed_ms


def main() -> None:
    """Print the medians and their ratio."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    cold_ms, warm_ms = [], []
    source = source_root()
    with Master("127.0.0.1:0", learn_s=0.0) as master:
        for _ in range(rounds):
            cold_ms.append(start_ms(master.address, None))
            spare = SpareChild(lambda: ChildProcess(child_command(), source), source)
            spare.prepare()
            threading.Event().wait(IMPORT_S)
            warm_ms.append(start_ms(master.address, spare))
            spare.close()
    cold, warm = statistics.median(cold_ms), statistics.median(warm_ms)
    print(f"Run to first event: {cold:.0f} ms without, {warm:.0f} ms with a spare; ratio {cold / warm:.1f}")


if __name__ == "__main__":
    main()
