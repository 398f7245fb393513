"""Efficient Stackless Ray Traversal for Bounding Sphere Hierarchies with CUDA (Toczek, Houzet and Mancini 2010).

Where the paper's parts are
    2.1  the list: depth-first array, escape index, payload  `lists`, laid out by `lists_layout`
    2.1  vertices shared by all lists  `shared_vertices`
    2.1  the traversal's pseudo-code  `traversal.walk`; 256 rays together `packet.walk_packets`; a batch `search`
    2.1  partitions of the directions (Figure 2)  `directions`
    2.1  geometry left out  `culling`
    2.2  construction of the hierarchy  `hierarchy`, compiled in `hierarchy_build`
    3    partially precomputed traversal  `heads`, found by the walk of `heads_walk`
    3.1  heads of polygons, simple and regular  `polygon_heads`
    3.2  heads of screen cells  `cell_heads`
    4    node ordering policies  `lists.ORDERS`, `lists_layout.key_along`
    4    "direct illumination with lambertian shading"  `shadow_rays`, `tracer`, `refsim.shading`
    4    "1D texture caches"  `texture_cache`; with and without more lists `locality`
    4    the comparison with one list of boxes (the paper's reference 9)  `boxes`
    5    parts of the lists modified, vertices moved  `partial_update`, `refit`, `byte_ranges`
    5    several lists in a row, static and dynamic layers  `layers`, `search`
    5    copies and what overlaps with rendering (Table 3)  `byte_layout.bytes_of`, `transfer`
Beside the paper
    a stack on the same tree `ordered_stack`; kd-trees without one (its reference 2) `kd_tree`, `kd_search`; what warps
    do `visits`, `warps`; the traversal as a fragment and as a vertex shader `shaders`, `shader_search`; lists in a
    file `list_file`

Symbols
    C barycentre of a node's box, G of a triangle, C_i and G_i their components: `hierarchy`
    dir, param, intersectedTriangle, relativeNext of the pseudo-code: the ray's list, best, found, step in
    `traversal.walk`; node.isTriangle is an escape index of 1 or 0
    x_min, x_max of a node's projection: `lists_layout.key_along`

Deviations, beside the errata (`errata`, `culling`, `hierarchy`)
    - Of hits at the same t the triangle with the lower number counts, so that all lists, heads and layers give one
      answer; the pseudo-code keeps the one listed first.
    - A sphere is tested against the ray's segment up to the best hit, without a root: the same decision in exact
      arithmetic, and one that float32 cannot get wrong (`traversal`).
    - Spheres hold what float32 may accept for a hit of their triangles, and rays carry a margin: no hit is lost to
      rounding, for some 1e-5 of the distance.
    - The intersection test reads a record of 48 bytes a triangle, made from its vertices, in the place of the vertices.
    - Shadow rays end at any hit, and are sent only where the light is on the side that was hit.
    - Triangles of zero area stay in the lists; nothing hits them.
    - A head is used for rays that its planes were made for, each of which is asked (`polygon_heads`).
"""
