/* The pseudo-code's loop over traversal lists, one ray after the other, as refsim.papers.sphere_hierarchy.traversal.walk
 * has it: the same operations in the same order. Built without contraction (-ffp-contract=off) the bits are the same too.
 *
 * Rows [0, count) of `rows` are traced, nearest hits, both sides. escape: relative indices; payload: spheres, or in its
 * fourth word the triangle's number; record: 12 floats a triangle (v0, n, m1, m2). Nodes and tests are exact, a ray.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define KAPPA 0x28p-24f
#define SMALLEST 0x1p-60f
#define LARGEST 0x1p+60f

void traverse(size_t count, const int32_t *restrict rows, const int32_t *restrict lists, const int32_t *restrict starts,
              const float *restrict origin, const float *restrict direction, const float *restrict t_max,
              const int32_t *restrict escape, const int32_t *restrict payload, const int64_t *restrict first,
              const float *restrict records, const float *restrict root, int32_t *restrict triangle, float *restrict t,
              float *restrict u, float *restrict v, int32_t *restrict nodes, int32_t *restrict tests)
{
    for (size_t j = 0; j < count; j++) {
        const size_t row = (size_t)rows[j];
        const float limit = t_max[row];
        if (!(limit > 0.0f))
            continue;
        const float ox = origin[3 * row], oy = origin[3 * row + 1], oz = origin[3 * row + 2];
        const float dx = direction[3 * row], dy = direction[3 * row + 1], dz = direction[3 * row + 2];
        const float square = dx * dx + dy * dy + dz * dz;
        const float wx = dx / square, wy = dy / square, wz = dz / square;
        const float rx = root[0] - ox, ry = root[1] - oy, rz = root[2] - oz;
        const float far = sqrtf(rx * rx + ry * ry + rz * rz) + root[3];
        float slack = KAPPA * far;
        slack = slack > SMALLEST ? slack : SMALLEST;
        slack = far < LARGEST ? slack : INFINITY;
        int32_t found = triangle[row], visited = 0, tested = 0;
        float best = found < 0 ? limit : t[row], hit_u = u[row], hit_v = v[row];
        size_t node = (size_t)(first[lists[row]] + starts[row]);
        const size_t end = (size_t)first[lists[row] + 1];
        while (node < end) {
            int32_t step = escape[node];
            visited++;
            if (step == 1 || step == 0) {
                const int32_t number = payload[4 * node + 3];
                const float *a = records + 12 * (size_t)number;
                tested++;
                const float sx = a[0] - ox, sy = a[1] - oy, sz = a[2] - oz;
                const float den = a[3] * dx + a[4] * dy + a[5] * dz;
                const float at = (a[3] * sx + a[4] * sy + a[5] * sz) / den;
                const float hx = at * dx - sx, hy = at * dy - sy, hz = at * dz - sz;
                const float weight_u = hx * a[6] + hy * a[7] + hz * a[8];
                const float weight_v = hx * a[9] + hy * a[10] + hz * a[11];
                const int inside = (weight_u >= 0.0f) & (weight_v >= 0.0f) & (weight_u + weight_v <= 1.0f) & (at > 0.0f) &
                                   (at < limit);
                if (inside & ((at < best) | ((at == best) & (number < found)))) {
                    best = at, found = number, hit_u = weight_u, hit_v = weight_v;
                }
            } else {
                const float *s = (const float *)(payload + 4 * node);
                float x = s[0] - ox, y = s[1] - oy, z = s[2] - oz;
                float k = x * wx + y * wy + z * wz;
                k = k < best ? k : best;
                k = k > 0.0f ? k : 0.0f;
                x -= k * dx, y -= k * dy, z -= k * dz;
                const float reach = s[3] + slack;
                if (!(x * x + y * y + z * z > reach * reach))
                    step = 1;
            }
            node = step > 0 ? node + (size_t)step : end;
        }
        if (found >= 0)
            triangle[row] = found, t[row] = best, u[row] = hit_u, v[row] = hit_v;
        nodes[row] += visited;
        tests[row] += tested;
    }
}
