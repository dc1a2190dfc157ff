"""Files of a run: finding them, whose they are, and their preparation in processes or on a cluster."""
