"""The cyclic model: missing entries, principal components, stride rate, body lengths, blob sections."""
