"""Motion, true or tracked: footfalls, gait parameters, and errors against the truth."""
