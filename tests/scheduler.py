"""Distribution of tests to pytest-xdist's workers for ``--dist loadfile``: by file, long files first.

Why not a scheduler of pytest-xdist 3.8 (2026-11-29, pytest 9.2):

- ``loadfile`` never ends after a worker has crashed: it assigns finished files again, and a worker that gets
  one has nothing to report. The watchdog in tests/conftest.py ends workers whose test is stuck.
- ``loadgroup`` does not keep groups together: pytest 9.2 ignores the names that pytest-xdist adds to node
  IDs.
- ``worksteal`` survives crashes but has no groups, and tests that bind fixed ports must not run in parallel.
  It also opens windows in all workers.

Speed is no reason. Simulated for 4 workers, with all tests and without `tests.long_groups`: this scheduler
1186 s and 1015 s, ``loadfile`` 1186 s and 1040 s, ``worksteal`` 1199 s and 1068 s. Measured with 4 workers on
2 busy cores for tests/core and tests/ui/shell: this scheduler 302 s of CPU time, ``worksteal`` 282 s.
"""

from __future__ import annotations

import os

from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

_FIXED_PORTS = "fixed ports"
WITH_FIXED_PORTS = ("tests/interop/", "tests/e2e/test_rize.py")
_SHARED_STUDIO = "tests/e2e/ with a shared Studio"
WITH_SHARED_STUDIO = tuple(
    f"tests/e2e/test_{name}.py" for name in ("ask", "behaviour", "main_job", "run_habits", "stop")
)
"""Files whose tests take turns in one Studio (`tests.e2e.shared_studio`), which each worker would start."""
MOSTLY_WAITING = ("tests/nep/", "tests/clients/", "tests/core/", "tests/robots/", "tests/blocks/")
"""Directories whose tests open no windows and spend at least two thirds of their time waiting."""
USUAL_S, USUAL_OF_STUDIO_S = 0.2, 12.0
"""Duration of a test, and of one that starts Studio."""
LONG_S = {
    _FIXED_PORTS: 200.0,
    "tests/e2e/test_teacher_mouse.py": 130.0,
    "tests/e2e/test_teacher_keyboard.py": 120.0,
    "tests/nep/backends/test_ros2.py": 85.0,
    "tests/e2e/test_path_mouse.py": 70.0,
    "tests/e2e/test_soak.py": 65.0,
    "tests/core/robots/test_stop_model.py": 60.0,
}
"""Durations in seconds of long files. Files below 60 s change the simulated total by less than 1 %."""


def may_take(worker: str, workers: int, processors: int, scope: str) -> bool:
    """Return True if a worker may run the tests of a file or group.

    With two workers more than processors (`tools.check.parallel_options`), the last one only gets tests of
    `MOSTLY_WAITING`: it uses the time in which other workers wait, without more windows open at once.
    """
    is_last = workers > processors + 1 and worker == f"gw{workers - 1}"
    return not is_last or scope.startswith(MOSTLY_WAITING)


class FileScheduling(LoadScopeScheduling):
    """Scheduler that keeps files together that share ports or a Studio; long files first."""

    def _split_scope(self, nodeid: str) -> str:
        for scope, files in ((_FIXED_PORTS, WITH_FIXED_PORTS), (_SHARED_STUDIO, WITH_SHARED_STUDIO)):
            if nodeid.startswith(files):
                return scope
        return nodeid.partition("::")[0]

    def _may_take(self, node: WorkerController, scope: str) -> bool:
        return may_take(node.gateway.id, self.numnodes, os.cpu_count() or 1, scope)

    def _estimated_s(self, scope: str) -> float:
        each = USUAL_OF_STUDIO_S if scope.startswith("tests/e2e/") else USUAL_S
        return LONG_S.get(scope, each * len(self.workqueue[scope]))

    def _assign_work_unit(self, node: WorkerController) -> None:
        scopes = [scope for scope in self.workqueue if self._may_take(node, scope)] or list(self.workqueue)
        self.workqueue.move_to_end(max(scopes, key=self._estimated_s), last=False)
        super()._assign_work_unit(node)

    def _reschedule(self, node: WorkerController) -> None:
        # A worker starts a test only when it knows the next one: a file with one test isn't enough.
        while not node.shutting_down and self._pending_of(self.assigned_work[node]) <= 2:
            if self.workqueue and not any(self._may_take(node, scope) for scope in self.workqueue):
                node.shutdown()
            super()._reschedule(node)  # assigns a file, or shuts the worker down if none is left

    def remove_node(self, node: WorkerController) -> str | None:
        """Reassign the unfinished files of a crashed worker, except the test that crashed it."""
        files = self.assigned_work.pop(node)
        pending = [(scope, test) for scope, tests in files.items() for test in tests if not tests[test]]
        if not pending:
            return None
        scope, crashed = pending[0]
        files[scope][crashed] = True
        self.workqueue.update({name: tests for name, tests in files.items() if not all(tests.values())})
        for other in self.nodes:
            self._reschedule(other)
        return crashed
