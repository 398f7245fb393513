"""Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA (Toczek, Houzet and Mancini 2010)."""
