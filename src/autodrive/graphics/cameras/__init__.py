"""Cameras of a world and scene cameras of clients: when an image is due, where it is drawn, JPEG."""
