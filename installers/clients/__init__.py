"""Packages of nep for JavaScript, C# and Unity."""
