"""Names of the models in the package."""

from __future__ import annotations

#: The default; that of Ormoneit and others (2000), for paper mode; one with the motion classes walking,
#: standing, walking backwards and running, from several laboratories.
WALK, PAPER, CLASSES = SHIPPED = "walk", "paper", "classes"
