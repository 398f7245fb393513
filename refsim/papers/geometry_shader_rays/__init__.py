"""Recursive Ray Tracing in Geometry Shader (Ralovich, Magdics, 2010), and its predecessor in the fragment shader.

Where the paper's parts are
    3    steps 1–6, two vertex buffers, ping-pong  `tracer.GeometryShaderTracer`
    4    S_VB, G, G', 64 bytes  `record.buffer_records`, `record.rays_of_depth`; Figure 4a `Generation.occupancy`
    4.1  three stages and stream output  `passes.tracing_pass`; intersection in the geometry shader stages="geometry",
         the divergence it is rejected for `simt`, `simt_lanes`
    4.2  early exit against the scene's box  `naive.misses_box`, `grid_traversal.search_grid`, `bvh_nodes`
    4.2  fixed order of emission  `passes.emitting_geometry`, option emission_order
    4.3  points at pixel centres  `tracer.GeometryShaderTracer.fill`
    4.3  cells in a 3-D texture, packed lists, two textures of co-located data  `grid.Grid`, `triangle_textures`
    4.4  Eq. 1  `passes.EQUATION_1`, `fragment_shaders`; several targets and blending passes `composition.Layers`
    5    Table 1's shares  `costs.shares`, from operations counted by `source_walk`
                           (the previous work's: `fragment_grid_costs`)
    5    Table 2's setups  stages="vertex" (passing through: passes=1), "vertex_only", method "fragment_grid"
    6    primary rays by rasterisation  `primary.first_triangles`; another structure `acceleration.Accelerator`, `bvh`
    ref. 6, the previous work  `fragment_grid.FragmentGridTracer`
    Listings 1, 2  `record.PackedHit`        Listing 3  `shaders.shooting`, `shaders.intersecting_vertex`
    Listing 4  `shaders.spawning` and the entries after it        lookupNormal, Phong  `shading`
    Listing 5  `fragment_shaders.shaded`, `fragment_shaders.unshadowed`, `fragment_shaders.lit`

Symbols
    P: option passes        w, h: the picture's size        G, G', S_VB, S_V: `record`        ρ: `Material.reflectivity`
    state, type: `record` (type generalised to the node of a ray tree)        emitNoMore: `shaders.Frame.last`
    RC: passes=1        SC: passes=2, reflections=False, refractions=False        RT: passes=2

Deviations, beside the errata GSR-E1…E12 (`errata.Printed`, option `errata`)
    - A record's pos.z, which the listings leave unused, carries the weight of the ray's path: the product of ρ and τ.
    - Any depth, number of lights and refracted rays: `type` names the node of the ray tree (`record`). On the tree
      of the listings it is 0, 1 and −1, as printed.
    - A layer a node of the tree and a target a light, where Eq. 1 in one target cannot be right (GSR-E8); the layers
      lie below each other in one framebuffer, as those of a texture array would.
    - emitNoMore is not explained: taken as "last pass". So the deepest surfaces are shaded without shadows, as with the
      paper's P = 2 ("eye + shadow + one reflection").
    - Eye rays come from the camera's rays and are only intersected in the first pass (GSR-E12 makes them).
    - The grid's texel holds the place of a list and its length; the text says "a pointer". Cells and boxes are
      wider than the triangles by what float32 needs (`grid_margins`), so that every structure finds the same bits.
    - Glass sends on ρ and τ = 1 − ρ whatever the angle: no Fresnel term. Phong's exponent is a whole number.
    - Stages note what each search found and cost (`shaders.Found`); no stage reads it.
"""
