"""Learn the segment prior: virtual markers, segments of a corpus, their Gaussian, sections of the blob."""
