"""Speech and tones of robots, produced by Qt in a separate thread.

Qt's modules for speech and audio are imported on first use, because they can take seconds to start.
Speech engines are third-party code that can crash, so creating one is first tested in another process,
which runs this module.
"""

from __future__ import annotations

import ctypes
import faulthandler
import logging
import math
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from PySide6.QtCore import QBuffer, QByteArray, QCoreApplication, QEventLoop, QLocale, QObject, Qt, Signal

from app.core.reports.own_process import module_command
from app.core.robots.voices import Notes
from nep.i18n import _, lazy
from nep.masters.process import NO_CONSOLE

if TYPE_CHECKING:
    from PySide6.QtMultimedia import QAudioSink
    from PySide6.QtTextToSpeech import QTextToSpeech

LANGUAGES = {"en": lazy("English"), "fr": lazy("French"), "ja": lazy("Japanese"), "es": lazy("Spanish")}
NO_SOUND_TEXT = lazy("This computer can't play sound.")
ADVICE = {
    "linux": lazy(
        "Install the packages “speech-dispatcher”, “espeak-ng” and “libpulse0”, then start Studio again."
    ),
    "win32": lazy(
        "Add a voice in Windows Settings, under “Time & language” and “Speech”, then start Studio again."
    ),
    "darwin": lazy(
        "Add a voice in System Settings, under “Accessibility” and “Spoken Content”, then start Studio again."
    ),
}
"""Instructions to install a voice, by `sys.platform`."""
MAX_TONES = 4
RATE_HZ, FADE_S, LOUDNESS = 44_100, 0.006, 0.5
JOIN_TIMEOUT_S = 0.5
TEST_TIMEOUT_S = 20.0
"""Timeout in s of the test process. An engine that takes longer would block this process too."""
Request: TypeAlias = tuple[str, tuple[Any, ...], int]
_log = logging.getLogger(__name__)


def no_voice_message(language: str) -> str:
    """Return the message shown when no voice for a language is installed."""
    name = _(LANGUAGES[language]) if language in LANGUAGES else QLocale(language).nativeLanguageName()
    return _("This computer has no voice for {language}.").format(language=name or language)


def has_voice_engine() -> bool:
    """Return True if Qt finds a speech engine, without starting it."""
    try:
        from PySide6.QtTextToSpeech import QTextToSpeech  # noqa: PLC0415 (heavy, and needs a sound system)
    except (ImportError, RuntimeError) as error:
        _log.info("no speech output: %s", error)
        return False
    return bool(set(QTextToSpeech.availableEngines()) - {"mock"})


def try_voice() -> int:
    """Create a speech engine and query its languages; the main function of the test process.

    Returns:
        Exit code 0. A faulty engine can end the process with any other code or a signal.
    """
    with Path(os.devnull).open("w", encoding="utf-8") as null_file:
        # ends the process even if its parent is gone
        faulthandler.dump_traceback_later(TEST_TIMEOUT_S, exit=True, file=null_file)
        return _run_voice_test()


def _run_voice_test() -> int:
    if sys.platform == "win32":
        # Ends the process on a crash without showing a dialog or debugger.
        kernel = ctypes.windll.kernel32
        kernel.SetUnhandledExceptionFilter.argtypes = [ctypes.c_void_p]
        kernel.SetUnhandledExceptionFilter(ctypes.cast(kernel.ExitProcess, ctypes.c_void_p))
    from PySide6.QtTextToSpeech import QTextToSpeech  # noqa: PLC0415 (heavy, and needs a sound system)

    application = QCoreApplication.instance() or QCoreApplication(sys.argv[:1])
    voice = QTextToSpeech()
    voice.availableLocales()
    application.processEvents()
    return 0


def passes_voice_test(command: Sequence[str] = ()) -> bool:
    """Return True if a test process could create a speech engine; blocks for up to `TEST_TIMEOUT_S`.

    A faulty engine then crashes the test process instead of Studio.

    Args:
        command: Command line of the test process, by default this module.
    """
    try:
        result = subprocess.run(
            command or module_command("app.ui.speaker"),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=TEST_TIMEOUT_S,
            creationflags=NO_CONSOLE,
            check=False,
        )
    except (OSError, subprocess.SubprocessError) as error:
        _log.warning("no speech output: the test process failed: %s", error)
        return False
    if result.returncode != 0:
        _log.warning("no speech output: the test process exited with %d", result.returncode)
    return result.returncode == 0


def voice_text(problem: str, *, has_engine: bool, platform: str = sys.platform) -> str:
    """Return a description of the speech output: that it works, or the error and how to fix it.

    Args:
        problem: Error of the last speech output, or "".
        has_engine: True if Qt finds a speech engine.
        platform: Value of `sys.platform`.
    """
    if has_engine and not problem:
        return _("Robots speak with the voice of this computer.")
    reason = problem or _("This computer has no voice, so what robots say is only shown as text.")
    return f"{reason} {_(ADVICE.get(platform, ADVICE['linux']))}"


def samples(notes: Notes, volume: float, rate_hz: int = RATE_HZ) -> bytes:
    """Synthesize tones as 16-bit little-endian mono samples, with fades to avoid clicks.

    Args:
        notes: Frequency in Hz (0 for a pause) and duration in s of each tone.
        volume: Volume from 0 to 1.
        rate_hz: Sampling rate.
    """
    import numpy as np  # noqa: PLC0415 (heavy; needed for tones only)

    waves = []
    for hz, seconds in notes:
        count = max(1, round(seconds * rate_hz))
        wave = np.sin(np.arange(count) * (2 * math.pi * hz / rate_hz)) if hz else np.zeros(count)
        fade_length = min(count // 2, round(FADE_S * rate_hz))
        if fade_length:
            fade_in = np.linspace(0.0, 1.0, fade_length)
            wave[:fade_length] *= fade_in
            wave[-fade_length:] *= fade_in[::-1]
        waves.append(wave)
    waveform = np.concatenate(waves) if waves else np.zeros(0)
    return (waveform * (LOUDNESS * min(1.0, max(0.0, volume)) * 32767)).astype("<i2").tobytes()


class Engine(Protocol):
    """Interface of a speech and audio engine, which is used in one thread with a Qt event loop."""

    def speak(self, text: str, language: str, volume: float, on_ended: Callable[[], None]) -> str:
        """Start speaking a text.

        Args:
            text: Text.
            language: Language code, such as "en".
            volume: Volume from 0 to 1.
            on_ended: Called once when the text has been spoken or speaking has failed; not called if this
                method returns an error, or after `stop_voice`.

        Returns:
            An error message, or "" if speaking has started.
        """

    def play(self, notes: Notes, volume: float) -> str:
        """Start playing tones; return an error message, or "" on success.

        Args:
            notes: Frequency in Hz (0 for a pause) and duration in s of each tone.
            volume: Volume from 0 to 1.
        """

    def stop_voice(self) -> None:
        """Stop speaking without calling `ended`."""

    def stop_tones(self) -> None:
        """Stop all tones."""


class QtEngine:
    """Engine that uses Qt's speech and audio modules, which are loaded on first use."""

    def __init__(self) -> None:
        self._voice: QTextToSpeech | None = None
        self._has_tried_voice = False
        self._ended_callback: Callable[[], None] | None = None
        self._sinks: list[tuple[QAudioSink, QBuffer]] = []

    def _get_voice(self) -> QTextToSpeech | None:
        if not self._has_tried_voice:
            self._has_tried_voice = True
            if has_voice_engine() and passes_voice_test():
                from PySide6.QtTextToSpeech import QTextToSpeech  # noqa: PLC0415 (heavy)

                try:
                    self._voice = QTextToSpeech()
                    self._voice.stateChanged.connect(self._on_state_changed)
                except RuntimeError as error:
                    _log.info("no speech output: %s", error)
        return self._voice

    def _on_state_changed(self) -> None:
        voice = self._voice
        if voice is None or self._ended_callback is None:
            return
        if voice.state() in {voice.State.Ready, voice.State.Error}:
            callback, self._ended_callback = self._ended_callback, None
            callback()

    def speak(self, text: str, language: str, volume: float, on_ended: Callable[[], None]) -> str:
        """Start speaking a text; return "", or an error message if no voice can speak the language."""
        voice = self._get_voice()
        locales = voice.availableLocales() if voice is not None else []
        locale = next((each for each in locales if each.name().split("_")[0] == language), None)
        if voice is None or locale is None:
            return no_voice_message(language)
        self.stop_voice()
        voice.setLocale(locale)
        voice.setVolume(volume)
        voice.say(text)
        if voice.state() == voice.State.Error:
            return no_voice_message(language)
        self._ended_callback = on_ended
        return ""

    def play(self, notes: Notes, volume: float) -> str:
        """Start playing tones on the default audio output; return an error message or "".

        There is an error if the computer has no audio output or the output doesn't support the format.
        The oldest tones are stopped if `MAX_TONES` are being played.
        """
        try:
            from PySide6.QtMultimedia import QAudioFormat, QAudioSink, QMediaDevices  # noqa: PLC0415 (heavy)
        except (ImportError, RuntimeError) as error:
            _log.info("no audio output: %s", error)
            return _(NO_SOUND_TEXT)
        device = QMediaDevices.defaultAudioOutput()
        audio_format = QAudioFormat()
        audio_format.setSampleRate(RATE_HZ)
        audio_format.setChannelCount(1)
        audio_format.setSampleFormat(QAudioFormat.SampleFormat.Int16)
        if device.isNull() or not device.isFormatSupported(audio_format):
            return _(NO_SOUND_TEXT)
        while len(self._sinks) >= MAX_TONES:
            self._sinks.pop(0)[0].stop()
        buffer = QBuffer()
        buffer.setData(QByteArray(samples(notes, volume)))
        buffer.open(QBuffer.OpenModeFlag.ReadOnly)
        sink = QAudioSink(device, audio_format)
        sink.start(buffer)
        self._sinks.append((sink, buffer))
        return ""

    def stop_voice(self) -> None:
        """Stop speaking immediately, even within a word."""
        self._ended_callback = None
        if self._voice is not None:
            self._voice.stop(self._voice.BoundaryHint.Immediate)

    def stop_tones(self) -> None:
        """Stop all tones."""
        for sink, _buffer in self._sinks:
            sink.stop()
        self._sinks.clear()


class _SpeechWorker(QObject):
    """Worker that executes requests in the engine's thread, skipping those that a stop has cancelled."""

    wake_requested = Signal()
    ended = Signal(int)
    reported = Signal(str, str)  # kind of output, error message or ""

    def __init__(
        self, engine_factory: Callable[[], Engine], requests: deque[Request], speaker: QtSpeaker
    ) -> None:
        super().__init__()
        self._engine_factory, self._requests, self._speaker = engine_factory, requests, speaker
        self._engine: Engine | None = None
        self.loop = QEventLoop()
        self.wake_requested.connect(self.process, Qt.ConnectionType.QueuedConnection)

    def process(self) -> None:
        while self._requests:
            kind, args, generation = self._requests.popleft()
            if kind == "end":
                self._stop_output("all")
                self._engine = None
                self.loop.quit()
            elif kind == "stop":
                self._stop_output(str(args[0]))
            elif self._speaker.is_valid(kind, generation):
                self._execute(kind, args, generation)

    def _stop_output(self, which: str) -> None:
        if self._engine is not None:
            if which != "tones":
                self._engine.stop_voice()
            if which != "voice":
                self._engine.stop_tones()

    def _execute(self, kind: str, args: tuple[Any, ...], generation: int) -> None:
        problem = _(NO_SOUND_TEXT)
        first, *others = args
        try:
            if self._engine is None:
                self._engine = self._engine_factory()
            if not self._speaker.is_valid(kind, generation):  # Stop was called in the meantime
                return
            if kind == "say":
                language, volume = others
                problem = self._engine.speak(first, language, volume, lambda: self.ended.emit(generation))
            else:
                problem = self._engine.play(first, *others)
        except Exception:  # noqa: BLE001 - an engine of the system may raise anything; continue without sound
            _log.warning("speech or audio output failed", exc_info=True)
        self.reported.emit(kind, problem)
        if problem and kind == "say":
            self.ended.emit(generation)


class QtSpeaker(QObject):
    """Speech and audio output of a window. Requests are queued for a worker thread and never block."""

    def __init__(
        self, engine_factory: Callable[[], Engine] = QtEngine, parent: QObject | None = None
    ) -> None:
        # `engine_factory` creates the engine, in its thread, on first use.
        super().__init__(parent)
        self._engine_factory = engine_factory
        self._requests: deque[Request] = deque()
        self._worker: _SpeechWorker | None = None
        self._thread: threading.Thread | None = None
        self._generations: dict[str, int] = {"say": 0, "play": 0}
        self._is_busy = False
        self._problems: dict[str, str] = {}
        self._is_closed = False

    @property
    def is_busy(self) -> bool:
        """True while a text is spoken or waits to be spoken."""
        return self._is_busy

    @property
    def problem(self) -> str:
        """Error message of the last speech or, if it had none, of the last tones; "" if there is none."""
        return self._problems.get("say", "") or self._problems.get("play", "")

    def is_valid(self, kind: str, generation: int) -> bool:
        """Return True if a request is valid, False if a stop has cancelled it. Thread-safe.

        Args:
            kind: Kind of the request, "say" or "play".
            generation: Counter of its kind when the request was queued.
        """
        return not self._is_closed and generation >= self._generations[kind]

    def speak(self, text: str, language: str, volume: float) -> None:
        """Queue a text to be spoken; an earlier text is cancelled.

        Args:
            text: Text.
            language: Language code, such as "en".
            volume: Volume from 0 to 1.
        """
        self._generations["say"] += 1
        self._is_busy = True
        self._enqueue("say", text, language, volume)

    def play(self, notes: Notes, volume: float) -> None:
        """Queue tones to be played, or stop all tones.

        Args:
            notes: Frequency in Hz and duration in s of each tone; empty to stop.
            volume: Volume from 0 to 1.
        """
        if notes:
            self._enqueue("play", tuple(notes), volume)
        else:
            self._stop("tones")

    def stop_voice(self) -> None:
        """Stop speaking and cancel queued texts."""
        self._stop("voice")

    def stop(self) -> None:
        """Stop speech and tones, and cancel all queued requests."""
        self._stop("all")

    def _stop(self, which: str) -> None:
        if which != "tones":
            self._generations["say"] += 1
            self._is_busy = False
        if which != "voice":
            self._generations["play"] += 1
        if self._thread is not None:
            self._enqueue("stop", which)

    def close(self) -> None:
        """Stop all output and the worker thread, which is abandoned if the audio system blocks it."""
        self.stop()
        if self._thread is not None:
            self._enqueue("end")
            self._thread.join(JOIN_TIMEOUT_S)
        self._is_closed = True

    def _enqueue(self, kind: str, *args: object) -> None:
        if self._is_closed:
            return
        self._requests.append((kind, args, self._generations.get(kind, 0)))
        if self._thread is None:
            self._thread = threading.Thread(target=self._run_thread, name="robots' voice", daemon=True)
            self._thread.start()
        elif self._worker is not None:
            self._worker.wake_requested.emit()

    def _run_thread(self) -> None:
        worker = _SpeechWorker(self._engine_factory, self._requests, self)
        worker.ended.connect(self._on_ended, Qt.ConnectionType.QueuedConnection)
        worker.reported.connect(self._on_reported, Qt.ConnectionType.QueuedConnection)
        self._worker = worker
        worker.wake_requested.emit()
        worker.loop.exec()
        self._worker = None

    def _on_ended(self, generation: int) -> None:
        if generation == self._generations["say"]:
            self._is_busy = False

    def _on_reported(self, kind: str, problem: str) -> None:
        self._problems[kind] = problem


if __name__ == "__main__":
    sys.exit(try_voice())
