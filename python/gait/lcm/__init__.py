"""Streaming over LCM (package ``gaitmsg``): send frames to `gait-trackd`, receive its estimates."""

from gait.lcm.link import DEFAULT_URL, gaitmsg, lcm_url, open_lcm

__all__ = ["DEFAULT_URL", "gaitmsg", "lcm_url", "open_lcm"]
