"""Tests of signing and notarisation: order and options, recorded by fake tools."""

from __future__ import annotations

import plistlib
import sys
from pathlib import Path

import pytest

from installers.context import PackageError
from installers.macos import packer, signing
from installers.macos.entitlements import STUDIO, WEB_PROCESS
from tests.installers.macos.made_up_app import ICON, calls, context, framework, made_up_app, noting_tools, put

NAME = "Developer ID Application: Ana Pérez (ABCDE12345)"
KEY = {
    "NEP_MACOS_NOTARY_KEY": "/keys/AuthKey.p8",
    "NEP_MACOS_NOTARY_KEY_ID": "2X9R4HXF34",
    "NEP_MACOS_NOTARY_ISSUER": "57246542-96fe",
}
QT = "Contents/Frameworks/PySide6/Qt/lib/"
WEB = f"{QT}QtWebEngineCore.framework/Versions/A"
PROCESS = f"{WEB}/Helpers/QtWebEngineProcess.app"

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="its tools are scripts of a Unix")


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    log = noting_tools(tmp_path / "tools", sys.executable)
    monkeypatch.setenv("PATH", str(log.parent))
    return log


def finished(folder: Path, identity: signing.Identity) -> Path:
    made = context(folder)
    app = made_up_app(folder)
    put(made.work / "pictures" / "behaviour.icns", ICON)
    packer.finish(made, app, identity)
    return app


def signed(log: Path, app: Path) -> list[tuple[str, str]]:
    """Return the signed paths in order, each with the name of its entitlements file or an empty text."""
    found = []
    for name, *words in calls(log):
        if name == "codesign" and "--sign" in words:
            allowed = words.index("--entitlements") if "--entitlements" in words else None
            with_ = Path(words[allowed + 1]).name if allowed is not None else ""
            found += [
                (str(Path(each).relative_to(app)), with_) for each in words if each.startswith(str(app))
            ]
    return found


def test_all_code_is_signed_once_from_the_inside_out(tmp_path: Path, tools: Path) -> None:
    app = finished(tmp_path, signing.Identity(NAME))
    found = signed(tools, app)
    places = [path for path, _allowed in found]
    assert sorted(places) == sorted(
        [
            ".",
            "Contents/MacOS/nep",
            "Contents/Frameworks/libpython3.13.dylib",
            "Contents/Frameworks/numpy/__dot__dylibs/libopenblas.dylib",
            f"{QT}QtCore.framework/Versions/A",
            PROCESS,
            WEB,
        ]
    )
    for inner, outer in ((PROCESS, WEB), (WEB, "."), (f"{QT}QtCore.framework/Versions/A", ".")):
        assert places.index(inner) < places.index(outer)
    assert places[-1] == "."
    assert dict(found) == {
        **dict.fromkeys(places, ""),
        ".": "studio.entitlements",
        "Contents/MacOS/nep": "studio.entitlements",
        PROCESS: "web-process.entitlements",
    }


def test_deeper_items_are_signed_first_in_nested_bundles(tmp_path: Path) -> None:
    app = made_up_app(tmp_path)
    web = app / WEB
    inner = framework(web / "Frameworks", "Inner")
    loose = put(web / "Libraries" / "libEGL.dylib", (web / "QtWebEngineCore").read_bytes(), 0o755)
    order = [piece.path for piece in signing.pieces(app)]
    assert order.index(inner / "Versions" / "A") < order.index(web)
    assert order.index(loose) < order.index(web)
    assert len(order) == len(set(order))


def test_signing_identity_enables_hardened_runtime_and_timestamp(tmp_path: Path, tools: Path) -> None:
    finished(tmp_path, signing.Identity(NAME))
    for name, *words in calls(tools):
        if name == "codesign" and "--sign" in words:
            assert words[:6] == ["--force", "--sign", NAME, "--options", "runtime", "--timestamp"]
            assert "--deep" not in words  # --deep would give Studio's entitlements to all nested code


def test_ad_hoc_signing_without_identity_is_reported(
    tmp_path: Path, tools: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    app = finished(tmp_path, signing.identity_of({}))
    assert signed(tools, app)[-1] == (".", "studio.entitlements")
    for name, *words in calls(tools):
        assert name == "codesign"
        assert words[:4] == ["--force", "--sign", "-", "--timestamp=none"] or words[0] == "--verify"
    assert capsys.readouterr().out == (
        "· signing and notarisation skipped: NEP_MACOS_IDENTITY is not set (installers/README.md)\n"
    )


def test_skipped_notarisation_is_reported(
    tmp_path: Path, tools: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    finished(tmp_path, signing.identity_of({"NEP_MACOS_IDENTITY": NAME}))
    assert {name for name, *_words in calls(tools)} == {"codesign"}
    said = capsys.readouterr().out
    assert said == "· notarisation skipped: NEP_MACOS_NOTARY_PROFILE is not set (installers/README.md)\n"


def test_application_is_verified_notarised_stapled_and_assessed_by_gatekeeper(
    tmp_path: Path, tools: Path
) -> None:
    app = finished(tmp_path, signing.identity_of({"NEP_MACOS_IDENTITY": NAME, **KEY}))
    sent = str(context(tmp_path).work / "NEP Studio.zip")
    key = ["--key", "/keys/AuthKey.p8", "--key-id", "2X9R4HXF34", "--issuer", "57246542-96fe"]
    after = [call for call in calls(tools) if "--sign" not in call]
    assert after == [
        ["codesign", "--verify", "--deep", "--strict", "--verbose=2", str(app)],
        ["ditto", "-c", "-k", "--keepParent", str(app), sent],
        ["xcrun", "notarytool", "submit", sent, *key, "--wait", "--output-format", "json"],
        ["xcrun", "stapler", "staple", str(app)],
        ["xcrun", "stapler", "validate", str(app)],
        ["spctl", "--assess", "--type", "execute", "--verbose=2", str(app)],
    ]


def test_disk_image_is_signed_notarised_and_assessed(tmp_path: Path, tools: Path) -> None:
    image, made = put(tmp_path / "NEP-Studio.dmg"), context(tmp_path)
    identity = signing.identity_of({"NEP_MACOS_IDENTITY": NAME, "NEP_MACOS_NOTARY_PROFILE": "school"})
    signing.sign_image(made, image, identity)
    signing.notarise(made, image, identity)
    signing.assess(made, image)
    profile = ["--keychain-profile", "school"]
    assert calls(tools) == [
        ["codesign", "--force", "--sign", NAME, "--timestamp", str(image)],
        ["xcrun", "notarytool", "submit", str(image), *profile, "--wait", "--output-format", "json"],
        ["xcrun", "stapler", "staple", str(image)],
        ["xcrun", "stapler", "validate", str(image)],
        ["spctl", "--assess", "--type", "open", "--context", "context:primary-signature", "--verbose=2",
         str(image)],
    ]  # fmt: skip


def test_disk_image_is_not_signed_without_an_identity(tmp_path: Path, tools: Path) -> None:
    signing.sign_image(context(tmp_path), put(tmp_path / "a.dmg"), signing.identity_of({}))
    assert calls(tools) == []


def test_rejected_notarisation_is_reported_and_nothing_is_stapled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = noting_tools(tmp_path / "tools", sys.executable, status="Invalid")
    monkeypatch.setenv("PATH", str(log.parent))
    identity = signing.Identity(NAME, ("--keychain-profile", "school"))
    with pytest.raises(PackageError) as caught:
        signing.notarise(context(tmp_path), put(tmp_path / "a.dmg"), identity)
    assert str(caught.value) == "Apple rejected 'a.dmg' (Invalid): the signature has no secure time stamp"
    assert [call[1:3] for call in calls(log)] == [["notarytool", "submit"], ["notarytool", "log"]]


def test_failed_signing_aborts_packaging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = noting_tools(tmp_path / "tools", sys.executable, fails="codesign")
    monkeypatch.setenv("PATH", str(log.parent))
    with pytest.raises(PackageError, match="'codesign' exited with 3"):
        finished(tmp_path, signing.Identity(NAME, ("--keychain-profile", "school")))
    assert [call[0] for call in calls(log)] == ["codesign"]


def test_failed_notary_submission_aborts_packaging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log = noting_tools(tmp_path / "tools", sys.executable, fails="xcrun")
    monkeypatch.setenv("PATH", str(log.parent))
    with pytest.raises(PackageError, match="'xcrun notarytool submit' exited with 3"):
        signing.notarise(context(tmp_path), put(tmp_path / "a.dmg"), signing.Identity(NAME, ("--key", "k")))


def test_application_with_layout_errors_is_not_signed(tmp_path: Path, tools: Path) -> None:
    made, app = context(tmp_path), made_up_app(tmp_path)
    put(made.work / "pictures" / "behaviour.icns", ICON)
    put(app / "Contents" / "Frameworks" / "notes.txt")
    with pytest.raises(PackageError, match=r"notes\.txt is not code"):
        packer.finish(made, app, signing.Identity(NAME))
    assert calls(tools) == []


@pytest.mark.parametrize(
    ("environ", "said"),
    [
        ({"NEP_MACOS_NOTARY_PROFILE": "school"}, "set also NEP_MACOS_IDENTITY"),
        (KEY, "set also NEP_MACOS_IDENTITY"),
        (
            {"NEP_MACOS_IDENTITY": NAME, "NEP_MACOS_NOTARY_KEY": "k"},
            "set also NEP_MACOS_NOTARY_KEY_ID, NEP_MACOS_NOTARY_ISSUER",
        ),
    ],
)
def test_incomplete_signing_identity_raises(environ: dict[str, str], said: str) -> None:
    with pytest.raises(PackageError, match=said):
        signing.identity_of(environ)


def test_entitlement_files_contain_the_entitlements_of_studio_and_its_web_process(
    tmp_path: Path, tools: Path
) -> None:
    finished(tmp_path, signing.Identity(NAME))
    work = context(tmp_path).work
    for name, allowed in (("studio", STUDIO), ("web-process", WEB_PROCESS)):
        assert plistlib.loads((work / f"{name}.entitlements").read_bytes()) == dict.fromkeys(allowed, True)
