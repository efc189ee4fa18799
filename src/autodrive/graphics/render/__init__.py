"""The scene that cameras see, and the renderer that draws it."""
