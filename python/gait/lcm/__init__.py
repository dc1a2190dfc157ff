"""Streaming over LCM (package ``gaitmsg``): frames out, estimates in.  `gait-trackd` is in between."""

from gait.lcm.link import DEFAULT_URL, gaitmsg, lcm_url, open_lcm

__all__ = ["DEFAULT_URL", "gaitmsg", "lcm_url", "open_lcm"]
