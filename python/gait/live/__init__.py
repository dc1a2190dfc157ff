"""The live page: a running tracker watched in browsers on this machine.

`feed` takes estimates and frames from LCM, `server` hands them to browsers, `recording` keeps what the
channels carry in a log.
"""
