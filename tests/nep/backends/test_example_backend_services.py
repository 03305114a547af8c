"""Contract tests of the services of the back end in examples/backend."""

from __future__ import annotations

from tests.nep.backends.example_backend import installed, make, registered  # noqa: F401 - fixtures
from tests.nep.services import test_calls as calls

globals().update({name: test for name, test in vars(calls).items() if name.startswith("test_")})
spin = calls.spin
