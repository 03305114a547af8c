"""Body of the virtual Pepper in its room: movements advanced in time steps, without clock and threads."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from app.robots.virtual.motion import Joint, Motion, Wave
from app.robots.virtual.room import Room
from app.robots.virtual.sounds import Notes, Sound

RADIUS, HEIGHT = 0.27, 1.2
EYE_HEIGHT = 1.12
START = (-0.5, 0.0, 0.0)
START_PITCH = 8.0
EYES = "#35b0fa"
SHOULDERS = "#3ab5ff"
FULL_RANGE = 5.0
_SECONDS_PER_CHARACTER = 0.06
_MIN_SPEECH_S = 0.6
_MAX_STEP_S = 0.02
TOUCH_LEAST_S = 0.3
"""Minimum duration of a touch, so that programs that poll notice a tap."""
HEARD_FOR_S = 4.0
"""Time for which the room shows what the user said to the robot."""
_DRAIN_PER_S = 1 / 180  # % of the battery, standing
_DRAIN_MOVING_PER_S = 1 / 60


@dataclass(frozen=True)
class BodyEvent:
    """Event in the robot's description, with its data."""

    event: str
    data: dict[str, object]


@dataclass
class Speech:
    """Text being spoken; ``done`` is True after the last word."""

    text: str
    seconds: float
    spoken_s: float = 0.0
    done: bool = False

    @classmethod
    def of(cls, text: str, speed_percent: float = 100.0) -> Speech:
        """Return a speech with a duration that depends on the length of the text."""
        return cls(text, max(_MIN_SPEECH_S, len(text) * _SECONDS_PER_CHARACTER) * 100.0 / speed_percent)

    @property
    def word(self) -> str:
        """Word being spoken now."""
        words = self.text.split()
        place = int(len(words) * min(0.999, self.spoken_s / self.seconds))
        return words[place] if words else ""


@dataclass
class Body:
    """State of the body. Not thread-safe: hold the owner's lock around every call."""

    room: Room = field(default_factory=Room)
    x: float = START[0]
    y: float = START[1]
    theta_deg: float = START[2]
    head_yaw: Joint = field(default_factory=lambda: Joint(120.0, -119.0, 119.0))
    head_pitch: Joint = field(default_factory=lambda: Joint(90.0, -40.0, 36.0, START_PITCH, START_PITCH))
    arms: dict[str, Joint] = field(
        default_factory=lambda: {side: Joint(200.0, 0.0, 180.0) for side in ("left", "right")}
    )
    elbows: dict[str, Joint] = field(
        default_factory=lambda: {side: Joint(220.0, 0.0, 90.0) for side in ("left", "right")}
    )
    eyes: str = EYES
    shoulders: str = SHOULDERS
    emotion: str = "neutral"
    battery: float = 84.4
    touched: dict[str, float] = field(default_factory=dict)
    """Touched places, and the duration of each touch in seconds."""
    heard: str = ""
    listened_s: float = HEARD_FOR_S
    """Seconds since the robot heard `heard`."""
    volume: int = 60
    language: str = "en"
    held: bool = False
    """True while the user lifts the robot, so that its base doesn't move."""
    happenings: deque[BodyEvent] = field(default_factory=lambda: deque(maxlen=200))
    _base: Motion | None = field(default=None, repr=False)
    _turning: bool = field(default=False, repr=False)
    sound: Sound | None = None
    """Sound being played."""
    _sounds: int = field(default=0, repr=False)
    _speech: Speech | None = field(default=None, repr=False)
    _waves: list[Wave] = field(default_factory=list, repr=False)
    _ending_touches: set[str] = field(default_factory=set, repr=False)

    # ---- commands ---------------------------------------------------------------------------

    def walk(self, distance: float, speed: float) -> Motion:
        """Start to drive straight; backwards if the distance is negative."""
        return self._start(Motion.walk(distance, speed), turning=False)

    def turn(self, angle_deg: float, speed_deg: float) -> Motion:
        """Start to turn on the spot; to the left if the angle is positive."""
        return self._start(Motion.turn(angle_deg, speed_deg), turning=True)

    def _start(self, motion: Motion, *, turning: bool) -> Motion:
        if self._base is not None:
            self._base.block()
        self._base, self._turning = motion, turning
        return motion

    def speak(self, text: str, speed_percent: float = 100.0) -> Speech:
        """Start to speak; a current speech or sound ends."""
        self.hush()
        self._speech = Speech.of(text, speed_percent)
        return self._speech

    def hush(self) -> None:
        """Stop speech and sound."""
        if self._speech is not None:
            self._speech.done = True
            self._speech = None
        if self.sound is not None:
            self.sound.done = True
            self.sound = None

    def play(self, title: str, notes: Notes) -> Sound:
        """Start to play notes; a current speech or sound ends."""
        self.hush()
        self._sounds += 1
        self.sound = Sound(self._sounds, title, notes)
        return self.sound

    def wave(self, side: str) -> Wave:
        """Start to wave with the left or right hand."""
        made = Wave(self.arms[side], self.elbows[side])
        self._waves.append(made)
        return made

    def stand(self) -> None:
        """Lower the arms and look straight ahead."""
        for joint in (*self.arms.values(), *self.elbows.values(), self.head_yaw):
            joint.aim(0.0)
        self.head_pitch.aim(START_PITCH)

    def halt(self) -> None:
        """Stop everything: the base brakes in the next steps, all other movements end immediately."""
        if self._base is not None:
            self._base.halt()
        for wave in self._waves:
            wave.halt()
        self.hold_joints()
        self.hush()
        self.emotion = "neutral"

    def hold_joints(self) -> None:
        """Hold head and arms at their current angles."""
        for joint in self._joints():
            joint.hold()

    def reset(self, room: Room) -> None:
        """Stop everything and return to the start position in this room."""
        self.halt()
        if self._base is not None:
            self._base.block()
        self._base = None
        self.room, self.held = room, False
        self.x, self.y = room.nearest_free(*START[:2], RADIUS)
        self.theta_deg = START[2]
        self.eyes, self.shoulders = EYES, SHOULDERS
        self.touched = dict.fromkeys(self.touched, TOUCH_LEAST_S)
        for place in sorted(self.touched):
            self.touch(place, down=False)
        self.stand()

    @property
    def joints_still(self) -> bool:
        """True when head and arms have reached their targets."""
        return all(joint.arrived for joint in self._joints())

    @property
    def speech(self) -> str | None:
        """Text in the speech bubble."""
        return None if self._speech is None else self._speech.text

    @property
    def spoken(self) -> float:
        """Spoken part of the text, 0 to 1."""
        return 0.0 if self._speech is None else min(1.0, self._speech.spoken_s / self._speech.seconds)

    @property
    def rolling(self) -> bool:
        """True while the base moves."""
        return self._base is not None and not self._base.done

    @property
    def still(self) -> bool:
        """True when nothing moves."""
        return not self.rolling and not self._waves and self.joints_still

    @property
    def distance(self) -> float:
        """Distance from the edge of the base to the next obstacle ahead, at most 5 m."""
        ahead = self.room.distance_ahead(self.x, self.y, self.theta_deg) - RADIUS
        return min(FULL_RANGE, max(0.0, ahead))

    # ---- the user's actions ------------------------------------------------------------------------

    def touch(self, place: str, *, down: bool) -> None:
        """Start or end a touch; a tap lasts at least `TOUCH_LEAST_S`."""
        if down:
            self._ending_touches.discard(place)
            if place not in self.touched:
                self.touched[place] = 0.0
                self.happenings.append(BodyEvent("touched", {"place": place}))
        elif place in self.touched:
            self._ending_touches.add(place)
            self._end_touches()

    def _end_touches(self) -> None:
        # Ends touches that have lasted long enough.
        for place in sorted(self._ending_touches):
            if self.touched[place] >= TOUCH_LEAST_S:
                self._ending_touches.discard(place)
                del self.touched[place]
                self.happenings.append(BodyEvent("released", {"place": place}))

    def hold(self, *, held: bool) -> None:
        """Lift the robot or put it down. Interrupted movements continue afterwards."""
        self.held = held

    def carry(self, x: float, y: float) -> None:
        """Move the robot to a place if that is free. Walls limit the movement."""
        place = self.room.carried(x, y, RADIUS, (self.x, self.y))
        if place is not None:
            self.place(*place)

    def place(self, x: float, y: float) -> None:
        """Set the position of the robot."""
        self.x, self.y = x, y
        self.room = self.room.pushed_ball(x, y, RADIUS)

    def hear(self, word: str) -> None:
        """Process a word that the user said."""
        self.heard, self.listened_s = word, 0.0
        self.happenings.append(BodyEvent("heard", {"word": word}))

    # ---- time -------------------------------------------------------------------------------------

    def step(self, seconds: float) -> None:
        """Advance the simulation in small steps, so that the robot can't pass through objects."""
        while seconds > 1e-9:
            dt = min(seconds, _MAX_STEP_S)
            seconds -= dt
            self._step(dt)

    @property
    def just_heard(self) -> str:
        """Word heard recently, or ""."""
        return self.heard if self.listened_s < HEARD_FOR_S else ""

    def _step(self, dt: float) -> None:
        self.listened_s += dt
        if self._base is not None and not (self.held and self._base.hold()):
            self._roll(self._base, dt)
        for wave in self._waves:
            wave.step()
        self._waves = [wave for wave in self._waves if not wave.done]
        for joint in self._joints():
            joint.step(dt)
        self.touched = {place: for_s + dt for place, for_s in self.touched.items()}
        self._end_touches()
        if self._speech is not None:
            self._speech.spoken_s += dt
            if self._speech.spoken_s >= self._speech.seconds:
                self.hush()
        if self.sound is not None:
            self.sound.step(dt)
            if self.sound.done:
                self.sound = None
        self.battery = max(0.0, self.battery - dt * (_DRAIN_PER_S if self.still else _DRAIN_MOVING_PER_S))

    def _roll(self, motion: Motion, dt: float) -> None:
        way = motion.step(dt)
        if self._turning:
            self.theta_deg = _wrapped(self.theta_deg + way)
        elif way:
            x = self.x + way * math.cos(math.radians(self.theta_deg))
            y = self.y + way * math.sin(math.radians(self.theta_deg))
            if self.room.free(x, y, RADIUS, (self.x, self.y)):
                self.x, self.y = x, y
                self.room = self.room.pushed_ball(x, y, RADIUS)
            else:
                motion.moved -= way
                motion.block()
                self.happenings.append(BodyEvent("bumped", {"side": "front" if way > 0 else "back"}))
        if motion.done:
            self._base = None

    def _joints(self) -> tuple[Joint, ...]:
        return (self.head_yaw, self.head_pitch, *self.arms.values(), *self.elbows.values())


def _wrapped(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0
