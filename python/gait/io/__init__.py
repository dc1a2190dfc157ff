"""Files: what all readers and writers share, and the formats that know nothing of walking."""
