"""Files: common parts of readers and writers, and formats that are independent of walking."""
