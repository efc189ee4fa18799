"""Assets: named nodes with surfaces, materials and textures, and their files (glTF, PNG)."""
