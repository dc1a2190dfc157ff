"""Pictures, plots and pages of models, estimates and parameters."""
