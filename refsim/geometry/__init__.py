"""Device functions, one subject a file: vectors, triangles, spheres, cones, optics."""
