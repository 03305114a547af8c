"""Speech and sounds of virtual robots on the computer's loudspeaker. One robot speaks at a time."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, TypeAlias

from app.core.storage.settings import Settings
from app.core.world.part import SessionPart
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.network.watches import Watch
    from app.core.robots.fleet import Fleet
    from app.core.robots.robot_link import RobotLink

FINISHED_RATIO = 0.9
"""Progress (0 to 1) of a text above which a robot's speech counts as finished.

Less than 1, because the voice may be slower than the speech bubble.
"""
MAX_QUEUED = 4
SPEECH_TIMEOUT_S, SPEECH_TIMEOUT_PER_LETTER_S = 10.0, 0.2
"""Time limit of a voice (base, and for each letter), after which the speech engine counts as hung."""
MAX_NOTES, MAX_NOTES_S = 32, 10.0
LOWEST_HZ, HIGHEST_HZ = 20.0, 20_000.0

Notes: TypeAlias = Sequence[tuple[float, float]]
"""Sequence of tones, each with a frequency in hertz (0 for a pause) and a duration in seconds."""


class Speaker(Protocol):
    """Sound output for robots.

    No method blocks or raises an exception; a computer without sound stays silent.
    """

    @property
    def is_busy(self) -> bool:
        """True if a voice is speaking."""

    @property
    def problem(self) -> str:
        """Reason why robots are not audible on this computer, or "".

        The reason is known only after the first attempt to play a sound.
        """

    def speak(self, text: str, language: str, volume: float) -> None:
        """Speak a text.

        Args:
            text: Text.
            language: Language code such as ``en``.
            volume: Volume, 0 to 1.
        """

    def play(self, notes: Notes, volume: float) -> None:
        """Play tones, even while a voice is speaking.

        Args:
            notes: Frequency in Hz and duration in seconds of each tone; an empty sequence stops the
                tones.
            volume: Volume, 0 to 1.
        """

    def stop_voice(self) -> None:
        """Stop the voice immediately."""

    def stop(self) -> None:
        """Stop the voice and all tones immediately."""


@dataclass(frozen=True, slots=True)
class Utterance:
    """Text that a robot is speaking or will speak."""

    robot: str
    text: str
    language: str
    volume: float


@dataclass(frozen=True, slots=True)
class RobotSound:
    """Audible part of a robot's drawing.

    Attributes:
        speech: Text that the robot is speaking, or "".
        spoken_fraction: Progress of the speech, 0 to 1.
        sound_number: Serial number of the sound.
        played_fraction: Progress of the sound, 0 to 1.
        notes: Tones of the sound.
    """

    speech: str = ""
    spoken_fraction: float = 0.0
    language: str = "en"
    volume: float = 0.6
    sound_number: int = 0
    played_fraction: float = 0.0
    notes: Notes = ()

    @classmethod
    def parse(cls, drawing: Mapping[str, object]) -> RobotSound:
        """Parse the audible part of a drawing. Missing and malformed fields become silence."""
        speech, sound = drawing.get("speech"), drawing.get("sound")
        sound_fields = sound if isinstance(sound, Mapping) else {}
        number = sound_fields.get("number")
        return cls(
            speech=speech.strip() if isinstance(speech, str) else "",
            spoken_fraction=_fraction(drawing.get("spoken")),
            language=str(drawing.get("language") or "en"),
            volume=_fraction(drawing.get("volume"), 60.0, 100.0),
            sound_number=number if isinstance(number, int) else 0,
            played_fraction=_fraction(sound_fields.get("played")),
            notes=_notes(sound_fields.get("notes")),
        )


class RobotVoices(SessionPart):
    """Playback of the speech and the sounds of virtual robots on `speaker`, which may be None.

    Robots speak one after the other; interrupted speech stops immediately. Not thread-safe; use it from
    the main thread.
    """

    task = lazy("play the robots' voices")

    def __init__(
        self,
        settings: Settings,
        fleet: Fleet,
        watch: Callable[[str], Watch],
        log: Callable[[str, str, str], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        # `log` writes to the Console: level, origin, sentence.
        self._settings, self._fleet, self._watch, self._log = settings, fleet, watch, log
        self._clock = clock
        self.speaker: Speaker | None = None
        self._watches: dict[str, Watch] = {}
        self._last_drawings: dict[str, tuple[object, RobotSound]] = {}
        self._queue: deque[Utterance] = deque()
        self._current: Utterance | None = None
        self._voice_deadline_s = 0.0
        self._playing_robot = ""
        self._known_stop_count = fleet.stop_count
        settings.on_change(Settings.is_robot_sound_on, self._on_sound_changed)

    @property
    def is_on(self) -> bool:
        """True if robots are audible."""
        return self._settings.is_robot_sound_on

    def _on_sound_changed(self, is_on: bool) -> None:
        if not is_on:
            self.silence()

    @property
    def problem(self) -> str:
        """Reason why robots are not audible, or "".

        "" also before the first attempt to play a sound, and without a speaker.
        """
        return self.speaker.problem if self.speaker is not None else ""

    @property
    def current(self) -> Utterance | None:
        """Text that is currently spoken, or None."""
        return self._current

    def tick(self) -> None:
        """Play new speech and sounds of the connected robots. Called at each tick."""
        if self.speaker is None:
            return
        links_by_name = (
            {link.name: link for link in self._fleet.connected if _is_audible(link)} if self.is_on else {}
        )
        for name in self._watches.keys() - links_by_name.keys():
            self._watches.pop(name).close()
            self._stop_interrupted(name, self._last_drawings.pop(name, (None, RobotSound()))[1], RobotSound())
        was_stopped = self._fleet.stop_count != self._known_stop_count
        if was_stopped:
            self._known_stop_count = self._fleet.stop_count
            self.silence()
        for name, link in links_by_name.items():
            if name not in self._watches and link.robot.topics.state is not None:
                self._watches[name] = self._watch(link.robot.topics.state)
            self._process(name, link.drawing, is_audible=not was_stopped)
        self._speak_next(self.speaker)

    def _process(self, name: str, drawing: Mapping[str, object] | None, *, is_audible: bool) -> None:
        last_drawing, previous = self._last_drawings.get(name, (None, RobotSound()))
        if drawing is None or drawing is last_drawing:
            return
        current = RobotSound.parse(drawing)
        is_first = name not in self._last_drawings
        self._last_drawings[name] = (drawing, current)
        self._stop_interrupted(name, previous, current)
        if (
            current.speech
            and is_audible
            and (current.speech != previous.speech or current.spoken_fraction < previous.spoken_fraction)
        ):
            self._enqueue(Utterance(name, current.speech, current.language, current.volume))
        if (
            current.notes
            and is_audible
            and not is_first
            and current.sound_number != previous.sound_number
            and self.speaker is not None
        ):
            self._playing_robot = name
            self.speaker.play(current.notes, current.volume)

    def _stop_interrupted(self, name: str, previous: RobotSound, current: RobotSound) -> None:
        if self.speaker is None:
            return
        if (
            previous.speech
            and previous.spoken_fraction < FINISHED_RATIO
            and current.speech != previous.speech
        ):
            self._queue = deque(each for each in self._queue if each.robot != name)
            if self._current is not None and self._current.robot == name:
                self._current = None
                self.speaker.stop_voice()
        if (
            previous.notes
            and previous.played_fraction < FINISHED_RATIO
            and not current.notes
            and self._playing_robot == name
        ):
            self._playing_robot = ""
            self.speaker.play((), 0.0)

    def _enqueue(self, utterance: Utterance) -> None:
        if len(self._queue) >= MAX_QUEUED:
            dropped = self._queue.popleft()
            message = _("“{words}” was shown but not spoken: too many texts were waiting").format(
                words=dropped.text
            )
            self._log("info", dropped.robot, message)
        self._queue.append(utterance)

    def _speak_next(self, speaker: Speaker) -> None:
        if self._current is not None and speaker.is_busy:
            if self._clock() < self._voice_deadline_s:
                return
            speaker.stop_voice()
        self._current = None
        if self._queue:
            utterance = self._current = self._queue.popleft()
            self._voice_deadline_s = (
                self._clock() + SPEECH_TIMEOUT_S + SPEECH_TIMEOUT_PER_LETTER_S * len(utterance.text)
            )
            speaker.speak(utterance.text, utterance.language, utterance.volume)

    def silence(self) -> None:
        """Stop and discard all speech and sounds."""
        self._queue.clear()
        self._current, self._playing_robot = None, ""
        if self.speaker is not None:
            self.speaker.stop()

    def close(self) -> None:
        """Stop all sound and close the watches."""
        self.silence()
        for watch in self._watches.values():
            watch.close()
        self._watches.clear()


def _is_audible(link: RobotLink) -> bool:
    return link.is_virtual and not link.is_unresponsive


def _fraction(value: object, default: float = 0.0, maximum: float = 1.0) -> float:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        value = default
    # The bounds first: JSON has integers that don't fit a float.
    return float(min(maximum, max(0.0, value))) / maximum


def _notes(value: object) -> Notes:
    # Limited in number and duration.
    if not isinstance(value, list):
        return ()
    notes: list[tuple[float, float]] = []
    remaining_s = MAX_NOTES_S
    for note in value[:MAX_NOTES]:
        if not (isinstance(note, list) and len(note) == 2):
            return ()
        hz, seconds = note
        if not all(isinstance(item, (int, float)) and not isinstance(item, bool) for item in note):
            return ()
        if (hz != 0 and not LOWEST_HZ <= hz <= HIGHEST_HZ) or not 0 < seconds <= remaining_s:
            return tuple(notes)
        notes.append((float(hz), float(seconds)))
        remaining_s -= seconds
    return tuple(notes)
