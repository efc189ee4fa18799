"""Vehicle dynamics: the wheel model, the compiled substep loop, and the engine that moves rigid bodies."""
