/* Laminar air flow between annular fins on a tube in three dimensions, for half a pitch of half a disc.
 *
 *   u_t + div(u u) = -grad p + nu lap u + b T e_y,   T_t + div(u T) = a lap T,   p_t + c^2 div u = 0
 *
 * The coordinates are cylindrical: r, theta (from the bottom, y points upwards) and z along the tube. The staggered grid
 * fits tube, fin and rim. The method is finite volumes with van Leer's limiter for convection and explicit time steps
 * until the flow is steady (artificial compressibility). The planes theta = 0 and pi, z = 0 (middle of the fin) and
 * z = end (middle of the gap) are mirrors. Fin and tube have T = 1, and the far air has T = 0.
 *
 * stdin:  nr nt nz  dz  fin_r fin_z (cells of the fin)  nu a b c  wind  steps dt, then the nr + 1 radii of the faces
 * stdout: heat-transfer coefficient / conductivity [1/m] of sides, floor and rim as means over the second half of the
 *         time, each with the relative difference of its two quarters; then convected heat / heat from the walls.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define G 2
static int nr, nt, nz, fr, fz, st, sz, *wall; /* wall: number of solid cells across the gap at each radius */
static double *u, *v, *w, *p, *T, *un, *vn, *wn, *Tn, *rf, *rc, *dr, *ct, *sf, dz, dt_angle;
#define AT(i, j, k) (((size_t)((i) + G) * st + ((j) + G)) * sz + ((k) + G))
#define SOLID(i, k) ((k) < wall[(i) + G])

static double *field(void) {
    double *f = calloc((size_t)(nr + 2 * G) * st * sz, sizeof *f);
    if (!f) exit(3);
    return f;
}

/* Return the value that a flow of sign s carries through the face between m and q; mm and qq are the next cells. */
static inline double carried(double s, double mm, double m, double q, double qq) {
    double up = s > 0 ? m : q, ahead = s > 0 ? q : m, behind = s > 0 ? mm : qq;
    double one = up - behind, two = ahead - up, prod = one * two;
    return up + (prod > 0 ? prod / (one + two) : 0.0);
}

static void mirrors(void) {
    for (int i = -G; i < nr + G; i++)
        for (int j = -G; j < nt + G; j++) {
            w[AT(i, j, 0)] = w[AT(i, j, nz)] = 0;
            for (int g = 1; g <= G; g++) {
                double *even[4] = {u, v, p, T};
                for (int n = 0; n < 4; n++)
                    even[n][AT(i, j, -g)] = even[n][AT(i, j, g - 1)], even[n][AT(i, j, nz - 1 + g)] = even[n][AT(i, j, nz - g)];
                w[AT(i, j, -g)] = -w[AT(i, j, g)];
                if (g < G) w[AT(i, j, nz + g)] = -w[AT(i, j, nz - g)];
            }
        }
    for (int i = -G; i < nr + G; i++)
        for (int k = -G; k < nz + G; k++) {
            v[AT(i, 0, k)] = v[AT(i, nt, k)] = 0;
            for (int g = 1; g <= G; g++) {
                double *even[4] = {u, w, p, T};
                for (int n = 0; n < 4; n++)
                    even[n][AT(i, -g, k)] = even[n][AT(i, g - 1, k)], even[n][AT(i, nt - 1 + g, k)] = even[n][AT(i, nt - g, k)];
                v[AT(i, -g, k)] = -v[AT(i, g, k)];
                if (g < G) v[AT(i, nt + g, k)] = -v[AT(i, nt - g, k)];
            }
        }
}

static void far_air(double wind) {
    for (int j = -G; j < nt + G; j++)
        for (int k = -G; k < nz + G; k++) {
            int m = j < 0 ? -1 - j : j >= nt ? 2 * nt - 1 - j : j, enters = wind > 0 && ct[m] > 0;
            size_t e = AT(nr - 1, j, k), edge = AT(nr, j, k);
            if (enters) u[edge] = -wind * ct[m];
            u[AT(nr + 1, j, k)] = u[edge];
            for (int g = 0; g < G; g++) {
                size_t o = AT(nr + g, j, k);
                v[o] = enters ? (j < 0 ? -1 : 1) * wind * sf[abs(j)] : v[e], w[o] = enters ? 0 : w[e], p[o] = enters ? p[e] : -p[e];
                T[o] = u[edge] > 0 ? T[e] : 0;
            }
        }
}

static inline __attribute__((always_inline)) double momentum(const double *f, int axis, int i, int j, int k, double nu) {
    static const int step[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const double *vel[3] = {u, v, w};
    double here = f[AT(i, j, k)], rate = 0, radius = axis == 0 ? rf[i] : rc[i];
#pragma GCC unroll 3
    for (int d = 0; d < 3; d++) {
        int a = step[d][0], b = step[d][1], c = step[d][2];
        int i0 = i - step[axis][0], j0 = j - step[axis][1], k0 = k - step[axis][2];
        double low, high, before, after, vm, vp; /* areas of both faces / volume, distances, speeds */
        if (d == 0 && axis == 0) {
            double size = rc[i] - rc[i - 1];
            low = rc[i - 1] / (radius * size), high = rc[i] / (radius * size), before = dr[i - 1], after = dr[i];
        } else if (d == 0)
            low = rf[i] / (radius * dr[i]), high = rf[i + 1] / (radius * dr[i]), before = rc[i] - rc[i - 1], after = rc[i + 1] - rc[i];
        else
            before = after = d == 1 ? radius * dt_angle : dz, low = high = 1 / before;
        if (d == axis)
            vm = 0.5 * (f[AT(i - a, j - b, k - c)] + here), vp = 0.5 * (here + f[AT(i + a, j + b, k + c)]);
        else {
            const double *o = vel[d];
            vm = 0.5 * (o[AT(i, j, k)] + o[AT(i0, j0, k0)]);
            vp = 0.5 * (o[AT(i + a, j + b, k + c)] + o[AT(i0 + a, j0 + b, k0 + c)]);
        }
        double m = f[AT(i - a, j - b, k - c)], q = f[AT(i + a, j + b, k + c)], mm = f[AT(i - 2 * a, j - 2 * b, k - 2 * c)];
        double qq = d == axis && (d == 0 ? i == nr : d == 1 ? j >= nt - 1 : k >= nz - 1) ? q : f[AT(i + 2 * a, j + 2 * b, k + 2 * c)];
        if (d != axis && (SOLID(i - a, k - c) || SOLID(i0 - a, k0 - c))) m = mm = -here; /* no slip at the face, halfway */
        rate -= high * vp * (carried(vp, m, here, q, qq) - here) - low * vm * (carried(vm, mm, m, here, q) - here);
        rate += nu * (high * (q - here) / after - low * (here - m) / before);
    }
    return rate;
}

static inline __attribute__((always_inline)) double heat(int i, int j, int k, double a) {
    static const int step[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const double *vel[3] = {u, v, w};
    double here = T[AT(i, j, k)], rate = 0;
#pragma GCC unroll 3
    for (int d = 0; d < 3; d++) {
        int e = step[d][0], b = step[d][1], c = step[d][2];
        double low, high, before, after;
        if (d == 0)
            low = rf[i] / (rc[i] * dr[i]), high = rf[i + 1] / (rc[i] * dr[i]), before = rc[i] - rc[i - 1], after = rc[i + 1] - rc[i];
        else
            before = after = d == 1 ? rc[i] * dt_angle : dz, low = high = 1 / before;
        double vm = vel[d][AT(i, j, k)], vp = vel[d][AT(i + e, j + b, k + c)];
        double m = T[AT(i - e, j - b, k - c)], q = T[AT(i + e, j + b, k + c)];
        double mm = T[AT(i - 2 * e, j - 2 * b, k - 2 * c)], qq = T[AT(i + 2 * e, j + 2 * b, k + 2 * c)];
        if (SOLID(i - e, k - c)) m = mm = 2 - here;
        else if (SOLID(i - 2 * e, k - 2 * c)) mm = 2 - m;
        rate -= high * vp * (carried(vp, m, here, q, qq) - here) - low * vm * (carried(vm, mm, m, here, q) - here);
        rate += a * (high * (q - here) / after - low * (here - m) / before);
    }
    return rate;
}

/* Compute heat flow / (conductivity * area) of sides, floor and rim; then convected heat / heat from the walls. */
static void films(double *h, double a) {
    double q[4] = {0}, area[3] = {0};
    for (int j = 0; j < nt; j++) {
        for (int i = 0; i < fr; i++) {
            double face = rc[i] * dr[i] * dt_angle;
            q[0] += face * 2 * (1 - T[AT(i, j, fz)]) / dz, area[0] += face;
        }
        for (int k = 0; k < nz; k++) {
            int i = k < fz ? fr : 0, which = i ? 2 : 1;
            double face = rf[i] * dt_angle * dz;
            q[which] += face * 2 * (1 - T[AT(i, j, k)]) / dr[i], area[which] += face;
            q[3] += rf[nr] * dt_angle * dz * u[AT(nr, j, k)] * (u[AT(nr, j, k)] > 0 ? T[AT(nr - 1, j, k)] : 0) / a;
        }
    }
    for (int n = 0; n < 3; n++) h[n] = area[n] > 0 ? q[n] / area[n] : 0;
    h[3] = q[3] / (q[0] + q[1] + q[2]);
}

static void advance(double dt, double nu, double a, double b, double c) {
    double ang = dt_angle;
    for (int i = 0; i <= nr; i++) {
        int open = i < fr ? fz : 0, both = i - 1 < fr ? fz : 0; /* first air cell at this radius, and at the face towards the tube */
        for (int j = 0; j < nt; j++) {
            if (i > 0)
                for (int k = both; k < nz; k++) {
                    size_t s = AT(i, j, k);
                    double across = 0.25 * (v[s] + v[AT(i, j + 1, k)] + v[AT(i - 1, j, k)] + v[AT(i - 1, j + 1, k)]);
                    double turn = 0.5 * (v[AT(i, j + 1, k)] - v[s] + v[AT(i - 1, j + 1, k)] - v[AT(i - 1, j, k)]) / ang;
                    un[s] = u[s] + dt * (momentum(u, 0, i, j, k, nu) - (p[s] - p[AT(i - 1, j, k)]) / (rc[i] - rc[i - 1])
                                         - 0.5 * b * ct[j] * (T[s] + T[AT(i - 1, j, k)]) + across * across / rf[i]
                                         - nu * (u[s] + 2 * turn) / (rf[i] * rf[i]));
                }
            if (i == nr) continue;
            if (j > 0)
                for (int k = open; k < nz; k++) {
                    size_t s = AT(i, j, k);
                    double across = 0.25 * (u[s] + u[AT(i + 1, j, k)] + u[AT(i, j - 1, k)] + u[AT(i + 1, j - 1, k)]);
                    double turn = 0.5 * (u[s] + u[AT(i + 1, j, k)] - u[AT(i, j - 1, k)] - u[AT(i + 1, j - 1, k)]) / ang;
                    vn[s] = v[s] + dt * (momentum(v, 1, i, j, k, nu) - (p[s] - p[AT(i, j - 1, k)]) / (rc[i] * ang)
                                         + 0.5 * b * sf[j] * (T[s] + T[AT(i, j - 1, k)]) - across * v[s] / rc[i]
                                         - nu * (v[s] - 2 * turn) / (rc[i] * rc[i]));
                }
            for (int k = open + 1; k < nz; k++) {
                size_t s = AT(i, j, k);
                wn[s] = w[s] + dt * (momentum(w, 2, i, j, k, nu) - (p[s] - p[AT(i, j, k - 1)]) / dz);
            }
            for (int k = open; k < nz; k++) {
                size_t s = AT(i, j, k);
                Tn[s] = T[s] + dt * heat(i, j, k, a);
            }
        }
    }
    double *t;
    t = u, u = un, un = t, t = v, v = vn, vn = t, t = w, w = wn, wn = t, t = T, T = Tn, Tn = t;
    for (int i = 0; i < nr; i++)
        for (int j = 0; j < nt; j++)
            for (int k = i < fr ? fz : 0; k < nz; k++) {
                size_t s = AT(i, j, k);
                double leaves = (rf[i + 1] * u[AT(i + 1, j, k)] - rf[i] * u[s]) / (rc[i] * dr[i]) + (v[AT(i, j + 1, k)] - v[s]) / (rc[i] * ang);
                p[s] -= dt * c * c * (leaves + (w[AT(i, j, k + 1)] - w[s]) / dz);
            }
}

int main(void) {
    int steps;
    double nu, a, b, c, wind, dt;
    if (scanf("%d %d %d %lf %d %d %lf %lf %lf %lf %lf %d %lf", &nr, &nt, &nz, &dz, &fr, &fz, &nu, &a, &b, &c, &wind, &steps, &dt) != 13) return 2;
    sz = nz + 2 * G, st = nt + 2 * G, dt_angle = 3.14159265358979 / nt;
    rf = calloc(nr + 2, sizeof *rf), rc = calloc(nr + 2, sizeof *rc), dr = calloc(nr + 2, sizeof *dr);
    ct = calloc(nt + 3, sizeof *ct), sf = calloc(nt + 3, sizeof *sf);
    wall = calloc(nr + 2 * G, sizeof *wall);
    for (int i = -G; i < nr + G; i++) wall[i + G] = i < 0 ? nz + G : i < fr ? fz : -G;
    rc++, dr++; /* index -1 is a cell inside the tube */
    for (int i = 0; i <= nr; i++) if (scanf("%lf", &rf[i]) != 1) return 2;
    for (int i = 0; i < nr; i++) rc[i] = 0.5 * (rf[i] + rf[i + 1]), dr[i] = rf[i + 1] - rf[i];
    rc[-1] = rc[0] - dr[0], dr[-1] = dr[0], dr[nr] = dr[nr - 1], rc[nr] = rc[nr - 1] + dr[nr];
    for (int j = 0; j < nt + 3; j++) ct[j] = cos((j + 0.5) * dt_angle), sf[j] = sin(j * dt_angle);
    u = field(), v = field(), w = field(), p = field(), T = field(), un = field(), vn = field(), wn = field(), Tn = field();
    for (int i = 0; i < nr; i++)
        for (int j = 0; j < nt; j++)
            for (int k = 0; k < nz && wind > 0; k++)
                if (!SOLID(i, k)) u[AT(i, j, k)] = i && !SOLID(i - 1, k) ? -wind * ct[j] : 0, v[AT(i, j, k)] = wind * sf[j];
    double mean[2][4] = {{0}}, h[4];
    long count[2] = {0};
    for (int n = 0; n < steps; n++) {
        mirrors();
        far_air(wind);
        advance(dt, nu, a, b, c);
        int half = n < steps / 2 ? -1 : n < steps - steps / 4 ? 0 : 1; /* The plume oscillates, so the last two quarters are averaged. */
        if (half >= 0 && n % 20 == 0) {
            films(h, a);
            for (int m = 0; m < 4; m++) mean[half][m] += h[m];
            count[half]++;
        }
    }
    for (int m = 0; m < 4; m++) {
        double one = mean[0][m] / count[0], other = mean[1][m] / count[1];
        printf("%.8g %.3g\n", 0.5 * (one + other), one + other > 0 ? 2 * (other - one) / (one + other) : 0);
    }
    return 0;
}
