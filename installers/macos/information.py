"""What the application tells macOS about itself: Info.plist, and its sentences in each language."""

from __future__ import annotations

import plistlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.core.documents.file_format import SUFFIX

__all__ = [
    "APP_ICON",
    "BUNDLE_ID",
    "DOCUMENTED",
    "DOCUMENT_ICON",
    "LANGUAGES",
    "OLDEST_MACOS",
    "PROGRAM",
    "apple_version",
    "information",
    "sentences",
    "source_of",
    "write_information",
    "write_sentences",
]

BUNDLE_ID = "org.nep.studio"
PROGRAM = "nep-studio"
OLDEST_MACOS: Mapping[str, str] = {"arm64": "13.0", "x86_64": "13.0"}
"""The oldest macOS by processor: that for which Qt 6.11 is made, and OpenCV (for Intel 4.12, no newer)."""
APP_ICON, DOCUMENT_ICON = "nep-studio.icns", "behaviour.icns"
LANGUAGES = ("en", "es")

_BEHAVIOUR = f"{BUNDLE_ID}.behaviour"
_BEHAVIOUR_WORDS, _RECORDING_WORDS = "Robot behaviour", "Recording of messages"
_WORDS: Mapping[str, tuple[str, str]] = {
    "NSLocalNetworkUsageDescription": (
        "NEP Studio looks for robots and their programs on your network, and talks with them.",
        "NEP Studio busca robots y sus programas en tu red y habla con ellos.",
    ),
    "NSCameraUsageDescription": (
        "A program that you started with NEP Studio wants to see with the camera of this computer.",
        "Un programa que iniciaste con NEP Studio quiere ver con la cámara de esta computadora.",
    ),
    "NSMicrophoneUsageDescription": (
        "A program that you started with NEP Studio wants to listen with the microphone of this computer.",
        "Un programa que iniciaste con NEP Studio quiere escuchar con el micrófono de esta computadora.",
    ),
    "NSDocumentsFolderUsageDescription": (
        "NEP Studio opens and keeps your behaviours in this folder.",
        "NEP Studio abre y guarda tus comportamientos en esta carpeta.",
    ),
    "NSDesktopFolderUsageDescription": (
        "NEP Studio opens and keeps your behaviours on the desktop.",
        "NEP Studio abre y guarda tus comportamientos en el escritorio.",
    ),
    "NSDownloadsFolderUsageDescription": (
        "NEP Studio opens and keeps your behaviours in this folder.",
        "NEP Studio abre y guarda tus comportamientos en esta carpeta.",
    ),
    _BEHAVIOUR_WORDS: (_BEHAVIOUR_WORDS, "Comportamiento de robot"),
    _RECORDING_WORDS: (_RECORDING_WORDS, "Grabación de mensajes"),
}
"""What a person reads, in the order of `LANGUAGES`. Types of documents are found by their English words.

Studio itself uses no camera and no microphone. Its libraries could, and a program that asks without having
such a sentence is ended by macOS. With it, and without the entitlement, it is refused unasked. Nothing here
sends Apple events, so there is no sentence for them.
"""

_OF_TYPES = frozenset(
    {
        "UTTypeConformsTo", "UTTypeDescription", "UTTypeIconFile", "UTTypeIdentifier",
        "UTTypeTagSpecification",
    }
)  # fmt: skip
DOCUMENTED = frozenset(
    {
        "CFBundleDevelopmentRegion", "CFBundleDisplayName", "CFBundleDocumentTypes", "CFBundleExecutable",
        "CFBundleIconFile", "CFBundleIdentifier", "CFBundleInfoDictionaryVersion", "CFBundleLocalizations",
        "CFBundleName", "CFBundlePackageType", "CFBundleShortVersionString", "CFBundleVersion",
        "LSApplicationCategoryType", "LSBackgroundOnly", "LSMinimumSystemVersion", "NSCameraUsageDescription",
        "NSDesktopFolderUsageDescription", "NSDocumentsFolderUsageDescription",
        "NSDownloadsFolderUsageDescription", "NSHighResolutionCapable", "NSLocalNetworkUsageDescription",
        "NSMicrophoneUsageDescription", "NSPrincipalClass", "NSSupportsAutomaticGraphicsSwitching",
        "UTExportedTypeDeclarations", "UTImportedTypeDeclarations",
    }
)  # fmt: skip
"""The keys of Info.plist that we use, as Apple writes them (`source_of`, November 2026)."""
_DOCUMENTED_WITHIN: Mapping[str, frozenset[str]] = {
    "CFBundleDocumentTypes": frozenset(
        {
            "CFBundleTypeIconFile", "CFBundleTypeName", "CFBundleTypeRole", "LSHandlerRank",
            "LSItemContentTypes",
        }
    ),
    "UTExportedTypeDeclarations": _OF_TYPES,
    "UTImportedTypeDeclarations": _OF_TYPES,
}  # fmt: skip
_PAGES = "https://developer.apple.com/documentation/bundleresources/information-property-list/"


def apple_version(version: str) -> str:
    """The version in up to three numbers, as macOS wants it: "0.2.0" of "0.2.0rc1"."""
    found = re.match(r"\d+(?:\.\d+){0,2}", version)
    if found is None:
        raise ValueError(f"no version '{version}'")
    return found.group()


def source_of(key: str, within: str = "") -> str:
    """Where Apple says what a key of Info.plist, or one of the dictionaries `within` it, means.

    KeyError when it is none that we know to be documented.
    """
    if key not in (_DOCUMENTED_WITHIN[within] if within else DOCUMENTED):
        raise KeyError(key)
    return _PAGES + "/".join(each.lower() for each in (within, key) if each)


def sentences(language: str) -> dict[str, str]:
    """The words of one of `LANGUAGES`, by their keys in InfoPlist.strings."""
    place = LANGUAGES.index(language)
    return {key: words[place] for key, words in _WORDS.items()}


def information(version: str, machine: str) -> dict[str, Any]:
    """The content of Info.plist of the application for a processor; KeyError when there is none for it.

    A type of ours is exported, one that others own imported; either conforms in the end to `public.data`:
    https://developer.apple.com/documentation/uniformtypeidentifiers/defining-file-and-data-types-for-your-app
    (`public.json` does: https://developer.apple.com/documentation/uniformtypeidentifiers/uttypejson).
    Recordings of messages (.mcap) are a type that is known, so that the Finder has a name for them; nobody
    has published an identifier for it. Studio opens none yet, so they are not among the documents it opens.
    """
    return {
        "CFBundleName": "NEP Studio",
        "CFBundleDisplayName": "NEP Studio",
        "CFBundleIdentifier": BUNDLE_ID,
        "CFBundleExecutable": PROGRAM,
        "CFBundleIconFile": APP_ICON,
        "CFBundlePackageType": "APPL",
        "CFBundleInfoDictionaryVersion": "6.0",
        "CFBundleVersion": apple_version(version),
        "CFBundleShortVersionString": apple_version(version),
        "CFBundleDevelopmentRegion": LANGUAGES[0],
        "CFBundleLocalizations": list(LANGUAGES),
        "LSApplicationCategoryType": "public.app-category.education",
        # PyInstaller hides an application beside which there is a program for terminals.
        "LSBackgroundOnly": False,
        "LSMinimumSystemVersion": OLDEST_MACOS[machine],
        "NSHighResolutionCapable": True,
        "NSPrincipalClass": "NSApplication",
        "NSSupportsAutomaticGraphicsSwitching": True,
        **{key: words[0] for key, words in _WORDS.items() if key.endswith("UsageDescription")},
        "CFBundleDocumentTypes": [
            {
                "CFBundleTypeName": _BEHAVIOUR_WORDS,
                "CFBundleTypeRole": "Editor",
                "CFBundleTypeIconFile": DOCUMENT_ICON,
                "LSHandlerRank": "Owner",
                "LSItemContentTypes": [_BEHAVIOUR],
            }
        ],
        "UTExportedTypeDeclarations": [
            {
                "UTTypeIdentifier": _BEHAVIOUR,
                "UTTypeDescription": _BEHAVIOUR_WORDS,
                "UTTypeIconFile": DOCUMENT_ICON,
                "UTTypeConformsTo": ["public.json"],
                "UTTypeTagSpecification": {
                    "public.filename-extension": [SUFFIX.lstrip(".")],
                    "public.mime-type": "application/x-nep-behaviour",
                },
            }
        ],
        "UTImportedTypeDeclarations": [
            {
                "UTTypeIdentifier": f"{BUNDLE_ID}.mcap",
                "UTTypeDescription": _RECORDING_WORDS,
                "UTTypeConformsTo": ["public.data"],
                "UTTypeTagSpecification": {"public.filename-extension": ["mcap"]},
            }
        ],
    }


def write_information(path: Path, version: str, machine: str) -> Path:
    """Write Info.plist."""
    path.write_bytes(plistlib.dumps(information(version, machine)))
    return path


def write_sentences(resources: Path) -> None:
    """Write an InfoPlist.strings of each language into the application's Resources."""
    for language in LANGUAGES:
        folder = resources / f"{language}.lproj"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "InfoPlist.strings").write_bytes(plistlib.dumps(sentences(language)))
