"""Recordings as cycles: the steady part, its period and verdict, the common phase, the cycles themselves."""
