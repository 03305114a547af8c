"""Search words for robot blocks, derived from parts of the names in a robot description."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from nep.i18n import ENGLISH, gettext, language, plazy

_NAME_PART = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


class _Ability(NamedTuple):
    """Kind of action or sensor, recognized by parts of names.

    Attributes:
        names: Parts of names that identify the ability, in lower case.
        search_words: Search words in English, separated by commas.
    """

    names: frozenset[str]
    search_words: str


def _make_ability(names: str, search_words: str) -> _Ability:
    return _Ability(frozenset(names.split()), search_words)


# Translators: other words that people may type to find a block that does this, with commas between.
# Write what people say in your language; it need not be a translation, and may be shorter or longer.
_ACTION_ABILITIES: Mapping[str, _Ability] = {
    "say": _make_ability(
        "say speak talk tell speech speaking",
        plazy(
            "words to find what a robot does: say",
            "say, talk, speak, tell, voice, speech, greet, hello, print, announce",
        ),
    ),
    "move": _make_ability(
        "move walk drive go forward forwards backward backwards step steps run travel",
        plazy(
            "words to find what a robot does: move",
            "move, go, walk, drive, step, forward, forwards, backward, back, straight, ahead, advance, "
            "travel",
        ),
    ),
    "turn": _make_ability(
        "turn rotate spin steer",
        plazy(
            "words to find what a robot does: turn",
            "turn, rotate, spin, left, right, degrees, angle, around, steer, direction",
        ),
    ),
    "go to": _make_ability(
        "to toward towards navigate approach",
        plazy(
            "words to find what a robot does: go to",
            "go to, navigate, position, place, target, approach, destination, come",
        ),
    ),
    "look": _make_ability(
        "look gaze",
        plazy(
            "words to find what a robot does: look",
            "look, watch, gaze, see, face, eyes",
        ),
    ),
    "head": _make_ability(
        "head neck",
        plazy(
            "words to find what a robot does: head",
            "head, nod, tilt, neck, look up, look down",
        ),
    ),
    "arms": _make_ability(
        "wave arm arms hand hands gesture",
        plazy(
            "words to find what a robot does: arms",
            "wave, hand, arm, greet, hello, goodbye, bye, gesture, raise",
        ),
    ),
    "grip": _make_ability(
        "open close grip grab gripper claw hold pick release",
        plazy(
            "words to find what a robot does: grip",
            "open, close, grab, grip, hold, pick up, release, let go, gripper, claw",
        ),
    ),
    "posture": _make_ability(
        "stand sit posture pose crouch lie rest",
        plazy(
            "words to find what a robot does: posture",
            "stand, sit, posture, pose, rest, get up, straight, upright, lie down",
        ),
    ),
    "dance": _make_ability(
        "dance animation animate choreography mode",
        plazy(
            "words to find what a robot does: dance",
            "dance, animation, gesture, move, perform, show",
        ),
    ),
    "follow": _make_ability(
        "follow track chase",
        plazy(
            "words to find what a robot does: follow",
            "follow, track, chase, come along, watch",
        ),
    ),
    "emotion": _make_ability(
        "emotion emotions feeling mood face smile expression",
        plazy(
            "words to find what a robot does: emotion",
            "emotion, feeling, mood, smile, happy, sad, angry, face, expression",
        ),
    ),
    "light": _make_ability(
        "light lights led leds lamp colour color blink",
        plazy(
            "words to find what a robot does: light",
            "light, led, lamp, colour, color, shine, glow, blink, eyes, rgb, red, green, blue",
        ),
    ),
    "sound": _make_ability(
        "sound sounds volume music play audio beep song tone",
        plazy(
            "words to find what a robot does: sound",
            "sound, noise, music, audio, beep, tone, volume, loud, quiet, song, play",
        ),
    ),
    "language": _make_ability(
        "language",
        plazy(
            "words to find what a robot does: language",
            "language, translate, English, Spanish, accent",
        ),
    ),
    "photo": _make_ability(
        "photo picture camera snapshot",
        plazy(
            "words to find what a robot does: photo",
            "photo, picture, camera, snapshot, image, take a picture",
        ),
    ),
    "show": _make_ability(
        "display screen tablet image video page url",
        plazy(
            "words to find what a robot does: show",
            "show, display, screen, tablet, picture, image, video, web page",
        ),
    ),
    "stop": _make_ability(
        "stop halt brake",
        plazy(
            "words to find what a robot does: stop",
            "stop, halt, stand still, brake, freeze, end",
        ),
    ),
    "wait": _make_ability(
        "wait sleep pause",
        plazy(
            "words to find what a robot does: wait",
            "wait, sleep, pause, delay, seconds",
        ),
    ),
    "listen": _make_ability(
        "listen hear hears heard word words speech",
        plazy(
            "words to find what a robot does: listen",
            "listen, hear, microphone, voice, speech recognition, understand, spoken, word, told",
        ),
    ),
}
_SENSOR_ABILITIES: Mapping[str, _Ability] = {
    "listen": _make_ability(
        "listen hear hears heard word words speech",
        plazy(
            "words to find what a robot tells: listen",
            "listen, hear, microphone, voice, speech recognition, understand, spoken, word, told",
        ),
    ),
    "battery": _make_ability(
        "battery charge power",
        plazy(
            "words to find what a robot tells: battery",
            "battery, charge, power, energy, level, percent",
        ),
    ),
    "distance": _make_ability(
        "distance sonar range ultrasonic ultrasound laser lidar proximity obstacle",
        plazy(
            "words to find what a robot tells: distance",
            "distance, sonar, ultrasonic, ultrasound, range, how far, proximity, obstacle, near, wall, "
            "infrared, centimetres, metres",
        ),
    ),
    "touch": _make_ability(
        "touch touched touches bumper bump bumped pressed tactile button released hit collision contact",
        plazy(
            "words to find what a robot tells: touch",
            "touch, touching, press, button, bump, bumper, hit, crash, collision, tactile, contact, tap, pat",
        ),
    ),
    "face": _make_ability(
        "face faces person people human",
        plazy(
            "words to find what a robot tells: face",
            "face, person, people, somebody, see, detect, recognize, recognise, camera, vision",
        ),
    ),
    "ball": _make_ability(
        "ball balls marker markers object objects colour color seen sees",
        plazy(
            "words to find what a robot tells: ball",
            "ball, thing, object, marker, colour, color, see, detect, find, camera, vision",
        ),
    ),
    "position": _make_ability(
        "pose position location odometry heading x y",
        plazy(
            "words to find what a robot tells: position",
            "position, place, where, location, coordinates, x, y, heading, direction",
        ),
    ),
    "temperature": _make_ability(
        "temperature heat",
        plazy(
            "words to find what a robot tells: temperature",
            "temperature, warm, cold, heat, degrees, thermometer",
        ),
    ),
    "brightness": _make_ability(
        "light brightness lux",
        plazy(
            "words to find what a robot tells: brightness",
            "light, brightness, dark, bright, lux",
        ),
    ),
    "loudness": _make_ability(
        "sound loudness noise volume",
        plazy(
            "words to find what a robot tells: loudness",
            "sound, loudness, noise, volume, microphone, clap",
        ),
    ),
    "tilt": _make_ability(
        "tilt gyro gyroscope accelerometer acceleration imu compass",
        plazy(
            "words to find what a robot tells: tilt",
            "tilt, gyro, gyroscope, acceleration, shake, compass, angle",
        ),
    ),
    "line": _make_ability(
        "line ground floor",
        plazy(
            "words to find what a robot tells: line",
            "line, black, ground, floor, line follower",
        ),
    ),
}
_ABILITY_OF_RESOURCE: Mapping[str, str] = {
    "speech": "say",
    "base": "move",
    "wheels": "move",
    "legs": "move",
    "head": "head",
    "arms": "arms",
    "hands": "arms",
    "lights": "light",
    "light": "light",
    "leds": "light",
    "face": "emotion",
    "tablet": "show",
    "screen": "show",
    "camera": "photo",
    "audio": "sound",
}
"""Keys of `_ACTION_ABILITIES` by resource, for actions whose names aren't recognized."""

CHANGE_SEARCH_WORDS = plazy(
    "words to find “when … changes”", "sensor, change, new value, whenever, event, update"
)
PASS_SEARCH_WORDS = plazy(
    "words to find “when … goes below …”",
    "sensor, above, below, more, less, greater, smaller, threshold, limit, event",
)


class SearchWords(NamedTuple):
    """Search words of a block, separated by commas.

    Attributes:
        words: Search words in the current language.
        english: Search words in English; without those in `words`.
    """

    words: str
    english: str


def action_search_words(names: Iterable[str], uses: Iterable[str] = ()) -> SearchWords:
    """Return the search words of an action.

    Args:
        names: Name, title and types of the action.
        uses: Resources of the action, used if the names aren't recognized.
    """
    parts = _name_parts(names)
    abilities = _matching_abilities(_ACTION_ABILITIES, parts) or [
        _ACTION_ABILITIES[_ABILITY_OF_RESOURCE[part]] for part in uses if part in _ABILITY_OF_RESOURCE
    ]
    return _collect_search_words(parts, abilities)


def sensor_search_words(names: Iterable[str]) -> SearchWords:
    """Return the search words of a sensor or event.

    Args:
        names: Name, title and types of the sensor or event.
    """
    parts = _name_parts(names)
    return _collect_search_words(parts, _matching_abilities(_SENSOR_ABILITIES, parts))


def bilingual_search_words(english: str) -> SearchWords:
    """Return search words in the current language and in English.

    Args:
        english: Search words in English, marked for translation.
    """
    return SearchWords(gettext(english), "" if language() == ENGLISH else str(english))


def _name_parts(names: Iterable[str]) -> tuple[str, ...]:
    name_parts = (part.lower() for name in names for part in _NAME_PART.findall(name.rpartition(":")[2]))
    return tuple(dict.fromkeys(name_parts))


def _matching_abilities(abilities: Mapping[str, _Ability], parts: Iterable[str]) -> list[_Ability]:
    unique_parts = frozenset(parts)
    return [ability for ability in abilities.values() if ability.names & unique_parts]


def _collect_search_words(parts: Iterable[str], abilities: Iterable[_Ability]) -> SearchWords:
    lists = [bilingual_search_words(ability.search_words) for ability in abilities]
    translated_words = ", ".join(each.words for each in lists)
    english = ", ".join([*(each.english for each in lists if each.english), " ".join(parts)])
    return SearchWords(translated_words, english)
