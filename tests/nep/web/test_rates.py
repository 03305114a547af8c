"""Tests of the message rates of a page's topics, and of the names of its client."""

from __future__ import annotations

import pytest

from nep.programs.web.rates import RateMeter
from nep.programs.web.visitors import client_name, device_kind


def test_rate_is_the_average_of_the_last_two_seconds() -> None:
    now = [100.2]
    meter = RateMeter(lambda: now[0])
    assert meter.rates() == (0.0, 0.0)
    for tenth in range(40):
        now[0] = 100.2 + tenth / 10
        meter.count(50)
    now[0] = 104.0
    assert meter.rates() == pytest.approx((10, 500), rel=0.06)
    now[0] = 105.0
    assert meter.rates() == pytest.approx((6.5, 325), rel=0.2)
    now[0] = 200.0
    assert meter.rates() == (0.0, 0.0)
    assert meter.total == 40


@pytest.mark.parametrize(
    ("user_agent", "name"),
    [
        ("Mozilla/5.0 (iPad; CPU OS 17_5 like Mac OS X) Version/17.5 Safari/604.1", "Safari"),
        ("Mozilla/5.0 (iPad) AppleWebKit/605.1.15 CriOS/120.0 Mobile Safari/604.1", "Chrome"),
        ("Mozilla/5.0 (X11; Linux x86_64; rv:130.0) Gecko/20100101 Firefox/130.0", "Firefox"),
        ("Mozilla/5.0 (Windows NT 10.0) AppleWebKit/537.36 Chrome/140.0 Safari/537.36 Edg/140.0", "Edge"),
        ("Mozilla/5.0 (X11) AppleWebKit/537.36 QtWebEngine/6.11 Chrome/140.0 Safari/537.36", "Qt WebEngine"),
        ("AutobahnPython/24.4.2", "roslibpy"),
        ("robot-dashboard/1.0 (linux)", "robot-dashboard"),
        ("Mozilla/5.0 (compatible)", ""),
        ("\x1b[31m", ""),
        ("", ""),
    ],
)  # fmt: skip
def test_client_is_named_after_its_user_agent(user_agent: str, name: str) -> None:
    assert client_name(user_agent) == name


@pytest.mark.parametrize(
    ("user_agent", "device"),
    [
        (
            "Mozilla/5.0 (iPad; CPU OS 17_0 like Mac OS X) AppleWebKit/605.1.15 Version/17.0 Safari/604.1",
            "tablet",
        ),
        (
            "Mozilla/5.0 (iPhone; CPU iPhone OS 17_0 like Mac OS X) Version/17.0 Mobile/15E148 Safari/604.1",
            "phone",
        ),
        (
            "Mozilla/5.0 (Linux; Android 14; SM-X200) AppleWebKit/537.36 Chrome/140.0.0.0 Safari/537.36",
            "tablet",
        ),
        ("Mozilla/5.0 (Linux; Android 14; Pixel 8) Chrome/140.0.0.0 Mobile Safari/537.36", "phone"),
        ("Mozilla/5.0 (X11; Linux x86_64) Chrome/140.0.0.0 Safari/537.36", ""),
        ("", ""),
    ],
)
def test_device_kind_is_detected_from_the_user_agent(user_agent: str, device: str) -> None:
    assert device_kind(user_agent) == device
