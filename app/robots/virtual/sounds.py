"""Sounds and tones of the virtual Pepper, advanced in time steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

Notes: TypeAlias = Sequence[tuple[float, float]]
"""Sequence of notes, each a pair of frequency in Hz (0 for a pause) and duration in seconds."""
SoundName: TypeAlias = Literal["beep", "bell", "cheer", "buzzer", "whistle"]

SOUNDS: Mapping[SoundName, Notes] = {
    "beep": ((880, 0.25),),
    "bell": ((1319, 0.3), (1047, 0.6)),
    "cheer": ((523, 0.12), (659, 0.12), (784, 0.12), (0, 0.05), (784, 0.12), (1047, 0.45)),
    "buzzer": ((146, 0.35), (0, 0.08), (146, 0.5)),
    "whistle": tuple((900 + 75 * step, 0.05) for step in range(9)),
}


@dataclass
class Sound:
    """Sound being played.

    Attributes:
        number: Number by which Studio distinguishes sounds.
        title: Display name.
        notes: Notes of the sound.
        played_s: Time in seconds since the start.
        done: True after the last note, or if the sound was stopped.
    """

    number: int
    title: str
    notes: Notes
    played_s: float = 0.0
    done: bool = False

    @property
    def duration_s(self) -> float:
        """Total duration in seconds."""
        return sum(seconds for _hz, seconds in self.notes)

    def step(self, seconds: float) -> None:
        """Advance by a number of seconds."""
        self.played_s += seconds
        self.done = self.done or self.played_s >= self.duration_s

    def drawing_state(self) -> dict[str, object]:
        """Return the sound for the state message. ``played`` is the progress from 0 to 1."""
        return {
            "number": self.number,
            "title": self.title,
            "played": round(min(1.0, self.played_s / self.duration_s), 2),
            "notes": [list(note) for note in self.notes],
        }
