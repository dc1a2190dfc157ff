"""The report of a learned model: figures and one page."""
