"""Files of a run: find them, identify subjects, and prepare them in processes or on a cluster."""
