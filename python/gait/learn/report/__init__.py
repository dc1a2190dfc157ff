"""The report of a learnt model: figures and one page."""
