"""Models of virtual robots, found without the slow import of their modules.

A module of `app.robots` that assigns the model and the default name of a virtual robot to the constant
``VIRTUAL_ROBOT`` is a plug-in: Studio starts it with ``python -m``, and it binds ``ROBOT`` for its driver.
"""

from __future__ import annotations

import dis
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from itertools import pairwise

import app.robots

CONSTANT = "VIRTUAL_ROBOT"


@dataclass(frozen=True, slots=True)
class VirtualModel:
    """Model of a virtual robot.

    Attributes:
        model: Id of the model, as in its description.
        name: Default name of a robot.
        module: Name of the module, which runs in a separate process.
    """

    model: str
    name: str
    module: str


@lru_cache(maxsize=1)
def virtual_models() -> Mapping[str, VirtualModel]:
    """Return the virtual robots by the ids of their models."""
    models = {}
    for info in pkgutil.iter_modules(app.robots.__path__, f"{app.robots.__name__}."):
        if not info.ispkg and (constant := _read_constant(info.name)) is not None:
            model, name = constant
            models[model] = VirtualModel(model, name, info.name)
    return models


def _read_constant(module: str) -> tuple[str, str] | None:
    # From the compiled code, because frozen builds contain no source.
    spec = find_spec(module)
    get_code = getattr(spec.loader, "get_code", None) if spec is not None else None
    if get_code is None:
        return None
    for value, store in pairwise(dis.get_instructions(get_code(module))):
        if (value.opname, store.opname, store.argval) == ("LOAD_CONST", "STORE_NAME", CONSTANT):
            model, name = value.argval
            return str(model), str(name)
    return None
