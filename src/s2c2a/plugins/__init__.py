"""Plug-ins: what is found by name here, in other packages or in files of users."""

from s2c2a.plugins.discovery import trust_code

__all__ = ["trust_code"]
