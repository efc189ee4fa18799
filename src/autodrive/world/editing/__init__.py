"""Edits of the scenario of a running World: objects, poses and sensors, with undo and redo."""
