"""Streaming over LCM (package ``gaitmsg``): frames out, estimates in.  `gait-trackd` is in between."""

from gait.lcm.link import DEFAULT_URL, lcm_url, open_lcm
from gait.lcm.types import gaitmsg

__all__ = ["DEFAULT_URL", "gaitmsg", "lcm_url", "open_lcm"]
