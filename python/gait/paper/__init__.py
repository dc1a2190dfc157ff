"""Every figure and experiment of the two papers by their own algorithms, beside those of this package."""
