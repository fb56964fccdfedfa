/* Laminar air between annular fins on a tube, in three dimensions: half a pitch of half a disc.
 *
 *   u_t + div(u u) = -grad p + nu lap u + b T e_y,   T_t + div(u T) = a lap T,   p_t + c^2 div u = 0
 *
 * on a staggered grid, finite volumes, van Leer's limited upwind for what is carried along, explicit in time until
 * the flow is steady (artificial compressibility). x is across the wind or the plume, y along it, z along the tube.
 * Planes x = 0, z = 0 (the fin's middle) and z = end (the gap's) are mirrors; fins and tube are at T = 1, far air at 0.
 *
 * stdin:  nx ny nz  dz  fin_cells  tube_radius fin_radius  nu a b c  wind  steps dt  then dx[nx], dy[ny], y of the first face
 * stdout: film over conductivity [1/m] of sides, floor and rim, means over the second half of the time, and by what
 *         part of them its two quarters differ.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define G 2
static int nx, ny, nz, sx, sy;
static double *u, *v, *w, *p, *T, *un, *vn, *wn, *Tn, *dx, *dy, *xc, *yc, dz;
static unsigned char *solid; /* 0 air, 1 tube, 2 fin */
#define AT(i, j, k) (((size_t)((i) + G) * sy + ((j) + G)) * sx + ((k) + G))

static double *field(void) {
    double *f = calloc((size_t)(nx + 2 * G) * sy * sx, sizeof *f);
    if (!f) exit(3);
    return f;
}

/* value that a flow of the sign s carries over a face between m and q; mm and qq lie beyond */
static inline double carried(double s, double mm, double m, double q, double qq) {
    double up = s > 0 ? m : q, ahead = s > 0 ? q : m, behind = s > 0 ? mm : qq;
    double one = up - behind, two = ahead - up, prod = one * two;
    return up + (prod > 0 ? prod / (one + two) : 0.0);
}

static void ghosts(double wind) {
    for (int i = -G; i < nx + G; i++)
        for (int j = -G; j < ny + G; j++) {
            int lo = 0, hi = nz; /* z: w is a face value, mirrors have none of it */
            w[AT(i, j, lo)] = w[AT(i, j, hi)] = 0;
            for (int g = 1; g <= G; g++) {
                double *all[4] = {u, v, p, T};
                for (int n = 0; n < 4; n++) {
                    all[n][AT(i, j, -g)] = all[n][AT(i, j, g - 1)];
                    if (nz - 1 + g < nz + G) all[n][AT(i, j, nz - 1 + g)] = all[n][AT(i, j, nz - g)];
                }
                w[AT(i, j, -g)] = -w[AT(i, j, g)];
                if (nz + g < nz + G) w[AT(i, j, nz + g)] = -w[AT(i, j, nz - g)];
            }
        }
    for (int j = -G; j < ny + G; j++)
        for (int k = -G; k < nz + G; k++) {
            u[AT(0, j, k)] = 0;
            for (int g = 1; g <= G; g++) {
                double *all[4] = {v, w, p, T};
                u[AT(-g, j, k)] = -u[AT(g, j, k)];
                for (int n = 0; n < 4; n++) all[n][AT(-g, j, k)] = all[n][AT(g - 1, j, k)];
                int e = nx - 1, o = nx - 1 + g;
                v[AT(o, j, k)] = v[AT(e, j, k)], w[AT(o, j, k)] = w[AT(e, j, k)];
                p[AT(o, j, k)] = wind > 0 ? p[AT(e, j, k)] : -p[AT(e, j, k)];
                if (wind > 0) u[AT(nx, j, k)] = 0;
                if (g == 2) u[AT(nx + 1, j, k)] = u[AT(nx, j, k)];
                T[AT(o, j, k)] = u[AT(nx, j, k)] > 0 ? T[AT(e, j, k)] : 0;
            }
        }
    for (int i = -G; i < nx + G; i++)
        for (int k = -G; k < nz + G; k++)
            for (int g = 1; g <= G; g++) {
                int e = ny - 1, o = ny - 1 + g;
                u[AT(i, o, k)] = u[AT(i, e, k)], w[AT(i, o, k)] = w[AT(i, e, k)], p[AT(i, o, k)] = -p[AT(i, e, k)];
                if (g == 2) v[AT(i, ny + 1, k)] = v[AT(i, ny, k)];
                T[AT(i, o, k)] = v[AT(i, ny, k)] > 0 ? T[AT(i, e, k)] : 0;
                if (wind > 0) {
                    v[AT(i, 0, k)] = v[AT(i, -g, k)] = wind;
                    u[AT(i, -g, k)] = w[AT(i, -g, k)] = T[AT(i, -g, k)] = 0;
                    p[AT(i, -g, k)] = p[AT(i, 0, k)];
                } else {
                    u[AT(i, -g, k)] = u[AT(i, 0, k)], w[AT(i, -g, k)] = w[AT(i, 0, k)], p[AT(i, -g, k)] = -p[AT(i, 0, k)];
                    v[AT(i, -g, k)] = v[AT(i, 0, k)];
                    T[AT(i, -g, k)] = v[AT(i, 0, k)] < 0 ? T[AT(i, 0, k)] : 0;
                }
            }
}

static double wide(const double *d, int n, int i) { return d[i < 0 ? 0 : i >= n ? n - 1 : i]; }

/* rate of a velocity at its face: axis 0, 1, 2 */
static inline __attribute__((always_inline)) double momentum(const double *f, int axis, int i, int j, int k, double nu) {
    static const int step[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const double *vel[3] = {u, v, w};
    double here = f[AT(i, j, k)], rate = 0;
#pragma GCC unroll 3
    for (int d = 0; d < 3; d++) {
        int a = step[d][0], b = step[d][1], c = step[d][2];
        int i0 = i - step[axis][0], j0 = j - step[axis][1], k0 = k - step[axis][2];
        double size, before, after, vm, vp;
        if (d == axis) { /* faces of this control volume are cell centres */
            double lo = d == 0 ? wide(dx, nx, i - 1) : d == 1 ? wide(dy, ny, j - 1) : dz;
            double hi = d == 0 ? wide(dx, nx, i) : d == 1 ? wide(dy, ny, j) : dz;
            size = 0.5 * (lo + hi), before = lo, after = hi;
            vm = 0.5 * (f[AT(i - a, j - b, k - c)] + here), vp = 0.5 * (here + f[AT(i + a, j + b, k + c)]);
        } else {
            size = d == 0 ? wide(dx, nx, i) : d == 1 ? wide(dy, ny, j) : dz;
            before = 0.5 * (size + (d == 0 ? wide(dx, nx, i - 1) : d == 1 ? wide(dy, ny, j - 1) : dz));
            after = 0.5 * (size + (d == 0 ? wide(dx, nx, i + 1) : d == 1 ? wide(dy, ny, j + 1) : dz));
            const double *o = vel[d];
            vm = 0.5 * (o[AT(i, j, k)] + o[AT(i0, j0, k0)]);
            vp = 0.5 * (o[AT(i + a, j + b, k + c)] + o[AT(i0 + a, j0 + b, k0 + c)]);
        }
        double m = f[AT(i - a, j - b, k - c)], q = f[AT(i + a, j + b, k + c)];
        double mm = f[AT(i - 2 * a, j - 2 * b, k - 2 * c)], qq = m;
        int far_i = i + 2 * a, far_j = j + 2 * b, far_k = k + 2 * c;
        qq = far_i < nx + G && far_j < ny + G && far_k < nz + G ? f[AT(far_i, far_j, far_k)] : q;
        if (d != axis) { /* a wall beside: no slip at half the way */
            int wm = solid[AT(i - a, j - b, k - c)] || solid[AT(i0 - a, j0 - b, k0 - c)];
            int wp = solid[AT(i + a, j + b, k + c)] || solid[AT(i0 + a, j0 + b, k0 + c)];
            if (wm) m = -here, mm = m;
            if (wp) q = -here, qq = q;
        }
        rate -= (vp * carried(vp, m, here, q, qq) - vm * carried(vm, mm, m, here, q)) / size;
        rate += here * (vp - vm) / size;
        rate += nu * ((q - here) / after - (here - m) / before) / size;
    }
    return rate;
}

static inline __attribute__((always_inline)) double heat(int i, int j, int k, double a) {
    double here = T[AT(i, j, k)], rate = 0;
    static const int step[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const double *vel[3] = {u, v, w};
#pragma GCC unroll 3
    for (int d = 0; d < 3; d++) {
        int e = step[d][0], b = step[d][1], c = step[d][2];
        double size = d == 0 ? dx[i] : d == 1 ? dy[j] : dz;
        double before = 0.5 * (size + (d == 0 ? wide(dx, nx, i - 1) : d == 1 ? wide(dy, ny, j - 1) : dz));
        double after = 0.5 * (size + (d == 0 ? wide(dx, nx, i + 1) : d == 1 ? wide(dy, ny, j + 1) : dz));
        double vm = vel[d][AT(i, j, k)], vp = vel[d][AT(i + e, j + b, k + c)];
        double m = T[AT(i - e, j - b, k - c)], q = T[AT(i + e, j + b, k + c)];
        double mm = T[AT(i - 2 * e, j - 2 * b, k - 2 * c)], qq = T[AT(i + 2 * e, j + 2 * b, k + 2 * c)];
        int wm = solid[AT(i - e, j - b, k - c)], wp = solid[AT(i + e, j + b, k + c)];
        if (wm) m = mm = here;
        if (wp) q = qq = here;
        if (solid[AT(i - 2 * e, j - 2 * b, k - 2 * c)]) mm = m;
        if (solid[AT(i + 2 * e, j + 2 * b, k + 2 * c)]) qq = q;
        rate -= (vp * carried(vp, m, here, q, qq) - vm * carried(vm, mm, m, here, q)) / size;
        rate += here * (vp - vm) / size;
        rate += a * ((wp ? 2 * (1 - here) / size : (q - here) / after) - (wm ? 2 * (here - 1) / size : (here - m) / before)) / size;
    }
    return rate;
}

/* heat into the air over conductivity and area, of sides, floor, rim */
static void films(double *h) {
    double q[3] = {0}, area[3] = {0};
    for (int i = 0; i < nx; i++)
        for (int j = 0; j < ny; j++)
            for (int k = 0; k < nz; k++) {
                if (solid[AT(i, j, k)]) continue;
                double here = 1 - T[AT(i, j, k)];
                if (k > 0 && solid[AT(i, j, k - 1)] == 2) q[0] += dx[i] * dy[j] * 2 * here / dz, area[0] += dx[i] * dy[j];
                int near[3][2] = {{i - 1, j}, {i, j - 1}, {i, j + 1}}, n = 3;
                for (int s = 0; s < n + 1; s++) {
                    int a = s < 3 ? near[s][0] : i + 1, b = s < 3 ? near[s][1] : j;
                    int what = a < 0 ? 0 : solid[AT(a, b, k)];
                    if (!what) continue;
                    int across = a != i;
                    double face = (across ? dy[j] : dx[i]) * dz, half = 0.5 * (across ? dx[i] : dy[j]);
                    int which = what == 1 ? 1 : 2;
                    q[which] += face * here / half, area[which] += 0.25 * 3.14159265358979 * face; /* a circle's stairs */
                }
            }
    for (int n = 0; n < 3; n++) h[n] = area[n] > 0 ? q[n] / area[n] : 0;
}

int main(void) {
    int fin, steps;
    double inner, outer, nu, a, b, c, wind, dt, y0;
    if (scanf("%d %d %d %lf %d %lf %lf %lf %lf %lf %lf %lf %d %lf", &nx, &ny, &nz, &dz, &fin, &inner, &outer, &nu, &a, &b, &c, &wind, &steps, &dt) != 14) return 2;
    sx = nz + 2 * G, sy = ny + 2 * G;
    dx = calloc(nx, sizeof *dx), dy = calloc(ny, sizeof *dy), xc = calloc(nx, sizeof *xc), yc = calloc(ny, sizeof *yc);
    for (int i = 0; i < nx; i++) if (scanf("%lf", &dx[i]) != 1) return 2;
    for (int j = 0; j < ny; j++) if (scanf("%lf", &dy[j]) != 1) return 2;
    if (scanf("%lf", &y0) != 1) return 2;
    double at = 0;
    for (int i = 0; i < nx; i++) xc[i] = at + 0.5 * dx[i], at += dx[i];
    at = y0;
    for (int j = 0; j < ny; j++) yc[j] = at + 0.5 * dy[j], at += dy[j];
    u = field(), v = field(), w = field(), p = field(), T = field(), un = field(), vn = field(), wn = field(), Tn = field();
    solid = calloc((size_t)(nx + 2 * G) * sy * sx, 1);
    for (int i = -G; i < nx + G; i++)
        for (int j = -G; j < ny + G; j++)
            for (int k = -G; k < nz + G; k++) {
                int m = i < 0 ? -1 - i : i, n = k < 0 ? -1 - k : k >= nz ? 2 * nz - 1 - k : k;
                if (m >= nx || j < 0 || j >= ny) continue;
                double r = hypot(xc[m], yc[j]);
                solid[AT(i, j, k)] = r < inner ? 1 : r < outer && n < fin ? 2 : 0;
                if (wind > 0) v[AT(i, j, k)] = solid[AT(i, j, k)] ? 0 : wind;
            }
    double mean[2][3] = {{0}}, h[3];
    long count[2] = {0};
    for (int n = 0; n < steps; n++) {
        ghosts(wind);
        for (int i = 0; i <= nx; i++)
            for (int j = 0; j <= ny; j++)
                for (int k = 0; k <= nz; k++) {
                    size_t s = AT(i, j, k);
                    int in_x = j < ny && k < nz, in_y = i < nx && k < nz, in_z = i < nx && j < ny;
                    double left = 0.5 * (wide(dx, nx, i - 1) + wide(dx, nx, i)), down = 0.5 * (wide(dy, ny, j - 1) + wide(dy, ny, j));
                    un[s] = !in_x || i == 0 || (i == nx && wind > 0) || solid[s] || solid[AT(i - 1, j, k)]
                                ? 0 : u[s] + dt * (momentum(u, 0, i, j, k, nu) - (p[s] - p[AT(i - 1, j, k)]) / left);
                    vn[s] = j == 0 && wind > 0 ? wind : !in_y || solid[s] || solid[AT(i, j - 1, k)]
                                ? 0 : v[s] + dt * (momentum(v, 1, i, j, k, nu) - (p[s] - p[AT(i, j - 1, k)]) / down + 0.5 * b * (T[s] + T[AT(i, j - 1, k)]));
                    wn[s] = !in_z || k == 0 || k == nz || solid[s] || solid[AT(i, j, k - 1)]
                                ? 0 : w[s] + dt * (momentum(w, 2, i, j, k, nu) - (p[s] - p[AT(i, j, k - 1)]) / dz);
                    if (i < nx && j < ny && k < nz) Tn[s] = solid[s] ? 1 : T[s] + dt * heat(i, j, k, a);
                }
        double *t;
        t = u, u = un, un = t, t = v, v = vn, vn = t, t = w, w = wn, wn = t, t = T, T = Tn, Tn = t;
        for (int i = 0; i < nx; i++)
            for (int j = 0; j < ny; j++)
                for (int k = 0; k < nz; k++) {
                    size_t s = AT(i, j, k);
                    if (solid[s]) continue;
                    p[s] -= dt * c * c * ((u[AT(i + 1, j, k)] - u[s]) / dx[i] + (v[AT(i, j + 1, k)] - v[s]) / dy[j] + (w[AT(i, j, k + 1)] - w[s]) / dz);
                }
        int half = n < steps / 2 ? -1 : n < steps - steps / 4 ? 0 : 1; /* a plume swings: means over the last two quarters */
        if (half >= 0 && n % 20 == 0) {
            films(h);
            for (int m = 0; m < 3; m++) mean[half][m] += h[m];
            count[half]++;
        }
    }
    for (int m = 0; m < 3; m++) {
        double one = mean[0][m] / count[0], other = mean[1][m] / count[1];
        printf("%.8g %.3g\n", 0.5 * (one + other), one + other > 0 ? 2 * (other - one) / (one + other) : 0);
    }
    return 0;
}
