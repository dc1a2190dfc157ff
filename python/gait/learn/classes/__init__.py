"""Classes of motion in one model: walking, standing, walking backwards, running, and any other cycle."""
