"""Every figure and experiment of the two papers, by their algorithms and by those of this package."""
