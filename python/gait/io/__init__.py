"""Files: common parts of readers and writers, and formats that do not depend on walking."""
