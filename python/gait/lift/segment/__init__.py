"""Single segments by the C library, and the views they are seen in."""
