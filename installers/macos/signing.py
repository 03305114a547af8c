"""Signing and notarising with the owner's identity; without an identity the package is for tests only.

NEP_MACOS_IDENTITY        the certificate: "Developer ID Application: Ana Pérez (ABCDE12345)"
NEP_MACOS_NOTARY_PROFILE  a profile stored by `xcrun notarytool store-credentials`; or these three:
NEP_MACOS_NOTARY_KEY      the file of an App Store Connect key (.p8)
NEP_MACOS_NOTARY_KEY_ID   the id of the key
NEP_MACOS_NOTARY_ISSUER   the id of the key's issuer
"""

from __future__ import annotations

import itertools
import json
import plistlib
import subprocess
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from installers.context import Context, PackageError
from installers.macos import entitlements
from installers.macos.layout import WEB_PROCESS, binaries, is_bundle
from installers.macos.mach_o import read

__all__ = [
    "AD_HOC",
    "Identity",
    "Piece",
    "assess",
    "identity_of",
    "notarise",
    "pieces",
    "sign",
    "sign_image",
    "verify",
]

AD_HOC = "-"
"""Ad hoc identity of codesign: the minimum for a program to start on Apple silicon."""
_MAX_PATHS_PER_COMMAND = 50
_KEY_PARTS = ("NEP_MACOS_NOTARY_KEY", "NEP_MACOS_NOTARY_KEY_ID", "NEP_MACOS_NOTARY_ISSUER")


@dataclass(frozen=True)
class Identity:
    """Signing identity and credentials for notarisation."""

    name: str
    notary: tuple[str, ...] = ()
    """Credential arguments for notarytool; empty to skip notarisation."""

    @property
    def is_known(self) -> bool:
        """True for a Developer ID certificate, False for the ad hoc identity."""
        return self.name != AD_HOC


@dataclass(frozen=True)
class Piece:
    """File or bundle that is signed separately."""

    path: Path
    entitlements_kind: str = ""
    """Entitlements: "studio", "web", or "" for none."""


def identity_of(environ: Mapping[str, str]) -> Identity:
    """Return the identity from environment variables (see the module's documentation).

    Without any of them, this is the ad hoc identity.

    Raises:
        PackageError: Only some of the required variables are set.
    """
    name, profile = environ.get("NEP_MACOS_IDENTITY", ""), environ.get("NEP_MACOS_NOTARY_PROFILE", "")
    key_parts = [part for part in _KEY_PARTS if environ.get(part)]
    if key_parts and len(key_parts) < len(_KEY_PARTS):
        missing = ", ".join(part for part in _KEY_PARTS if part not in key_parts)
        raise PackageError(f"to notarise with a key, set also {missing}")
    if not name:
        if profile or key_parts:
            raise PackageError("an unsigned package can't be notarised; set also NEP_MACOS_IDENTITY")
        return Identity(AD_HOC)
    if profile:
        return Identity(name, ("--keychain-profile", profile))
    if key_parts:
        key, key_id, issuer = (environ[part] for part in _KEY_PARTS)
        return Identity(name, ("--key", key, "--key-id", key_id, "--issuer", issuer))
    return Identity(name)


def pieces(app: Path) -> list[Piece]:
    """Return all files and bundles to be signed; the contents of a bundle come before the bundle."""
    programs = {app / "Contents" / "MacOS"}
    bundles = [path for path in sorted(app.rglob("*")) if is_bundle(path)]
    main_binaries = {_main_binary(bundle) for bundle in (app, *bundles)}
    inner_pieces = [
        Piece(path, "studio" if path.parent in programs and _is_program(path) else "")
        for path in binaries(app)
        if path not in main_binaries
    ]
    inner_pieces += [
        Piece(_signed_path(bundle), "web" if bundle.name == WEB_PROCESS else "") for bundle in bundles
    ]
    inner_pieces.sort(
        key=lambda piece: (-len(piece.path.parts), bool(piece.entitlements_kind), str(piece.path))
    )
    return [*inner_pieces, Piece(app, "studio")]


def sign(context: Context, app: Path, identity: Identity) -> None:
    """Sign the application and everything in it, replacing signatures.

    Raises:
        PackageError: codesign has failed.
    """
    context.work.mkdir(parents=True, exist_ok=True)
    allowed = {
        "studio": entitlements.write(context.work / "studio.entitlements", entitlements.STUDIO),
        "web": entitlements.write(context.work / "web-process.entitlements", entitlements.WEB_PROCESS),
    }
    for kind, group in itertools.groupby(pieces(app), lambda piece: piece.entitlements_kind):
        extra = ("--entitlements", str(allowed[kind])) if kind else ()
        paths = [piece.path for piece in group]
        for start in range(0, len(paths), _MAX_PATHS_PER_COMMAND):
            context.run(
                "codesign",
                *_codesign_options(identity),
                *extra,
                *paths[start : start + _MAX_PATHS_PER_COMMAND],
            )


def sign_image(context: Context, image: Path, identity: Identity) -> None:
    """Sign a disk image, unless the identity is ad hoc; raises `PackageError`."""
    if identity.is_known:
        context.run("codesign", "--force", "--sign", identity.name, "--timestamp", image)


def notarise(context: Context, path: Path, identity: Identity) -> None:
    """Have Apple notarise an application or disk image and staple the ticket to it. Takes minutes.

    Raises:
        PackageError: A command has failed, or Apple rejected the file; the text then contains Apple's
            findings.
    """
    submitted = path
    if path.suffix == ".app":
        submitted = context.work / f"{path.stem}.zip"
        context.run("ditto", "-c", "-k", "--keepParent", path, submitted)
    submit = ("xcrun", "notarytool", "submit", str(submitted), *identity.notary)
    output = _output_of(context, *submit, "--wait", "--output-format", "json")
    try:
        result = json.loads(output)
    except ValueError:
        raise PackageError(f"notarytool returned invalid JSON: {output.strip()}") from None
    if result.get("status") != "Accepted":
        log = _output_of(context, "xcrun", "notarytool", "log", str(result.get("id", "")), *identity.notary)
        raise PackageError(f"Apple rejected '{path.name}' ({result.get('status')}): {log.strip()}")
    context.run("xcrun", "stapler", "staple", path)
    context.run("xcrun", "stapler", "validate", path)


def verify(context: Context, app: Path) -> None:
    """Verify all signatures of an application; raises `PackageError`."""
    context.run("codesign", "--verify", "--deep", "--strict", "--verbose=2", app)


def assess(context: Context, path: Path) -> None:
    """Check that Gatekeeper accepts a notarised file; raises `PackageError`."""
    type_options = (
        ("execute",) if path.suffix == ".app" else ("open", "--context", "context:primary-signature")
    )
    context.run("spctl", "--assess", "--type", *type_options, "--verbose=2", path)


def _codesign_options(identity: Identity) -> Iterator[str]:
    yield from ("--force", "--sign", identity.name)
    # The hardened runtime's library validation rejects ad hoc signatures.
    yield from ("--options", "runtime", "--timestamp") if identity.is_known else ("--timestamp=none",)


def _output_of(context: Context, *command: str) -> str:
    try:
        completed = subprocess.run(
            command, cwd=context.root, env=dict(context.environ), capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise PackageError(f"'{command[0]}' can't be run: {error.strerror}") from error
    if completed.returncode != 0:
        raise PackageError(
            f"'{' '.join(command[:3])}' exited with {completed.returncode}: {completed.stderr.strip()}"
        )
    return completed.stdout


def _is_program(path: Path) -> bool:
    return any(each.is_program for each in read(path))


def _main_binary(bundle: Path) -> Path:
    # The executable or library whose signature is that of the bundle.
    if bundle.suffix == ".framework":
        return _signed_path(bundle) / bundle.stem
    try:
        info = plistlib.loads((bundle / "Contents" / "Info.plist").read_bytes())
    except (OSError, ValueError, plistlib.InvalidFileException) as error:
        raise PackageError(f"the Info.plist of '{bundle.name}' can't be read: {error}") from error
    return bundle / "Contents" / "MacOS" / str(info.get("CFBundleExecutable", bundle.stem))


def _signed_path(bundle: Path) -> Path:
    # codesign expects the version folder of a framework.
    versions = bundle / "Versions"
    return versions / (versions / "Current").readlink() if bundle.suffix == ".framework" else bundle
