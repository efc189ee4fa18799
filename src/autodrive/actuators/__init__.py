"""Actuators: steering, drivetrain, lights. Each file holds a part's Spec and what the part does."""
