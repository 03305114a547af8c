"""Info.plist of the application and its localised texts."""

from __future__ import annotations

import plistlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.core.projects.file_format import SUFFIX

__all__ = [
    "APP_ICON",
    "BUNDLE_ID",
    "DOCUMENTED_KEYS",
    "DOCUMENT_ICON",
    "LANGUAGES",
    "OLDEST_MACOS",
    "PROGRAM",
    "apple_version",
    "documentation_url",
    "information",
    "localised_texts",
    "write_info_plist",
    "write_localised_texts",
]

BUNDLE_ID = "org.nep.studio"
PROGRAM = "nep-studio"
OLDEST_MACOS: Mapping[str, str] = {"arm64": "13.0", "x86_64": "13.0"}
"""Oldest macOS by processor, as required by Qt 6.11 and OpenCV (4.12 for Intel, no newer)."""
APP_ICON, DOCUMENT_ICON = "nep-studio.icns", "behaviour.icns"
LANGUAGES = ("en", "es", "fr", "ja")

_BEHAVIOUR = f"{BUNDLE_ID}.behaviour"
_BEHAVIOUR_TYPE_NAME, _RECORDING_TYPE_NAME = "Robot behaviour", "Recording of messages"
_LOCALISED_TEXTS: Mapping[str, tuple[str, str, str, str]] = {
    "NSLocalNetworkUsageDescription": (
        "NEP Studio finds robots and their programs on your network and exchanges messages with them.",
        "NEP Studio busca robots y sus programas en tu red e intercambia mensajes con ellos.",
        "NEP Studio recherche les robots et leurs programmes sur votre réseau et communique avec eux.",
        "NEP Studioは、ネットワーク上のロボットとそのプログラムを見つけ、メッセージをやり取りします。",
    ),
    "NSCameraUsageDescription": (
        "A program that you started with NEP Studio wants to use the camera of this computer.",
        "Un programa que iniciaste con NEP Studio quiere usar la cámara de esta computadora.",
        "Un programme que vous avez lancé avec NEP Studio souhaite utiliser la caméra de cet ordinateur.",
        "NEP Studioで起動したプログラムが、このコンピューターのカメラを使おうとしています。",
    ),
    "NSMicrophoneUsageDescription": (
        "A program that you started with NEP Studio wants to use the microphone of this computer.",
        "Un programa que iniciaste con NEP Studio quiere usar el micrófono de esta computadora.",
        "Un programme que vous avez lancé avec NEP Studio souhaite utiliser le micro de cet ordinateur.",
        "NEP Studioで起動したプログラムが、このコンピューターのマイクを使おうとしています。",
    ),
    "NSDocumentsFolderUsageDescription": (
        "NEP Studio opens and saves your behaviours in this folder.",
        "NEP Studio abre y guarda tus comportamientos en esta carpeta.",
        "NEP Studio ouvre et enregistre vos comportements dans ce dossier.",
        "NEP Studioは、このフォルダーでふるまいを開き、保存します。",
    ),
    "NSDesktopFolderUsageDescription": (
        "NEP Studio opens and saves your behaviours on the desktop.",
        "NEP Studio abre y guarda tus comportamientos en el escritorio.",
        "NEP Studio ouvre et enregistre vos comportements sur le bureau.",
        "NEP Studioは、デスクトップでふるまいを開き、保存します。",
    ),
    "NSDownloadsFolderUsageDescription": (
        "NEP Studio opens and saves your behaviours in this folder.",
        "NEP Studio abre y guarda tus comportamientos en esta carpeta.",
        "NEP Studio ouvre et enregistre vos comportements dans ce dossier.",
        "NEP Studioは、このフォルダーでふるまいを開き、保存します。",
    ),
    _BEHAVIOUR_TYPE_NAME: (
        _BEHAVIOUR_TYPE_NAME, "Comportamiento de robot", "Comportement de robot", "ロボットのふるまい",
    ),
    _RECORDING_TYPE_NAME: (
        _RECORDING_TYPE_NAME, "Grabación de mensajes", "Enregistrement de messages", "メッセージの記録",
    ),
}  # fmt: skip
"""Texts shown by macOS in the order of `LANGUAGES`. Document types are keyed by their English names.

Studio uses neither camera nor microphone, but its libraries can. macOS terminates a program that
requests access without such a text; with the text but without the entitlement, access is denied
silently. There is no text for Apple events, because Studio sends none.
"""

_TYPE_KEYS = frozenset(
    {
        "UTTypeConformsTo", "UTTypeDescription", "UTTypeIconFile", "UTTypeIdentifier",
        "UTTypeTagSpecification",
    }
)  # fmt: skip
DOCUMENTED_KEYS = frozenset(
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
"""Keys of Info.plist that the package uses and Apple documents (`documentation_url`, as of November 2026)."""
_DOCUMENTED_SUBKEYS: Mapping[str, frozenset[str]] = {
    "CFBundleDocumentTypes": frozenset(
        {
            "CFBundleTypeIconFile", "CFBundleTypeName", "CFBundleTypeRole", "LSHandlerRank",
            "LSItemContentTypes",
        }
    ),
    "UTExportedTypeDeclarations": _TYPE_KEYS,
    "UTImportedTypeDeclarations": _TYPE_KEYS,
}  # fmt: skip
_DOCUMENTATION_URL = "https://developer.apple.com/documentation/bundleresources/information-property-list/"


def apple_version(version: str) -> str:
    """Return a version as up to three numbers, as macOS requires: "0.2.0" for "0.2.0rc1".

    Raises ValueError if the version doesn't start with a number.
    """
    match = re.match(r"\d+(?:\.\d+){0,2}", version)
    if match is None:
        raise ValueError(f"invalid version '{version}'")
    return match.group()


def documentation_url(key: str, within: str = "") -> str:
    """Return the URL of Apple's page about a key of Info.plist.

    Args:
        key: The key.
        within: Key of the dictionary that contains `key`; "" for the top level.

    Raises:
        KeyError: The key isn't documented.
    """
    if key not in (_DOCUMENTED_SUBKEYS[within] if within else DOCUMENTED_KEYS):
        raise KeyError(key)
    return _DOCUMENTATION_URL + "/".join(each.lower() for each in (within, key) if each)


def localised_texts(language: str) -> dict[str, str]:
    """Return the texts in one of `LANGUAGES` by their keys in InfoPlist.strings."""
    index = LANGUAGES.index(language)
    return {key: texts[index] for key, texts in _LOCALISED_TEXTS.items()}


def information(version: str, machine: str) -> dict[str, Any]:
    """Return the content of Info.plist for a processor.

    Studio's own type is exported, types of other programs are imported. All conform to `public.data`:
    https://developer.apple.com/documentation/uniformtypeidentifiers/defining-file-and-data-types-for-your-app
    (`public.json` does: https://developer.apple.com/documentation/uniformtypeidentifiers/uttypejson).
    Recordings (.mcap) are declared so that the Finder shows a name for the type, which has no official
    identifier. Studio isn't registered as an application that opens recordings.

    Args:
        version: Version of Studio.
        machine: Processor, "arm64" or "x86_64".

    Raises:
        KeyError: The processor isn't supported.
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
        # PyInstaller sets it for an application that also contains a console program.
        "LSBackgroundOnly": False,
        "LSMinimumSystemVersion": OLDEST_MACOS[machine],
        "NSHighResolutionCapable": True,
        "NSPrincipalClass": "NSApplication",
        "NSSupportsAutomaticGraphicsSwitching": True,
        **{key: texts[0] for key, texts in _LOCALISED_TEXTS.items() if key.endswith("UsageDescription")},
        "CFBundleDocumentTypes": [
            {
                "CFBundleTypeName": _BEHAVIOUR_TYPE_NAME,
                "CFBundleTypeRole": "Editor",
                "CFBundleTypeIconFile": DOCUMENT_ICON,
                "LSHandlerRank": "Owner",
                "LSItemContentTypes": [_BEHAVIOUR],
            }
        ],
        "UTExportedTypeDeclarations": [
            {
                "UTTypeIdentifier": _BEHAVIOUR,
                "UTTypeDescription": _BEHAVIOUR_TYPE_NAME,
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
                "UTTypeDescription": _RECORDING_TYPE_NAME,
                "UTTypeConformsTo": ["public.data"],
                "UTTypeTagSpecification": {"public.filename-extension": ["mcap"]},
            }
        ],
    }


def write_info_plist(path: Path, version: str, machine: str) -> Path:
    """Write Info.plist to `path` and return the path."""
    path.write_bytes(plistlib.dumps(information(version, machine)))
    return path


def write_localised_texts(resources: Path) -> None:
    """Write InfoPlist.strings for each language into the application's Resources."""
    for language in LANGUAGES:
        folder = resources / f"{language}.lproj"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "InfoPlist.strings").write_bytes(plistlib.dumps(localised_texts(language)))
