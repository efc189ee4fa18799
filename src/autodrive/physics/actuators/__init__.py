"""Actuators: steering, drivetrain, lights. Each module contains the Spec of a part and its behaviour."""
