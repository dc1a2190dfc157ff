"""Learn how people walk from motion capture and track them in calibrated video."""
