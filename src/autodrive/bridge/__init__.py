"""Bridges carry Frames out to users' programs and bring their Commands in."""
