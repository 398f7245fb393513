/* The Ray Engine's inner work as a plain C loop: every ray against every triangle, nearest hit kept.
 *
 * The same plane-form test as refsim.geometry.triangle, the same operations in the same order, blocks of rays that stay
 * in cache, structure of arrays; outputs t, u, v and the triangle's number. Rays [first, last) of n are done, so that
 * threads share the rays. triangles: 12 floats each (v0, n, m1, m2).
 * Inlining one_triangle would keep gcc 12 from vectorising it.
 */
#include <stddef.h>

#define BLOCK 1024

__attribute__((noinline)) static void one_triangle(size_t m, const float *restrict ox, const float *restrict oy, const float *restrict oz,
                         const float *restrict dx, const float *restrict dy, const float *restrict dz,
                         const float *restrict limit, const float *restrict a, int k, float *restrict ht,
                         float *restrict hu, float *restrict hv, int *restrict id)
{
    const float vx = a[0], vy = a[1], vz = a[2], nx = a[3], ny = a[4], nz = a[5];
    const float px = a[6], py = a[7], pz = a[8], qx = a[9], qy = a[10], qz = a[11];
    for (size_t i = 0; i < m; i++) {
        float sx = vx - ox[i], sy = vy - oy[i], sz = vz - oz[i];
        float den = nx * dx[i] + ny * dy[i] + nz * dz[i];
        float t = (nx * sx + ny * sy + nz * sz) / den;
        float hx = t * dx[i] - sx, hy = t * dy[i] - sy, hz = t * dz[i] - sz;
        float u = hx * px + hy * py + hz * pz;
        float v = hx * qx + hy * qy + hz * qz;
        int closer = (u >= 0.0f) & (v >= 0.0f) & (u + v <= 1.0f) & (t > 0.0f) & (t < limit[i]) & (t < ht[i]);
        ht[i] = closer ? t : ht[i];
        hu[i] = closer ? u : hu[i];
        hv[i] = closer ? v : hv[i];
        id[i] = closer ? k : id[i];
    }
}

void nearest_hits(size_t n, size_t first, size_t last, const float *ray, size_t triangles, const float *triangle,
                  float *hit, int *number)
{
    for (size_t start = first; start < last; start += BLOCK) {
        const size_t m = last - start < BLOCK ? last - start : BLOCK;
        const float *r = ray + start;
        float *h = hit + start;
        for (size_t k = 0; k < triangles; k++)
            one_triangle(m, r, r + n, r + 2 * n, r + 3 * n, r + 4 * n, r + 5 * n, r + 6 * n, triangle + 12 * k, (int)k,
                         h, h + n, h + 2 * n, number + start);
    }
}
