"""Virtual Pepper: ``python -m app.robots.simulated --name Pepper`` runs it as a process.

The robot is simulated in a small room (:mod:`app.robots.virtual`). Studio draws the state published on
``/<name>/state``; the user changes the room through ``/<name>/world``.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Literal, TypeAlias

from app.robots.description.json_access import to_number
from app.robots.driver.call import Call, Canceled, Failed
from app.robots.driver.common_actions import drives, moves
from app.robots.driver.declare import Kind, action, safe_stop
from app.robots.driver.process import main as drive
from app.robots.driver.schema import Colour, Range, Suggested, Text, Title, Words
from app.robots.virtual.body import START_PITCH_DEG
from app.robots.virtual.robot import FEEDBACK_INTERVAL_S, SimulatedRobot
from app.robots.virtual.room import Room
from app.robots.virtual.sounds import SOUNDS, Notes, SoundName
from nep.i18n import _, number

VIRTUAL_ROBOT = ("pepper", "Pepper")
SPEECH, FACE = "Speech", "Face and lights"
Emotion: TypeAlias = Literal["happy", "surprised", "sad", "angry", "neutral"]
Side: TypeAlias = Literal["left", "right"]
Language: TypeAlias = Annotated[
    Literal["en", "fr", "ja"], Words({"en": "English", "fr": "French", "ja": "Japanese"})
]
Volume: TypeAlias = Annotated[int, Range(0, 100, 5, "%")]
Target: TypeAlias = Annotated[
    Literal["ahead", "left", "right", "up", "down", "face", "ball"],
    Words({"face": "the face", "ball": "the ball", "left": "the left", "right": "the right"}),
]


def _rize_turn(rize_input: str, options: Mapping[str, object]) -> Mapping[str, object]:
    degrees = to_number(options.get("degrees"))
    return {"direction": rize_input} | ({} if degrees is None else {"angle": degrees})


def _rize_walk(rize_input: str, options: Mapping[str, object]) -> Mapping[str, object]:
    metres = to_number(options.get("meters"))
    sign = {"forwards": 1.0, "backwards": -1.0}[rize_input]
    return {"distance": sign * (0.5 if metres is None else metres)}


def _rize_light(rize_input: str, options: Mapping[str, object]) -> Mapping[str, object]:
    components = [to_number(options.get(name)) for name in "RGB"]
    colour = "".join(f"{min(255, max(0, int(component or 0))):02x}" for component in components)
    return {"where": "eyes" if rize_input == "eyes" else "both", "colour": f"#{colour}"}


class VirtualPepper(SimulatedRobot):
    """Virtual Pepper: a humanoid on wheels with head, arms, voice and lights."""

    # ---- speech -----------------------------------------------------------------------------------

    @action(
        "say %text",
        SPEECH,
        "message-circle",
        says="says “%text”",
        uses=("speech",),
        timeout_s=60,
        feedback={"word": str},
        output={"seconds": Annotated[float, Range(unit="s")]},
        rize="say",
    )
    def say(
        self,
        call: Call,
        text: Annotated[str, Text(1, 500), Suggested("Hello! I am Pepper.")],
        volume: Volume = 60,
        language: Language = "en",
    ) -> Mapping[str, object]:
        """Say something. A speech bubble shows the text while the robot speaks."""
        with self._simulation.lock:
            body = self._simulation.body
            body.volume, body.language = volume, language
            speech = body.speak(text)
        try:
            call.feedback(word=speech.word)
            while not call.until(lambda: speech.done, for_s=FEEDBACK_INTERVAL_S):
                call.feedback(word=speech.word)
        except Canceled:
            with self._simulation.lock:
                if not speech.done:
                    self._simulation.body.stop_audio()
            raise
        return {"seconds": round(speech.duration_s, 2)}

    @action(
        "play sound %sound",
        SPEECH,
        "music",
        says="plays a %sound",
        uses=("speech",),
        timeout_s=15,
    )
    def play_sound(self, call: Call, sound: SoundName = "beep", volume: Volume = 60) -> None:
        """Play a sound until it ends."""
        self._play(call, sound, SOUNDS[sound], volume)

    @action(
        "play tone %frequency Hz for %seconds s",
        SPEECH,
        "music-2",
        says="plays a tone of %frequency Hz",
        uses=("speech",),
        timeout_s=15,
    )
    def play_tone(
        self,
        call: Call,
        frequency: Annotated[float, Range(50, 5000, 10, "Hz")] = 440.0,
        seconds: Annotated[float, Range(0.1, 10, 0.1, "s")] = 0.5,
        volume: Volume = 60,
    ) -> None:
        """Play a tone. 262 Hz is middle C; twice the frequency is one octave higher."""
        self._play(call, f"{frequency:g} Hz", ((frequency, seconds),), volume)

    def _play(self, call: Call, title: str, notes: Notes, volume: int) -> None:
        with self._simulation.lock:
            body = self._simulation.body
            body.volume = volume
            sound = body.play(title, notes)

        def stop_sound() -> None:
            if not sound.done:
                self._simulation.body.stop_audio()

        self._wait_until(call, lambda: sound.done, stop_sound)

    # ---- movement ---------------------------------------------------------------------------------

    @drives(
        "turn %direction by %angle °",
        "rotate-ccw",
        "turns %direction by %angle°",
        unit="deg",
        rize="turn",
        from_rize=_rize_turn,
    )
    def turn(
        self,
        call: Call,
        direction: Side = "left",
        angle: Annotated[float, Range(-360, 360, 5, "deg")] = 30.0,
        speed: Annotated[float, Range(5, 90, 5, "deg/s")] = 40.0,
    ) -> None:
        """Turn on the spot."""
        signed_angle = angle if direction == "left" else -angle
        self._run_motion(call, lambda body: body.turn(signed_angle, speed))

    @drives(
        "walk %distance m",
        "footprints",
        "walks %distance m",
        unit="m",
        rize="walk",
        from_rize=_rize_walk,
    )
    def walk(
        self,
        call: Call,
        distance: Annotated[float, Range(-2, 2, 0.05, "m")] = 0.5,
        speed: Annotated[float, Range(0.05, 0.35, 0.05, "m/s")] = 0.3,
    ) -> None:
        """Walk straight ahead, or backwards if the distance is negative."""
        motion = self._run_motion(call, lambda body: body.walk(distance, speed))
        if motion.is_blocked:
            raise Failed(
                _("walk: something is in the way after {metres} m").format(
                    metres=number(abs(motion.moved), ".2f")
                )
            )

    @moves("look at %target", "eye", "looks at %target", "head", timeout_s=10, title="look at")
    def look_at(self, call: Call, target: Target = "face") -> None:
        """Turn the head in a direction, or to the face or ball in the picture."""
        with self._simulation.lock:
            yaw, pitch = self._head_angles_to(target)
        self._turn_head(call, yaw, pitch)

    @moves(
        "turn head %yaw ° left and %pitch ° down",
        "move",
        "turns its head",
        "head",
        timeout_s=10,
        title="turn head",
    )
    def head(
        self,
        call: Call,
        yaw: Annotated[float, Range(-119, 119, 5, "deg", "angle"), Title("to the left")] = 0.0,
        pitch: Annotated[float, Range(-40, 36, 2, "deg", "angle"), Title("down")] = START_PITCH_DEG,
    ) -> None:
        """Turn the head; right and up are negative."""
        self._turn_head(call, yaw, pitch)

    @moves("wave %hand hand", "hand", "waves its %hand hand", "arms", timeout_s=20, rize="wave")
    def wave(self, call: Call, hand: Side = "right") -> None:
        """Wave one hand."""
        with self._simulation.lock:
            wave = self._simulation.body.wave(hand)
        self._wait_until(call, lambda: wave.done, wave.halt)

    @moves("stand straight", "person-standing", "stands straight", "arms", "head", timeout_s=10)
    def stand(self, call: Call) -> None:
        """Lower the arms and look straight ahead."""
        with self._simulation.lock:
            self._simulation.body.stand()
        self._wait_until(
            call, lambda: self._simulation.body.are_joints_at_target, self._simulation.body.stop_joints
        )

    # ---- face and lights --------------------------------------------------------------------------

    @action(
        "look %emotion for %seconds s",
        FACE,
        "smile",
        title="show emotion",
        says="looks %emotion for %seconds s",
        uses=("face",),
        on_busy="replace",
        timeout_s=65,
        rize="robot_emotion",
    )
    def show_emotion(
        self,
        call: Call,
        emotion: Emotion = "happy",
        seconds: Annotated[float, Range(0.5, 60, 0.5, "s")] = 2.0,
    ) -> None:
        """Show an emotion for some time."""
        with self._simulation.lock:
            self._simulation.body.emotion = emotion
        try:
            call.wait(seconds)
        finally:
            with self._simulation.lock:
                self._simulation.body.emotion = "neutral"

    @action(
        "light %where %colour",
        FACE,
        "lightbulb",
        says="lights up its %where",
        uses=("lights",),
        cancellable=False,
        rize="leds",
        from_rize=_rize_light,
    )
    def light(
        self,
        call: Call,  # noqa: ARG002 - every action receives its call
        where: Literal["eyes", "shoulders", "both"] = "eyes",
        colour: Colour = "#35b0fa",
    ) -> None:
        """Set the colour of the lights."""
        with self._simulation.lock:
            if where in {"eyes", "both"}:
                self._simulation.body.eyes = colour
            if where in {"shoulders", "both"}:
                self._simulation.body.shoulders = colour

    # ---- stopping ---------------------------------------------------------------------------------

    @safe_stop(watchdog_s=1.0, within_s=0.2)
    def stop(self) -> None:
        """Stop base, joints and speech, and return when nothing moves.

        Raises Failed if the robot still moves after 2 s.
        """
        with self._simulation.lock:
            self._simulation.body.halt()
        if not self._simulation.wait_for(lambda: self._simulation.body.is_still, timeout_s=2.0):
            raise Failed(_("the virtual robot keeps moving"))


ROBOT = Kind(
    model="pepper",
    title="Pepper",
    body=VirtualPepper,
    virtual=True,
    kinds=("humanoid", "mobile", "speaking"),
    driver="virtual",
    description="A virtual humanoid on wheels in a small room: speech, head, arms, lights, camera, touch.",
)


def create_room(seed: int | None) -> Room:
    """Return the room at the start.

    Args:
        seed: Seed for random positions of ball and person; None for the default positions.
    """
    if seed is None:
        return Room()
    generator = random.Random(seed)  # noqa: S311 - furniture, not secrets
    room = Room().with_moved("ball", generator.uniform(1.2, 2.6), generator.uniform(-1.4, -0.5))
    return room.with_moved("person", generator.uniform(0.8, 1.6), generator.uniform(-0.3, 0.6))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the virtual robot as a process and return the exit code.

    Args:
        arguments: Arguments of `app.robots.driver.process.main`, and ``--seed`` for random positions of ball
            and person.
    """
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--seed", type=int, default=None)
    options, driver_arguments = parser.parse_known_args(arguments)
    body = type("VirtualPepper", (VirtualPepper,), {"start_room": create_room(options.seed)})
    return drive(replace(ROBOT, body=body), driver_arguments)


if __name__ == "__main__":
    sys.exit(main())
