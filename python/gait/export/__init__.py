"""Motion in the formats of other tools: one module for each format, `motion` for what all of them need."""
