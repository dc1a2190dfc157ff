"""Figures of the segment prior and of lifted motion."""
