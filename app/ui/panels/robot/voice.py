"""What virtual robots say, heard through Qt's text to speech where this computer has a voice for it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Protocol

from app.ui.robot_drawing.state import RobotState

if TYPE_CHECKING:
    from PySide6.QtTextToSpeech import QTextToSpeech

ENDED = 0.9
"""Who has said so much has not been interrupted: a voice may take a little longer than the bubble."""
_log = logging.getLogger(__name__)


class Speaker(Protocol):
    """Somebody who can say something aloud; never waits, never raises."""

    def say(self, words: str, language: str, volume: float) -> bool:
        """Say this now, in place of what was being said; False when there is no voice for the language.

        ``language`` is a code such as ``en``, ``volume`` from 0 to 1.
        """

    def stop(self) -> None:
        """Be silent at once."""


class QtSpeaker:
    """Qt's text to speech, imported at the first word; silent on a computer that has none."""

    def __init__(self) -> None:
        self._engine: QTextToSpeech | None = None
        self._tried = False

    def _found(self) -> QTextToSpeech | None:
        if not self._tried:
            self._tried = True
            try:
                from PySide6.QtTextToSpeech import QTextToSpeech  # noqa: PLC0415 (heavy, and needs a sound system)

                if set(QTextToSpeech.availableEngines()) - {"mock"}:
                    self._engine = QTextToSpeech()
            except (ImportError, RuntimeError) as error:
                _log.info("robots have no voice here: %s", error)
        return self._engine

    def say(self, words: str, language: str, volume: float) -> bool:
        """Say it, if there is a voice."""
        engine = self._found()
        if engine is None:
            return False
        locale = next(
            (each for each in engine.availableLocales() if each.name().split("_")[0] == language), None
        )
        if locale is None:
            return False
        engine.stop()
        engine.setLocale(locale)
        engine.setVolume(volume)
        engine.say(words)
        return True

    def stop(self) -> None:
        """Be silent."""
        if self._engine is not None:
            self._engine.stop()


class RobotVoices:
    """Follows what robots say, and lets it be heard; who is broken off is silent at once."""

    def __init__(self, speaker: Speaker, is_on: Callable[[], bool]) -> None:
        """``is_on`` says whether a person wants to hear robots."""
        self._speaker, self._is_on = speaker, is_on
        self._said: dict[str, tuple[str, float]] = {}  # the words, and how much of them was said
        self._speaks = ""

    def follow(self, robots: Mapping[str, RobotState]) -> None:
        """These virtual robots are there now; called with every refresh."""
        for name in self._said.keys() - robots.keys():
            self._end(name)
        for name, state in robots.items():
            before = self._said.get(name, ("", 0.0))[0]
            if state.speech is None:
                self._end(name)
                continue
            self._said[name] = (state.speech, state.spoken)
            is_new = state.speech != before and self._is_on()
            if is_new and self._speaker.say(state.speech, state.language, state.volume):
                self._speaks = name
        if self._speaks and not self._is_on():
            self.silence()

    def _end(self, name: str) -> None:
        _words, spoken = self._said.pop(name, ("", 1.0))
        if name == self._speaks and spoken < ENDED:
            self.silence()

    def silence(self) -> None:
        """Nobody is heard any more."""
        self._speaks = ""
        self._speaker.stop()
