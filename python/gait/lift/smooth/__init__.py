"""A whole sequence: one Gaussian over overlapping segments, or the segments blended."""
