from __future__ import annotations

import pytest
from PySide6.QtCore import QByteArray
from PySide6.QtWebEngineCore import QWebEngineUrlScheme

from app import resources
from app.ui.blockly import scheme as blockly_scheme
from app.ui.blockly.scheme import read_content, register_scheme

register_scheme()


def test_registered_scheme_is_secure_and_denies_local_access():
    register_scheme()
    scheme = QWebEngineUrlScheme.schemeByName(QByteArray(b"app"))
    assert scheme.name() == b"app"
    assert scheme.flags() & QWebEngineUrlScheme.Flag.SecureScheme
    assert not scheme.flags() & QWebEngineUrlScheme.Flag.LocalAccessAllowed


def test_scheme_serves_the_editor_bundle():
    kind, data = read_content("/index.html")
    assert kind == "text/html"
    assert b"Content-Security-Policy" in data
    assert read_content("/editor.js")[0] == "text/javascript"
    assert read_content("/msg/en.json")[0] == "application/json"
    assert b"QWebChannel" in read_content("/qwebchannel.js")[1]


@pytest.mark.parametrize(
    "path",
    [
        "/../theme/tokens.json",
        "/fonts/../theme/tokens.json",
        "/nothing.js",
        "/",
        "",
        "/media",
        "//etc/passwd",
    ],
)
def test_scheme_rejects_paths_outside_the_bundle(path):
    assert read_content(path) is None


def test_scheme_serves_the_shipped_fonts():
    kind, css = read_content("/fonts.css")
    assert kind == "text/css"
    for name, weight, kind in (("Inter-SemiBold.otf", 600, "otf"), ("MPLUS1p-Bold.ttf", 700, "ttf")):
        file = resources.path("fonts", name)
        assert f'font-weight:{weight};src:url("fonts/{name}")'.encode() in css
        assert read_content(f"/fonts/{name}") == (f"font/{kind}", file.read_bytes())


def test_missing_fonts_yield_an_empty_stylesheet(tmp_path):
    assert read_content("/fonts.css", tmp_path) == ("text/css", b"")


def test_symlink_out_of_the_bundle_folder_is_not_followed(tmp_path):
    (tmp_path / "blockly").mkdir()
    (tmp_path / "secret.txt").write_text("secret")
    (tmp_path / "blockly" / "link.txt").symlink_to(tmp_path / "secret.txt")
    assert read_content("/link.txt", tmp_path) is None


def test_page_references_no_external_origin():
    page = read_content("/index.html")[1].decode()
    assert "http:" not in page
    assert "https:" not in page
    assert blockly_scheme.PAGE_URL == "app://blocks/index.html"
