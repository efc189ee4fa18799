"""What cameras and people see: assets, meshes, the renderer, camera processes."""
