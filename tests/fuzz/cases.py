"""Regression inputs that once broke a parser, by fuzz target. A comment describes the effect of each."""

from __future__ import annotations

import json

LONG = b"9" * 5_000
"""Number with more digits than Python converts to an `int`."""
DEEP = 100_000
NEIGHBOUR = {"robot": "a", "figure": "f", "theta_deg": 9, "radius": 0.2, "height": 1}
HUGE = 10**400

CASES: dict[str, list[bytes]] = {
    # `str.isdigit` accepts a superscript two, which `int` rejects; and numbers with too many digits.
    "addresses": ["host:\u00b2".encode(), b"host:" + LONG, LONG + b".1.1.1"],
    # `int` accepts signs and underscores, such as a subscriber -1.
    "filters": [b"\xffhello/-000000000000001/t", b"\xffread/" + b"/".join([b"0_00000000000001"] * 4)],
    # An error message as long as the input.
    "names": [b"t" * 1_000_000],
    # A lone surrogate beside NaN, and deep nesting, paused the gateway; 1e999 became a bare Infinity.
    "frames_of_originals": [
        b't {"a": NaN, "b": "\\ud800"}',
        b"[NaN, 1e999]",
        b"[" * DEEP + b"NaN",
        b'"' + b"[" * DEEP + b'"',
    ],
    "the_gateways_file": [
        b"[" * DEEP,
        json.dumps({"version": 1, "boot": HUGE, "lines": [], "programs": []}).encode(),
    ],
    # The run time grew with the square of the length.
    "keys": [b"\\\\" + b"." * 1_000_000],
    # The run time grew with a power of the length.
    "patterns_of_topics": [b"*a*a*a*a*a*a*a*a*b\xff|\xff" + b"a" * 200],
    # An index of too many digits; a message nested 1000 levels.
    "field_paths": [b"[" + LONG + b"]", b".\xff|\xff" + b"[" * 1_000 + b"]" * 1_000],
    "payloads": [b"\x80"],
    # A definition from outside: a number of 5000 digits, and a duplicate field.
    "definitions_of_ros": [b"uint8[" + LONG + b"] x", b"uint8[] flags\nbool[3] flags\n"],
    # `math.isfinite` and `float` raise for integers beyond the range of a float.
    "neighbours_of_robots": [json.dumps({**NEIGHBOUR, "x": HUGE, "y": 0}).encode()],
    "voices_of_robots": [json.dumps({"spoken": HUGE, "volume": -HUGE}).encode()],
    # The name of a behaviour was a list nested 2000 levels deep.
    "files_of_behaviours": [
        b'{"format": "nep-behaviour", "version": 1, "workspace": {}, "name": '
        + b"[" * 2_000
        + b"]" * 2_000
        + b"}"
    ],
    # A recent file with an impossible path or an impossible time.
    "files_of_settings": [
        json.dumps({"recent": [{"path": "/" + "a" * 5_000, "opened_s": 1}]}).encode(),
        json.dumps({"recent": [{"path": "/a", "opened_s": HUGE}]}).encode(),
    ],
    # 89 bytes took 4 GB and 3 s: a truncated chunk declares a size of 4 GB.
    "pictures_decoded": [
        bytes.fromhex(
            "89504e470d0a1a0a0000000d494844520000000200000002080000dd0052000057f800000e49444154789c6348"
            "4c62484c02000497018700010112000300080002000300003f001230347fe5640000000049454e44ae426082"
        )
    ],
    # `True` is an int in Python but not in numpy.
    "raw_pictures_decoded": [b"\x82\xa5shape\x92\xc3\x02\xa8encoding\xa532FC1\xff|\xffxxxxxxxx"],
    # A time beyond the range of a float, and error messages that contain a whole value.
    "arguments": [b"1" + b"0" * 400, b"[" * 1_000 + b"]" * 1_000, b'"' + b"x" * 100_000 + b'"'],
    "maps_for_ros2": [b'{"fr\\ud800ame_id": "a"}'],
}
