"""Many clips by one project file."""
