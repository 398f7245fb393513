"""A software pipeline: vertex, raster, fragment, stencil and depth stages. Knows nothing of rays."""
