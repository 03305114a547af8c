"""NEP: messages between robots, programs and people.

import nep

node = nep.node("python_sender")
pub = node.new_pub("example", "json")
pub.publish({"message": "hello"})

Its public names are in `nep.public`, which is imported when any of them is first asked for.
"""

import importlib

TYPE_CHECKING = False
"""As `typing` has it, whose import would take ten times as long as this module."""

if TYPE_CHECKING:
    from nep import geometry as geometry
    from nep import sensor as sensor
    from nep.public import *  # noqa: F403 - the names are told once, there
    from nep.version import __version__ as __version__


def _imported(name: str) -> object:
    """What the package has under this name; all of it is imported when anything of it is first asked for.

    So `import nep` takes a millisecond, and the command `nep`, which begins with it, can be told what Ctrl+C
    does before it imports the rest. All at once: a program that has opened all the files that it may, or has
    left its folder, must not find a part of nep missing an hour later. Raises `AttributeError`.
    """
    if name == "__version__":
        globals()[name] = importlib.import_module("nep.version").__version__
    elif name == "__all__" or not (name.startswith("_") or _is_submodule(name)):
        public = vars(importlib.import_module("nep.public"))
        names = {each: public[each] for each in public if not each.startswith("_")}
        globals().update(names, __all__=[*sorted(names), "__version__"])
    if name not in globals():
        original = None if name.startswith("_") else importlib.import_module("nep.nodes.original")
        if original is not None and (
            hint := original.original_hint(name)
        ):  # without an object, so that Python doesn't suggest a similar name
            raise AttributeError(hint, name=name, obj=None)
        raise AttributeError(f"module 'nep' has no attribute '{name}'")
    return globals()[name]


def _is_submodule(name: str) -> bool:
    """Whether it is `nep.errors` or the like, which `import nep` alone has always given; it is imported."""
    whole = f"nep.{name}"
    try:
        importlib.import_module(whole)
    except ModuleNotFoundError as error:
        if error.name != whole:
            raise
        return False
    return True


def __dir__() -> list[str]:
    _imported("__all__")
    return sorted(globals())


if not TYPE_CHECKING:  # which would take any name for one of ours
    __getattr__ = _imported
