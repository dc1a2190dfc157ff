"""Files of a run: finding them, identifying subjects, and preparing them in processes or on a cluster."""
