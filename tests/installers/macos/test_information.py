"""Tests of the application's Info.plist."""

from __future__ import annotations

import plistlib
import re
from pathlib import Path

import pytest

import nep
from app.core.projects.file_format import SUFFIX
from installers.macos.information import (
    DOCUMENTED_KEYS,
    LANGUAGES,
    apple_version,
    documentation_url,
    information,
    localised_texts,
    write_info_plist,
    write_localised_texts,
)
from nep.version import __version__


def test_document_type_and_its_editor_are_declared() -> None:
    told = information(__version__, "arm64")
    (exported,) = told["UTExportedTypeDeclarations"]
    (document,) = told["CFBundleDocumentTypes"]
    assert document["LSItemContentTypes"] == [exported["UTTypeIdentifier"]]
    assert document["CFBundleTypeRole"] == "Editor"
    tags = exported["UTTypeTagSpecification"]
    assert tags == {
        "public.filename-extension": [SUFFIX.lstrip(".")],
        "public.mime-type": "application/x-nep-behaviour",
    }


def test_recording_type_is_imported_but_not_claimed_as_document() -> None:
    told = information(__version__, "arm64")
    (recording,) = told["UTImportedTypeDeclarations"]
    assert recording["UTTypeTagSpecification"] == {"public.filename-extension": ["mcap"]}
    opened = [kind for each in told["CFBundleDocumentTypes"] for kind in each["LSItemContentTypes"]]
    assert recording["UTTypeIdentifier"] not in opened


@pytest.mark.parametrize("machine", ["arm64", "x86_64"])
def test_every_plist_key_is_documented_by_apple(machine: str) -> None:
    told = information(__version__, machine)
    assert told.keys() == DOCUMENTED_KEYS, "all that are listed are used, and no others"
    pages = {documentation_url(key) for key in told}
    for within in ("CFBundleDocumentTypes", "UTExportedTypeDeclarations", "UTImportedTypeDeclarations"):
        pages |= {documentation_url(key, within) for each in told[within] for key in each}
    assert all(re.fullmatch(r"https://developer\.apple\.com/documentation/[a-z/-]+", each) for each in pages)
    with pytest.raises(KeyError, match="NSHighResolutionCapabel"):
        documentation_url("NSHighResolutionCapabel")
    with pytest.raises(KeyError, match="UTTypeConformsTo"):
        documentation_url("UTTypeConformsTo", "CFBundleDocumentTypes")


def test_declared_types_conform_to_public_data() -> None:
    told = information(__version__, "arm64")
    kinds = (*told["UTExportedTypeDeclarations"], *told["UTImportedTypeDeclarations"])
    data = {"public.json", "public.data"}  # public.json conforms to public.text, and that to public.data
    assert [kind["UTTypeIdentifier"] for kind in kinds if not data & set(kind["UTTypeConformsTo"])] == []


def test_bundle_version_matches_the_version_of_nep(tmp_path: Path) -> None:
    read = plistlib.loads(write_info_plist(tmp_path / "Info.plist", __version__, "arm64").read_bytes())
    assert read == information(__version__, "arm64")
    assert read["CFBundleShortVersionString"] == read["CFBundleVersion"] == apple_version(__version__)


@pytest.mark.parametrize(
    ("given", "told"),
    [("0.1.0", "0.1.0"), ("1.2", "1.2"), ("0.2.0rc1", "0.2.0"), ("1.2.3.dev4+g12", "1.2.3")],
)
def test_apple_version_has_up_to_three_numbers(given: str, told: str) -> None:
    assert apple_version(given) == told


def test_version_without_a_number_raises() -> None:
    with pytest.raises(ValueError, match="invalid version 'new'"):
        apple_version("new")


def test_application_is_in_the_foreground_and_supports_high_resolution() -> None:
    told = information(__version__, "arm64")
    assert told["LSBackgroundOnly"] is False
    assert told["NSHighResolutionCapable"] is True


@pytest.mark.parametrize(("machine", "oldest"), [("arm64", "13.0"), ("x86_64", "13.0")])
def test_minimum_macos_version_is_declared_for_each_processor(machine: str, oldest: str) -> None:
    assert information(__version__, machine)["LSMinimumSystemVersion"] == oldest


def test_unsupported_processor_raises() -> None:
    with pytest.raises(KeyError, match="ppc"):
        information(__version__, "ppc")


def test_every_permission_prompt_has_a_sentence_in_each_language(tmp_path: Path) -> None:
    asked = {key for key in information(__version__, "arm64") if key.endswith("UsageDescription")}
    assert asked >= {
        "NSLocalNetworkUsageDescription",
        "NSCameraUsageDescription",
        "NSMicrophoneUsageDescription",
    }
    write_localised_texts(tmp_path)
    for language in LANGUAGES:
        read = plistlib.loads((tmp_path / f"{language}.lproj" / "InfoPlist.strings").read_bytes())
        assert read == localised_texts(language)
        assert asked <= read.keys()
        for key in asked:
            assert re.fullmatch(r"[^.。]+[.。]", read[key]), read[key]
    english, *others = (localised_texts(language) for language in LANGUAGES)
    for other in others:
        assert english.keys() == other.keys()
        assert all(english[key] != other[key] for key in english)


def test_type_names_have_a_text_in_each_language() -> None:
    told = information(__version__, "arm64")
    for kind in (*told["UTExportedTypeDeclarations"], *told["UTImportedTypeDeclarations"]):
        assert localised_texts("en")[kind["UTTypeDescription"]] == kind["UTTypeDescription"]
        assert all(localised_texts(language)[kind["UTTypeDescription"]] for language in LANGUAGES)


def test_plist_languages_match_those_of_studio() -> None:
    folder = Path(nep.__file__).parent / "locale"
    translated = {each.name for each in folder.iterdir() if (each / "LC_MESSAGES").is_dir()} - {"qps"}
    assert set(LANGUAGES) == {"en", *translated}
