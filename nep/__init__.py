"""NEP: publish/subscribe messaging, services and shared state for robots and programs.

    import nep

    node = nep.node("python_sender")
    pub = node.new_pub("example", "json")
    pub.publish({"message": "hello"})

The public names are listed in `nep.public`, which is imported at the first access to any of them.
"""

import importlib

TYPE_CHECKING = False
"""Replacement for `typing.TYPE_CHECKING`: importing `typing` takes ten times as long as this module."""

if TYPE_CHECKING:
    from nep import geometry as geometry
    from nep import sensor as sensor
    from nep.public import *  # noqa: F403 - the list of public names is kept in nep.public only
    from nep.version import __version__ as __version__


def _load_attribute(name: str) -> object:
    # Lazy import: `import nep` takes 1 ms, so that the `nep` command can install its Ctrl+C handler before
    # the slow imports. All public names are imported together: a later import would fail in a program that
    # has reached its open-file limit or changed its working directory.
    if name == "__version__":
        globals()[name] = importlib.import_module("nep.version").__version__
    elif name == "__all__" or not (name.startswith("_") or _import_submodule(name)):
        public = vars(importlib.import_module("nep.public"))
        names = {each: public[each] for each in public if not each.startswith("_")}
        globals().update(names, __all__=[*sorted(names), "__version__"])
    if name not in globals():
        original = None if name.startswith("_") else importlib.import_module("nep.nodes.original")
        if original is not None and (
            hint := original.original_hint(name)
        ):  # obj=None keeps Python from suggesting a similar name
            raise AttributeError(hint, name=name, obj=None)
        raise AttributeError(f"module 'nep' has no attribute '{name}'")
    return globals()[name]


def _import_submodule(name: str) -> bool:
    # `import nep` gives access to submodules such as `nep.errors`; importing them here keeps that.
    full_name = f"nep.{name}"
    try:
        importlib.import_module(full_name)
    except ModuleNotFoundError as error:
        if error.name != full_name:
            raise
        return False
    return True


def __dir__() -> list[str]:
    _load_attribute("__all__")
    return sorted(globals())


if not TYPE_CHECKING:  # type checkers would accept any name
    __getattr__ = _load_attribute
