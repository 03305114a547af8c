"""Tests of the selection of software rendering on computers without a GPU."""

from __future__ import annotations

import sys

import pytest

from app.ui.startup import graphics


@pytest.mark.parametrize(
    ("given", "has_one", "wanted", "is_so"),
    [
        ({}, False, {graphics.BACKEND_VARIABLE: "software"}, True),
        ({}, True, {}, False),
        ({graphics.BACKEND_VARIABLE: ""}, False, {graphics.BACKEND_VARIABLE: "software"}, True),
        ({graphics.BACKEND_VARIABLE: "rhi"}, False, {graphics.BACKEND_VARIABLE: "rhi"}, False),
        ({graphics.BACKEND_VARIABLE: "software"}, True, {graphics.BACKEND_VARIABLE: "software"}, True),
    ],
)
def test_software_rendering_is_selected_without_a_gpu_unless_set_by_the_user(
    given, has_one, wanted, is_so
) -> None:
    environ = dict(given)
    assert graphics.use_software_renderer(environ, "linux", lambda _platform: has_one) is is_so
    assert environ == wanted


def test_linux_gpu_is_detected_by_its_render_device(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(graphics, "GPU_DEVICE_PATTERNS", (str(tmp_path / "renderD*"),))
    assert not graphics.has_graphics_processor("linux")
    (tmp_path / "card0").touch()  # a display device without a renderer
    assert not graphics.has_graphics_processor("linux")
    (tmp_path / "renderD128").touch()
    assert graphics.has_graphics_processor("linux")


def test_windows_basic_display_adapter_is_not_a_gpu_driver() -> None:
    assert not graphics.has_driver(["Microsoft Basic Display Adapter"])
    assert graphics.has_driver(["Microsoft Basic Display Adapter", "Intel(R) UHD Graphics 620"])
    assert graphics.has_driver([])
    assert graphics.has_graphics_processor("darwin")


@pytest.mark.skipif(sys.platform != "win32", reason="Windows tells it")
def test_windows_display_adapters_are_listed() -> None:
    assert graphics.adapters()
