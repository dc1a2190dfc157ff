"""Version of the package, which is that of libgait/include/gait.h."""

__version__ = "0.1.0"
