"""From recordings to cycles: steady part, period, verdict, common phase, cutting."""
