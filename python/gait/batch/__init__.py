"""Process the clips of a project file."""
