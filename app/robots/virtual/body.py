"""Simulated body of the virtual Pepper, advanced in time steps, without clock and threads."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from app.robots.virtual.motion import Joint, Motion, Wave
from app.robots.virtual.room import Room
from app.robots.virtual.sounds import Notes, Sound

RADIUS, HEIGHT = 0.27, 1.2
EYE_HEIGHT_M = 1.12
START_POSE = (-0.5, 0.0, 0.0)
START_PITCH_DEG = 8.0
DEFAULT_EYE_COLOUR = "#35b0fa"
DEFAULT_SHOULDER_COLOUR = "#3ab5ff"
MAX_DISTANCE_M = 5.0
_SECONDS_PER_CHARACTER = 0.06
_MIN_SPEECH_S = 0.6
_MAX_STEP_S = 0.02
MIN_TOUCH_S = 0.3
"""Minimum duration of a touch in seconds, so that programs that poll notice a tap."""
HEARD_DISPLAY_S = 4.0
"""Time in seconds for which the drawing shows a word that the user said to the robot."""
_DRAIN_PER_S = 1 / 180  # % of the battery, standing
_DRAIN_MOVING_PER_S = 1 / 60


@dataclass(frozen=True)
class BodyEvent:
    """Event to publish.

    Attributes:
        name: Name of the event in the robot's description.
        data: Fields of the event.
    """

    name: str
    data: dict[str, object]


@dataclass
class Speech:
    """Text being spoken.

    Attributes:
        text: Text.
        duration_s: Total duration in seconds.
        spoken_s: Time in seconds since the start.
        done: True after the last word, or if the speech was interrupted.
    """

    text: str
    duration_s: float
    spoken_s: float = 0.0
    done: bool = False

    @classmethod
    def from_text(cls, text: str, speed_percent: float = 100.0) -> Speech:
        """Return a speech whose duration depends on the length of the text.

        Args:
            text: Text to speak.
            speed_percent: Speed in percent of normal speech; a higher speed shortens the duration.
        """
        return cls(text, max(_MIN_SPEECH_S, len(text) * _SECONDS_PER_CHARACTER) * 100.0 / speed_percent)

    @property
    def word(self) -> str:
        """Word that is currently spoken; "" for an empty text."""
        words = self.text.split()
        index = int(len(words) * min(0.999, self.spoken_s / self.duration_s))
        return words[index] if words else ""


@dataclass
class Body:
    """Simulated body in its room. Not thread-safe: hold the owner's lock around every call."""

    room: Room = field(default_factory=Room)
    x: float = START_POSE[0]
    y: float = START_POSE[1]
    theta_deg: float = START_POSE[2]
    head_yaw: Joint = field(default_factory=lambda: Joint(120.0, -119.0, 119.0))
    head_pitch: Joint = field(
        default_factory=lambda: Joint(90.0, -40.0, 36.0, START_PITCH_DEG, START_PITCH_DEG)
    )
    arms: dict[str, Joint] = field(
        default_factory=lambda: {side: Joint(200.0, 0.0, 180.0) for side in ("left", "right")}
    )
    elbows: dict[str, Joint] = field(
        default_factory=lambda: {side: Joint(220.0, 0.0, 90.0) for side in ("left", "right")}
    )
    eyes: str = DEFAULT_EYE_COLOUR
    shoulders: str = DEFAULT_SHOULDER_COLOUR
    emotion: str = "neutral"
    battery: float = 84.4
    touch_durations_s: dict[str, float] = field(default_factory=dict)
    """Durations of the current touches in seconds, by touched part such as "head"."""
    last_word: str = ""
    since_last_word_s: float = HEARD_DISPLAY_S
    """Time in seconds since the robot heard the word in `last_word`."""
    volume: int = 60
    language: str = "en"
    is_lifted: bool = False
    """True while the user has lifted the robot, so that its base doesn't move."""
    events: deque[BodyEvent] = field(default_factory=lambda: deque(maxlen=200))
    _base_motion: Motion | None = field(default=None, repr=False)
    _is_turning: bool = field(default=False, repr=False)
    sound: Sound | None = None
    """Sound that is being played, or None."""
    _sound_count: int = field(default=0, repr=False)
    _speech: Speech | None = field(default=None, repr=False)
    _waves: list[Wave] = field(default_factory=list, repr=False)
    _ending_touches: set[str] = field(default_factory=set, repr=False)

    # ---- commands ---------------------------------------------------------------------------

    def walk(self, distance: float, speed: float) -> Motion:
        """Start driving straight; a current movement of the base ends as blocked.

        Args:
            distance: Distance in m; negative to drive backwards.
            speed: Maximum speed in m/s.
        """
        return self._start(Motion.walk(distance, speed), is_turning=False)

    def turn(self, angle_deg: float, speed_deg: float) -> Motion:
        """Start turning on the spot; a current movement of the base ends as blocked.

        Args:
            angle_deg: Angle in degrees, positive to the left.
            speed_deg: Maximum turning speed in °/s.
        """
        return self._start(Motion.turn(angle_deg, speed_deg), is_turning=True)

    def _start(self, motion: Motion, *, is_turning: bool) -> Motion:
        if self._base_motion is not None:
            self._base_motion.block()
        self._base_motion, self._is_turning = motion, is_turning
        return motion

    def speak(self, text: str, speed_percent: float = 100.0) -> Speech:
        """Start speaking a text; a current speech or sound ends.

        Args:
            text: Text to speak.
            speed_percent: Speed in percent of normal speech.
        """
        self.stop_audio()
        self._speech = Speech.from_text(text, speed_percent)
        return self._speech

    def stop_audio(self) -> None:
        """Stop the current speech and sound."""
        if self._speech is not None:
            self._speech.done = True
            self._speech = None
        if self.sound is not None:
            self.sound.done = True
            self.sound = None

    def play(self, title: str, notes: Notes) -> Sound:
        """Start playing a sound; a current speech or sound ends.

        Args:
            title: Display name of the sound.
            notes: Notes to play.
        """
        self.stop_audio()
        self._sound_count += 1
        self.sound = Sound(self._sound_count, title, notes)
        return self.sound

    def wave(self, side: str) -> Wave:
        """Start waving with a hand.

        Args:
            side: "left" or "right".
        """
        wave = Wave(self.arms[side], self.elbows[side])
        self._waves.append(wave)
        return wave

    def stand(self) -> None:
        """Lower the arms and turn the head to its start position."""
        for joint in (*self.arms.values(), *self.elbows.values(), self.head_yaw):
            joint.set_target(0.0)
        self.head_pitch.set_target(START_PITCH_DEG)

    def halt(self) -> None:
        """Stop everything: the base brakes in the next steps, all other movements end immediately.

        The emotion becomes neutral.
        """
        if self._base_motion is not None:
            self._base_motion.halt()
        for wave in self._waves:
            wave.halt()
        self._waves.clear()
        self.stop_joints()
        self.stop_audio()
        self.emotion = "neutral"

    def stop_joints(self) -> None:
        """Stop head and arms at their current angles."""
        for joint in self._joints():
            joint.stop()

    def reset(self, room: Room) -> None:
        """Stop everything, enter a room, and return to the start position or the nearest free one."""
        self.halt()
        if self._base_motion is not None:
            self._base_motion.block()
        self._base_motion = None
        self.room, self.is_lifted = room, False
        self.x, self.y = room.nearest_free(*START_POSE[:2], RADIUS)
        self.theta_deg = START_POSE[2]
        self.eyes, self.shoulders = DEFAULT_EYE_COLOUR, DEFAULT_SHOULDER_COLOUR
        self.touch_durations_s = dict.fromkeys(self.touch_durations_s, MIN_TOUCH_S)
        for part in sorted(self.touch_durations_s):
            self.touch(part, down=False)
        self.stand()

    @property
    def are_joints_at_target(self) -> bool:
        """True if head and arms have reached their targets."""
        return all(joint.is_at_target for joint in self._joints())

    @property
    def speech(self) -> str | None:
        """Text that is being spoken, or None."""
        return None if self._speech is None else self._speech.text

    @property
    def spoken_fraction(self) -> float:
        """Spoken fraction of the text, 0 to 1; 0 if nothing is being spoken."""
        return 0.0 if self._speech is None else min(1.0, self._speech.spoken_s / self._speech.duration_s)

    @property
    def is_rolling(self) -> bool:
        """True until the current movement of the base ends, also while it is paused by lifting the robot."""
        return self._base_motion is not None and not self._base_motion.done

    @property
    def is_still(self) -> bool:
        """True if neither base nor joints move."""
        return not self.is_rolling and not self._waves and self.are_joints_at_target

    @property
    def distance(self) -> float:
        """Distance in m from the edge of the base to the next obstacle ahead, at most 5 m."""
        distance_m = self.room.distance_ahead(self.x, self.y, self.theta_deg) - RADIUS
        return min(MAX_DISTANCE_M, max(0.0, distance_m))

    # ---- the user's actions ------------------------------------------------------------------------

    def touch(self, part: str, *, down: bool) -> None:
        """Start or end a touch, which lasts at least `MIN_TOUCH_S`.

        Args:
            part: Touched part, such as "head".
            down: True to start the touch, False to end it.
        """
        if down:
            self._ending_touches.discard(part)
            if part not in self.touch_durations_s:
                self.touch_durations_s[part] = 0.0
                self.events.append(BodyEvent("touched", {"place": part}))
        elif part in self.touch_durations_s:
            self._ending_touches.add(part)
            self._end_touches()

    def _end_touches(self) -> None:
        # Ends touches that have lasted long enough.
        for part in sorted(self._ending_touches):
            if self.touch_durations_s[part] >= MIN_TOUCH_S:
                self._ending_touches.discard(part)
                del self.touch_durations_s[part]
                self.events.append(BodyEvent("released", {"place": part}))

    def set_lifted(self, *, is_lifted: bool) -> None:
        """Lift the robot or put it down; interrupted movements continue after that.

        Args:
            is_lifted: True to lift the robot.
        """
        self.is_lifted = is_lifted

    def carry(self, x: float, y: float) -> None:
        """Move the lifted robot to a position in m, limited by walls; it stays in place if blocked."""
        position = self.room.carried_position(x, y, RADIUS, (self.x, self.y))
        if position is not None:
            self.set_position(*position)

    def set_position(self, x: float, y: float) -> None:
        """Set the position of the robot in m; overlapping balls are pushed aside."""
        self.x, self.y = x, y
        self.room = self.room.with_pushed_ball(x, y, RADIUS)

    def hear(self, word: str) -> None:
        """Process a word that the user said to the robot."""
        self.last_word, self.since_last_word_s = word, 0.0
        self.events.append(BodyEvent("heard", {"word": word}))

    # ---- time -------------------------------------------------------------------------------------

    def step(self, seconds: float) -> None:
        """Advance the simulation in steps that are small enough to detect collisions.

        Args:
            seconds: Duration in seconds.
        """
        while seconds > 1e-9:
            dt = min(seconds, _MAX_STEP_S)
            seconds -= dt
            self._step(dt)

    @property
    def recent_word(self) -> str:
        """Word that the robot heard within the last `HEARD_DISPLAY_S` seconds, or ""."""
        return self.last_word if self.since_last_word_s < HEARD_DISPLAY_S else ""

    def _step(self, dt: float) -> None:
        self.since_last_word_s += dt
        if self._base_motion is not None and not (self.is_lifted and self._base_motion.pause()):
            self._advance_base(self._base_motion, dt)
        for wave in self._waves:
            wave.step()
        self._waves = [wave for wave in self._waves if not wave.done]
        for joint in self._joints():
            joint.step(dt)
        self.touch_durations_s = {
            part: duration_s + dt for part, duration_s in self.touch_durations_s.items()
        }
        self._end_touches()
        if self._speech is not None:
            self._speech.spoken_s += dt
            if self._speech.spoken_s >= self._speech.duration_s:
                self.stop_audio()
        if self.sound is not None:
            self.sound.step(dt)
            if self.sound.done:
                self.sound = None
        self.battery = max(0.0, self.battery - dt * (_DRAIN_PER_S if self.is_still else _DRAIN_MOVING_PER_S))

    def _advance_base(self, motion: Motion, dt: float) -> None:
        delta = motion.step(dt)
        if self._is_turning:
            self.theta_deg = _wrap_angle(self.theta_deg + delta)
        elif delta:
            x = self.x + delta * math.cos(math.radians(self.theta_deg))
            y = self.y + delta * math.sin(math.radians(self.theta_deg))
            if self.room.is_free(x, y, RADIUS, (self.x, self.y)):
                self.x, self.y = x, y
                self.room = self.room.with_pushed_ball(x, y, RADIUS)
            else:
                motion.moved -= delta
                motion.block()
                self.events.append(BodyEvent("bumped", {"side": "front" if delta > 0 else "back"}))
        if motion.done:
            self._base_motion = None

    def _joints(self) -> tuple[Joint, ...]:
        return (self.head_yaw, self.head_pitch, *self.arms.values(), *self.elbows.values())


def _wrap_angle(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0
