"""Estimate a whole sequence: as one Gaussian over overlapping segments, or as blended segments."""
