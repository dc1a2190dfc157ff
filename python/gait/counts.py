"""Counts with their nouns, for sentences."""

from __future__ import annotations


def count_of(count: int, what: str) -> str:
    """Return a count with its noun, in the plural if needed; the plural only adds an s."""
    return f"{count} {what}{'' if count == 1 else 's'}"
