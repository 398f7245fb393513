"""The Hierarchical Ray Engine (Szécsi, WSCG 2006), and the Ray Engine (Carr, Hall and Hart 2002), its baseline.

Where the paper's parts are
    2.1  rays in textures, triangles as full-screen quads, t as depth  `tracer.trace_ray_engine`, `shaders.quad_vertex`
    3    point sprites over tiles, test in the vertex shader  `shaders.sprite_vertex`
    3    all tiles per primitive, texture fetch in the vertex shader  submission="primitive"
    3    all primitives per tile, cone in uniforms  submission="tile", `tracer.read_back`
    3    the next ray written to the render target  `shaders.intersection_fragment`
    4    enclosing cone, incremental  `shaders.cone_fragment`, `refsim.geometry.cone`
    4    cone–sphere test  `refsim.geometry.cone.meets_sphere`
    4    vertex layout  `vertices.TriangleVertex`
    5    a stencil bit a generation  `tracer.stencil_state`, `passes`
    5    final rays against non-ideal geometry  `non_ideal`, rule "final_rays"; corrected: rule "nearest"
    9    environment for rays that hit nothing  `refsim.shading`
    9    future work: non-ideal objects, caustics  `non_ideal.trace_non_ideal`, `caustics.caustic`

Symbols
    a apex, x axis, φ half of the opening angle: `Cone(apex, axis, cos, sin)`     r direction and p origin of a ray
    q, e, n, c, g, t of the construction: local names in `refsim.geometry.cone_construction`
    v, r centre and radius of a triangle's sphere: `TriangleVertex.position`

Deviations, beside the errata HRE-E1…E7 (`refsim.geometry.cone.Printed`, option `errata`)
    - A tile's draw call is an instance of one instanced draw: the same vertices in the same order, cones in a uniform
      array instead of 256 changes of one uniform; `draw.calls` counts 1, not one a tile.
    - The opening is kept as (cos φ, sin φ); a second loop over the tile's rays measures what float32 left outside.
    - Targets are padded to whole tiles with dead rays and drawn under a scissor; the paper's sizes divide evenly.
    - The next-ray target is cleared to dead rays in every pass; the paper does not say what stays in skipped pixels.
    - From generation 8 on no stencil bit is left and nothing is excluded: one reading of "without excluding further
      terminated paths"; dead rays hit nothing anyway.
    - All rays are traced, eye rays included; the paper takes the first hits from rasterisation (section 3).
    - Ideal and non-ideal triangles share a pass: a ray that ends on a diffuse surface sets its stencil bit, so its
      pixel is shaded once more, with a dead ray.
    - `non_ideal` draws the two apart. Final rays alone, as section 5 says, miss what stands before, between and inside
      glass; its rule "nearest" tests every generation and takes the stencil bit back where a path ends.
    - A new ray starts epsilon off the surface; depth is t times a power of two that takes every t below 1.
    - A cone wider than 82.8° (cos φ = 1/8) counts as unbounded, and the sphere test allows 2⁻¹⁸ (d + r) for float32:
      why, `refsim.geometry.cone`. Spheres are as large as the hits that float32 accepts (`refsim.geometry.sphere`).
    - t of the translation is −(w cos φ − z sin φ) / (2 sin φ cos φ), the same number as g²/(e·g) without the difference
      of vectors; HRE-E4 as printed is evaluated without arc functions, where both sides have the same sign.
    - Section 4 carries normals at the vertices; its text does not say which normal bends a ray. The method bends by the
      triangle's (`shading="geometric"`) unless told, and so do Figure 4, the tile sizes and most views of Figure 7;
      `shading="smooth"` bends by the vertices' normals, as in Figures 5 and 6, and Figure 7 and the table of coherence
      give both. Which one matters: rays stay closer together by smooth normals.
    - The layout's plane offset and texture coordinates are carried and not read; the surface rides in texture 0's w.
"""
