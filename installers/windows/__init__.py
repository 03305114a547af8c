"""Packages for Windows: installer and portable zip, built on Windows or with Wine."""
