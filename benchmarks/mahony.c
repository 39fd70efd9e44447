/* Mahony's filter as a C programmer would write it from its equations: the yardstick for speed.py.
 *
 * p = (kp, ki); s = (w, x, y, z, bias x, y, z), body to NED; out is n rows of 7, row 0 being s itself.
 * `mahony` follows the textbook: rotate the field to NED, level its horizontal part to north, rotate it back.
 * `mahony_short` writes the same products with fewer operations one after the other.
 */
#include <math.h>

typedef struct { double x, y, z; } vec;

static inline vec load(const double *v) { return (vec){v[0], v[1], v[2]}; }
static inline int is_sample(vec v) { return v.x == v.x && v.y == v.y && v.z == v.z; }
static inline double dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vec scale(double k, vec a) { return (vec){k * a.x, k * a.y, k * a.z}; }
static inline vec add(vec a, vec b) { return (vec){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline vec cross(vec a, vec b)
{
    return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline vec unit(vec a)
{
    double square = dot(a, a);
    return scale(square > 0.0 ? 1.0 / sqrt(square) : 0.0, a);
}

static inline vec field_textbook(double w, double x, double y, double z, vec m)
{
    vec r0 = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)};
    vec r1 = {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)};
    vec r2 = {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
    double hx = dot(r0, m), hy = dot(r1, m), hz = dot(r2, m), b = sqrt(hx * hx + hy * hy);
    return cross(m, add(scale(b, r0), scale(hz, r2)));
}

static inline vec field_short(double w, double x, double y, double z, vec m)
{
    vec north = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)};
    vec down = {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
    vec c = cross(m, down);
    return add(scale(dot(m, down), c), scale(sqrt(dot(c, c)), cross(m, north)));
}

#define MAHONY(NAME, FIELD)                                                                                        \
    void NAME(const double *p, double *s, const double *time, const double *gyr, const double *acc,                \
              const double *mag, double *out, long n)                                                              \
    {                                                                                                              \
        double w = s[0], x = s[1], y = s[2], z = s[3];                                                             \
        vec bias = load(s + 4);                                                                                    \
        for (int j = 0; j < 7 && n > 0; j++)                                                                       \
            out[j] = s[j];                                                                                         \
        for (long i = 1; i < n; i++) {                                                                             \
            double dt = time[i] - time[i - 1], h = 0.5 * dt;                                                       \
            vec a = load(acc + 3 * i), m = load(mag + 3 * i), e = {0, 0, 0};                                       \
            if (is_sample(a)) {                                                                                    \
                vec up = {-2 * (x * z - w * y), -2 * (y * z + w * x), -1 + 2 * (x * x + y * y)};                   \
                e = cross(unit(a), up);                                                                            \
            }                                                                                                      \
            if (is_sample(m))                                                                                      \
                e = add(e, FIELD(w, x, y, z, unit(m)));                                                            \
            bias = add(bias, scale(-p[1] * dt, e));                                                                \
            vec r = add(add(load(gyr + 3 * i), scale(-1, bias)), scale(p[0], e));                                  \
            double nw = w - h * (x * r.x + y * r.y + z * r.z), nx = x + h * (w * r.x + y * r.z - z * r.y);         \
            double ny = y + h * (w * r.y - x * r.z + z * r.x), nz = z + h * (w * r.z + x * r.y - y * r.x);         \
            double k = 1 / sqrt(nw * nw + nx * nx + ny * ny + nz * nz);                                            \
            w = k * nw, x = k * nx, y = k * ny, z = k * nz;                                                        \
            double *o = out + 7 * i;                                                                               \
            o[0] = w, o[1] = x, o[2] = y, o[3] = z, o[4] = bias.x, o[5] = bias.y, o[6] = bias.z;                   \
        }                                                                                                          \
        s[0] = w, s[1] = x, s[2] = y, s[3] = z, s[4] = bias.x, s[5] = bias.y, s[6] = bias.z;                       \
    }

MAHONY(mahony, field_textbook)
MAHONY(mahony_short, field_short)
