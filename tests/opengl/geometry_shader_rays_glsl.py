"""The three shaders of *Recursive Ray Tracing in Geometry Shader* (Ralovich, Magdics, 2010) in GLSL 4.5, and the shader
of its blending passes.

Written from Listings 2–5, with the errata of `refsim.papers.geometry_shader_rays.errata` corrected and the tree of rays
of `record`: any depth, any number of lights, refracted rays. A surface's normal is its triangle's. The search is
`precise`: no product is fused with a sum and nothing is reordered, as the margins of the grid's cells were derived so.

The scene lies where section 4.3 puts it, in textures: cells in a 3-D texture, packed references in a 2-D one, triangles
in two 3-D textures of four slices; or, `BUFFERS`, in shader storage, where a cell is two numbers: start and length.
"""

from __future__ import annotations

STORAGES = ("textures", "buffers")

RECORD = ("pos", "orig_t", "dir_idx", "uv_state")  # Listing 2

SCENE = """
#ifdef BUFFERS
layout(std430, binding=0) readonly buffer Triangles { vec4 triangle_data[]; };
layout(std430, binding=1) readonly buffer Surfaces { vec4 surface_data[]; };
layout(std430, binding=2) readonly buffer Cells { ivec2 cell_data[]; };
layout(std430, binding=3) readonly buffer References { int reference_data[]; };
layout(std430, binding=4) readonly buffer Loose { int loose_data[]; };
vec4 triangle(int i, int slice) { return triangle_data[4 * i + slice]; }
vec4 surface(int i, int slice) { return surface_data[4 * i + slice]; }
int loose(int k) { return loose_data[k]; }
int reference(int k) { return reference_data[k]; }
ivec2 cell(ivec3 at, ivec3 size) { return cell_data[(at.z * size.y + at.y) * size.x + at.x]; }
#else
layout(binding=0) uniform sampler3D triangles;
layout(binding=1) uniform sampler3D surfaces;
layout(binding=2) uniform isampler3D cells;
layout(binding=3) uniform isampler2D references;
layout(binding=4) uniform isampler2D loose_triangles;
vec4 triangle(int i, int slice) { return texelFetch(triangles, ivec3(i & 1023, i >> 10, slice), 0); }
vec4 surface(int i, int slice) { return texelFetch(surfaces, ivec3(i & 1023, i >> 10, slice), 0); }
int loose(int k) { return texelFetch(loose_triangles, ivec2(k, 0), 0).x; }
int reference(int k) { return texelFetch(references, ivec2(k & 4095, k >> 12), 0).x; }
ivec2 cell(ivec3 at, ivec3 size) {
    ivec3 texel = texelFetch(cells, at, 0).xyz;
    return ivec2(texel.y << 12 | texel.x, texel.z);
}
#endif
struct Ray { vec3 o; vec3 d; };
struct Hit { float u; float v; float t; int idx; };
#define DOT(a, b) (a.x * b.x + a.y * b.y + a.z * b.z)
const float INFINITY = uintBitsToFloat(0x7F800000u);
"""

INTERSECT = """
uniform vec3 lower, cell_size, inverse_size, cells_along;
uniform float far;
uniform int triangle_count, loose_count;

// The nearer of the hit so far and this triangle's; of two at the same t the lower number
void test_triangle(int candidate, Ray ray, float t_max, inout Hit hit) {
    vec3 v0 = triangle(candidate, 0).xyz, n = triangle(candidate, 1).xyz;
    vec3 m1 = triangle(candidate, 2).xyz, m2 = triangle(candidate, 3).xyz;
    precise vec3 s = v0 - ray.o;
    precise float along = DOT(n, s), facing = DOT(n, ray.d);
    precise float t = along / facing;
    precise vec3 h = t * ray.d - s;
    precise float u = DOT(h, m1), v = DOT(h, m2);
    bool inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < t_max;
    if (inside && (t < hit.t || t == hit.t && candidate < hit.idx)) hit = Hit(u, v, t, candidate);
}

bool done(Hit hit, bool any_hit) { return any_hit && hit.idx >= 0; }

Hit intersect_all(Ray ray, Hit hit, bool any_hit) {
    float t_max = hit.t;
    for (int k = 0; k < triangle_count && !done(hit, any_hit); ++k) test_triangle(k, ray, t_max, hit);
    return hit;
}

// hit.t: where the search ends. 3-D DDA; plane k of an axis is crossed at corner + k * spacing
Hit intersect_grid(Ray ray, Hit hit, bool any_hit) {
    float t_max = hit.t;
    precise vec3 s = lower - ray.o;
    float most = max(max(abs(ray.d.x), abs(ray.d.y)), abs(ray.d.z));
    bool walked = all(lessThanEqual(abs(s), vec3(far))) && most >= exp2(-20.0) && most <= exp2(20.0);
    if (!walked) return most > 0.0 && most < INFINITY && t_max > 0.0 ? intersect_all(ray, hit, any_hit) : hit;
    for (int k = 0; k < loose_count && !done(hit, any_hit); ++k) test_triangle(loose(k), ray, t_max, hit);
    // No component is zero, its sign stays
    vec3 steep = max(abs(ray.d), vec3(exp2(-26.0) * most));
    bvec3 backward = notEqual(floatBitsToUint(ray.d) & 0x80000000u, uvec3(0u));
    vec3 d = mix(steep, -steep, backward);
    precise vec3 inverse = 1.0 / d, corner = s * inverse, spacing = cell_size * inverse;
    precise vec3 end = corner + cells_along * spacing;
    vec3 near_side = min(corner, end), far_side = max(corner, end);
    float enter = max(max(near_side.x, near_side.y), max(near_side.z, 0.0));
    float leave = min(min(far_side.x, far_side.y), far_side.z);
    if (!(enter <= min(hit.t, leave)) || done(hit, any_hit)) return hit;  // early exit, section 4.2
    precise vec3 place = (enter - corner) * (d * inverse_size);
    ivec3 at = ivec3(clamp(place, vec3(0.0), cells_along - 1.0));
    ivec3 size = ivec3(cells_along), way = mix(ivec3(1), ivec3(-1), backward);
    vec3 plane = vec3(at) + mix(vec3(1.0), vec3(0.0), backward);
    precise vec3 next = corner + plane * spacing;
    for (;;) {
        ivec2 list = cell(at, size);
        for (int k = list.x; k < list.x + list.y && !done(hit, any_hit); ++k)
            test_triangle(reference(k), ray, t_max, hit);
        // A hit beyond this cell is kept, but the search goes on
        float last = min(hit.t, leave);
        int axis = next.x <= next.y && next.x <= next.z ? 0 : next.y <= next.z ? 1 : 2;
        if (done(hit, any_hit) || next[axis] >= last) return hit;
        bvec3 here = equal(ivec3(axis), ivec3(0, 1, 2));
        at += mix(ivec3(0), way, here);
        plane += mix(vec3(0.0), vec3(way), here);
        next = corner + plane * spacing;
    }
}
"""

# Listing 3
VERTEX = """
layout(location=0) in vec4 pos; layout(location=1) in vec4 orig_t;
layout(location=2) in vec4 dir_idx; layout(location=3) in vec4 uv_state;
flat out vec4 v_pos, v_orig_t, v_dir_idx, v_uv_state;
void main() {
    v_pos = pos; v_orig_t = orig_t; v_dir_idx = dir_idx; v_uv_state = uv_state;
    int state = int(uv_state.z), type = int(uv_state.w);
    if (state <= 1) {
        Hit hit = intersect_grid(Ray(orig_t.xyz, dir_idx.xyz), Hit(0.0, 0.0, orig_t.w, -1), type > 0);
        v_orig_t.w = hit.t;
        v_dir_idx.w = float(hit.idx);
        v_uv_state = vec4(hit.u, hit.v, 1.0, uv_state.w);
    }
    gl_Position = vec4(pos.xy, 0.0, 1.0);
    gl_PointSize = 1.0;
}
"""

# Listing 4
GEOMETRY = """
layout(points) in; layout(points, max_vertices = LIGHTS + 3) out;
flat in vec4 v_pos[], v_orig_t[], v_dir_idx[], v_uv_state[];
flat out vec4 g_pos, g_orig_t, g_dir_idx, g_uv_state;
uniform vec3 background, lights[LIGHTS];
uniform float epsilon;
uniform int branching, layers, emit_no_more, shadows, reflections, refractions;

void emit(float weight, Ray ray, float t, int idx, vec2 uv, int state, int type, int node) {
    vec2 pixel = v_pos[0].xy;
    g_pos = vec4(pixel, weight, 1.0); g_orig_t = vec4(ray.o, t);
    g_dir_idx = vec4(ray.d, float(idx)); g_uv_state = vec4(uv, float(state), float(type));
    float y = 1.0 - ((1.0 - pixel.y) + 2.0 * float(node)) / float(layers);
    gl_Position = vec4(pixel.x, y, 0.0, 1.0);
    gl_PointSize = 1.0;
    EmitVertex(); EndPrimitive();
}

// The ray to be intersected in the next pass
void emit_new(float weight, Ray ray, float t, int type, int node) {
    emit(weight, ray, t, -1, vec2(0.0), 1, type, node);
}

// Starts off the surface, on the side that it travels to
Ray leaving(vec3 point, vec3 n, vec3 d) {
    vec3 o = point + n * (DOT(d, n) > 0.0 ? epsilon : -epsilon);
    return Ray(o, d);
}

vec3 unit(vec3 a) { float square = DOT(a, a); vec3 b = a / sqrt(square); return b; }

void main() {
    int state = int(v_uv_state[0].z), type = int(v_uv_state[0].w), idx = int(v_dir_idx[0].w);
    if (state > 1) return;
    bool surface_ray = type <= 0;
    int node = surface_ray ? -type : (type - 1) / LIGHTS;
    bool shown = surface_ray && node > 0 && background != vec3(0.0);
    if (idx < 0 && !shown) return;
    Ray ray = Ray(v_orig_t[0].xyz, v_dir_idx[0].xyz);
    float t = v_orig_t[0].w, weight = v_pos[0].z;
    emit(weight, ray, t, idx, v_uv_state[0].xy, 3, type, node);
    if (!surface_ray || idx < 0 || emit_no_more != 0) return;

    vec3 n = triangle(idx, 1).xyz;
    float ior = triangle(idx, 0).w, rho = triangle(idx, 1).w, tau = triangle(idx, 2).w;
    vec3 hit_point = ray.o + ray.d * t;
    if (shadows != 0)
        for (int l = 0; l < LIGHTS; ++l) {
            vec3 side = lights[l] - hit_point;
            vec3 o = leaving(hit_point, n, side).o;
            vec3 to_light = lights[l] - o;
            float square = DOT(to_light, to_light);
            float distance = sqrt(square);
            vec3 d = to_light / distance;
            emit_new(weight, Ray(o, d), distance, 1 + l + LIGHTS * node, node);
        }

    float along = DOT(ray.d, n);
    float sign = along < 0.0 ? 1.0 : -1.0;
    vec3 m = n * sign;
    float c = -along * sign;
    float eta = along < 0.0 ? 1.0 / ior : ior, k = 1.0 - eta * eta * (1.0 - c * c);
    bool glass = tau > 0.0 && refractions != 0, refracts = glass && k >= 0.0;
    if (glass && !refracts) rho = rho + tau;  // total internal reflection
    if (rho > 0.0 && reflections != 0) {
        vec3 d = ray.d + m * (2.0 * c);
        emit_new(weight * rho, leaving(hit_point, n, unit(d)), INFINITY, -(branching * node + 1), branching * node + 1);
    }
    if (refracts) {
        float across = eta * c - sqrt(k);
        vec3 d = ray.d * eta + m * across;
        emit_new(weight * tau, leaving(hit_point, n, unit(d)), INFINITY, -(branching * node + 2), branching * node + 2);
    }
}
"""

# Listing 5 and Eq. 1
FRAGMENT = """
flat in vec4 g_pos, g_orig_t, g_dir_idx, g_uv_state;
layout(location=0) out vec4 unshadowed;
layout(location=1) out vec4 lit[LIGHTS];
uniform vec3 background, lights[LIGHTS], radiances[LIGHTS];

float power(float base, int exponent) {
    float result = 1.0;
    for (; exponent > 0; exponent >>= 1, base *= base) if ((exponent & 1) == 1) result *= base;
    return result;
}

void main() {
    int state = int(g_uv_state.z), type = int(g_uv_state.w), idx = int(g_dir_idx.w);
    if (state < 3) discard;
    unshadowed = vec4(0.0, 0.0, 0.0, 1.0);
    for (int l = 0; l < LIGHTS; ++l) lit[l] = vec4(0.0, 0.0, 0.0, 1.0);
    if (type > 0) {
        for (int l = 0; l < LIGHTS; ++l) if ((type - 1) % LIGHTS == l) lit[l] = vec4(0.0);
        return;
    }
    float weight = g_pos.z;
    for (int l = 0; l < LIGHTS; ++l) lit[l] = vec4(0.0);
    unshadowed = vec4(background * weight, 0.0);
    if (idx < 0) return;
    vec3 d = g_dir_idx.xyz, n = triangle(idx, 1).xyz, diffuse = surface(idx, 3).rgb;
    float specular = surface(idx, 0).w;
    int exponent = int(triangle(idx, 3).w);
    vec3 point = g_orig_t.xyz + d * g_orig_t.w;
    n = DOT(n, d) < 0.0 ? n : -n;
    unshadowed = vec4(diffuse * 0.2 * weight, 0.0);
    for (int l = 0; l < LIGHTS; ++l) {
        vec3 towards = lights[l] - point;
        float square = DOT(towards, towards);
        vec3 to_light = towards / sqrt(square);
        float n_dot_l = max(DOT(n, to_light), 0.0);
        vec3 mirrored = n * (2.0 * n_dot_l) - to_light;
        float r_dot_v = -DOT(mirrored, d);
        float highlight = n_dot_l > 0.0 && r_dot_v > 0.0 && specular > 0.0 ? specular * power(r_dot_v, exponent) : 0.0;
        lit[l] = vec4((diffuse * n_dot_l + highlight) * radiances[l] * weight, 0.0);
    }
}
"""

# Section 4.4: one triangle over the picture adds one target of one layer
SCREEN = """
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }
"""
BLENDING = """
layout(binding=0) uniform sampler2D target;
uniform int first_row;
layout(location=0) out vec4 color;
void main() { color = vec4(texelFetch(target, ivec2(gl_FragCoord.xy) + ivec2(0, first_row), 0).rgb, 1.0); }
"""


def tracing_sources(lights: int, storage: str) -> dict[str, str]:
    """The shaders of a tracing pass, by moderngl's names, for so many lights (at least one)."""
    head = f"#version 450 core\n#define LIGHTS {lights}\n" + ("#define BUFFERS\n" if storage == "buffers" else "")
    return {
        "vertex_shader": head + SCENE + INTERSECT + VERTEX,
        "geometry_shader": head + SCENE + GEOMETRY,
        "fragment_shader": head + SCENE + FRAGMENT,
    }


def blending_sources() -> dict[str, str]:
    """The shaders of a blending pass."""
    head = "#version 450 core\n"
    return {"vertex_shader": head + SCREEN, "fragment_shader": head + BLENDING}
