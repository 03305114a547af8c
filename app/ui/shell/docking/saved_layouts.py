"""Layouts that are kept: Behaviour and Developer as a person left them, and layouts with names of their own.

A layout of one's own is an arrangement of the panels of Behaviour or Developer (its base). It is kept as it
was left, as the two built-in ones are. What is kept and does not fit is left out, with a line in the Console.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from app.ui.shell.docking.layouts import LAYOUTS, layout_named
from app.ui.shell.docking.workbench import Workbench
from app.ui.shell.window_state import WindowState
from nep.i18n import _

OWN = "own:"
LONGEST = 40


@dataclass(frozen=True, slots=True)
class OwnLayout:
    """A layout with a name of its own, and the built-in one whose panels it arranges."""

    name: str
    base: str


class SavedLayouts:
    """Which arrangement each workbench shows, and the states of all others."""

    def __init__(self, state: WindowState, complain: Callable[[str], object]) -> None:
        """``complain`` is told, in a sentence, what is damaged."""
        self._state, self._complain = state, complain
        self._current: dict[str, str] = {}

    # -- asking -----------------------------------------------------------------------------------

    def all(self) -> tuple[OwnLayout, ...]:
        """The layouts with names of their own, by name."""
        bases = {layout.name for layout in LAYOUTS}
        found = []
        for key, kept in self._state.layouts().items():
            if key.startswith(OWN) and isinstance(kept, Mapping) and kept.get("base") in bases:
                found.append(OwnLayout(key.removeprefix(OWN), str(kept["base"])))
        return tuple(sorted(found, key=lambda own: own.name.lower()))

    def named(self, name: str) -> OwnLayout | None:
        """The own layout of that name."""
        return next((own for own in self.all() if own.name == name), None)

    def own(self, base: str) -> str:
        """The name of the own layout that a workbench shows; "" while it shows the built-in one."""
        chosen = self._current.get(base)
        if chosen is None:
            chosen = self._current[base] = self._state.chosen(base)
        found = self.named(chosen) if chosen else None
        return chosen if found is not None and found.base == base else ""

    def refusal(self, name: str, but: str = "") -> str:
        """Why a layout can't have that name, in a sentence; "" when it can."""
        name = name.strip()
        if not name:
            return _("A layout needs a name.")
        if len(name) > LONGEST:
            return _("The name is too long. Use at most {count} characters.").format(count=LONGEST)
        taken = {_(layout.title).lower() for layout in LAYOUTS} | {own.name.lower() for own in self.all()}
        is_taken = name.lower() in taken - {but.lower()}
        return _("“{name}” already exists.").format(name=name) if is_taken else ""

    # -- a workbench ------------------------------------------------------------------------------

    def bring_back(self, bench: Workbench, base: str) -> None:
        """Arrange a workbench as it was left; at first, or when that is damaged, as it is built in."""
        own = self.own(base)
        saved = self._state.of_layout(OWN + own if own else base)
        if not saved:
            bench.arrange()
            return
        try:
            well = bench.restore(saved)
        except Exception as error:  # noqa: BLE001  whatever was in the file, the window opens
            well = False
            self._complain(f"{type(error).__name__}: {error}")
        if not well:
            bench.arrange()
            words = _("Can't restore the layout “{name}”; using its default.")
            self._complain(words.format(name=own or _(layout_named(base).title)))

    def keep(self, bench: Workbench, base: str) -> None:
        """Keep how a workbench looks now, under the name of what it shows."""
        own = self.own(base)
        self._state.keep_layouts({OWN + own if own else base: {**bench.save(), "base": base}})

    def use(self, bench: Workbench, base: str, own: str) -> None:
        """Show another arrangement ("" is the built-in one); the one that showed is kept."""
        if own == self.own(base):
            return
        self.keep(bench, base)
        self._choose(base, own)
        self.bring_back(bench, base)

    # -- names ------------------------------------------------------------------------------------

    def keep_as(self, bench: Workbench, base: str, name: str) -> bool:
        """Keep what shows under a new name, and show that from now on; the old one stays as it was.

        False when it could not be written: it is there until Studio ends.
        """
        kept = self._state.keep_layouts({OWN + name.strip(): {**bench.save(), "base": base}})
        self._choose(base, name.strip())
        return kept

    def fits(self, bench: Workbench, base: str, saved: Mapping[str, object]) -> bool:
        """Whether an arrangement of others can be shown: tried before anything of it is kept."""
        self.keep(bench, base)
        try:
            return bench.restore(saved)
        except Exception as error:  # noqa: BLE001  whatever was in the file, the window stays
            self._complain(f"{type(error).__name__}: {error}")
            return False
        finally:
            self.bring_back(bench, base)

    def take_in(self, name: str, base: str, saved: Mapping[str, object]) -> tuple[str, bool]:
        """Keep an arrangement that came from a file: its name here, and whether it could be written.

        A name that is taken, or can't be, gets a number.
        """
        name = name.strip()[:LONGEST].strip()
        free, number = name, 2
        while self.refusal(free):
            ending = f" {number}"
            free, number = f"{name[: LONGEST - len(ending)]}{ending}", number + 1
        return free, self._state.keep_layouts({OWN + free: {**saved, "base": base}})

    def rename(self, old: str, new: str) -> None:
        """Give an own layout another name."""
        found = self.named(old)
        if found is None or new.strip() == old:
            return
        shown = self.own(found.base) == old
        self._state.keep_layouts({OWN + new.strip(): self._state.of_layout(OWN + old)})
        self._state.forget_layout(OWN + old)
        if shown:
            self._choose(found.base, new.strip())

    def delete(self, bench: Workbench | None, name: str) -> tuple[bool, Callable[[], None]]:
        """Forget an own layout: whether that is kept, and what brings it back.

        Its workbench shows the built-in one.
        """
        found = self.named(name)
        if found is None:
            return True, lambda: None
        base, shown = found.base, self.own(found.base) == name
        if shown and bench is not None:
            self.use(bench, base, "")
        saved = dict(self._state.of_layout(OWN + name))
        kept = self._state.forget_layout(OWN + name)

        def undo() -> None:
            self._state.keep_layouts({OWN + name: saved})
            if shown and bench is not None:
                self.use(bench, base, name)

        return kept, undo

    def _choose(self, base: str, own: str) -> None:
        self._current[base] = own
        self._state.keep_chosen(base, own)
