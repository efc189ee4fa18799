"""What the cameras look at, and the renderer that draws it."""
