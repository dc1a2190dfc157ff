"""What `gait learn` makes its cyclic model with."""

DEFAULT_COMPONENTS = 8
MOST_COMPONENTS = 16  # the library reads no more
PRIORS = ("people", "paper")
