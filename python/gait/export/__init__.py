"""Export motion to other tools' formats: one module per format, and `motion` for their common input."""
