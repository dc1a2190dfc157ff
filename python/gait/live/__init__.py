"""The live page: watch a running tracker in browsers on this machine.

`feed` receives estimates and frames from LCM, `server` sends them to browsers, and `recording` writes all
messages to logs.
"""
