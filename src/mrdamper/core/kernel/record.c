/* A run's monotone pieces: turning points, found once and used by every candidate.
 *
 * A reversal counts when the displacement has come back by more than the dead band. Its place inside
 * the sample interval is the extremum of the cubic Hermite through (x, v) of the two samples.
 */
#include <stdlib.h>

/* Extremum of the Hermite cubic on one interval, or the better end when there is none inside. */
static double hermite_extremum(double x0, double v0, double x1, double v1, double h, double side)
{
    const double c1 = v0 * h, c2 = 3.0 * (x1 - x0) - (2.0 * v0 + v1) * h, c3 = (v0 + v1) * h - 2.0 * (x1 - x0);
    double best = side * x0 > side * x1 ? x0 : x1;
    double root[2] = {-1.0, -1.0};
    const double qa = 3.0 * c3, qb = 2.0 * c2, disc = qb * qb - 4.0 * qa * c1;
    if (disc >= 0.0) {
        const double q = -0.5 * (qb + (qb >= 0.0 ? sqrt(disc) : -sqrt(disc)));
        if (q != 0.0) root[0] = c1 / q;
        if (qa != 0.0) root[1] = q / qa;
    }
    for (int i = 0; i < 2; i++) {
        if (root[i] > 0.0 && root[i] < 1.0) {
            const double l = root[i], x = x0 + l * (c1 + l * (c2 + l * c3));
            if (side * x > side * best) best = x;
        }
    }
    return best;
}

static double turning_point(const mrd_record *r, size_t k, double side)
{
    double best = r->x[k];
    if (k > 0) {
        const double x = hermite_extremum(r->x[k - 1], r->v[k - 1], r->x[k], r->v[k], r->step, side);
        if (side * x > side * best) best = x;
    }
    if (k + 1 < r->n) {
        const double x = hermite_extremum(r->x[k], r->v[k], r->x[k + 1], r->v[k + 1], r->step, side);
        if (side * x > side * best) best = x;
    }
    return best;
}

static void record_close(mrd_record *r)
{
    free(r->first);
    free(r->turn);
    free(r->side);
    free(r->path);
    free(r->stage_x);
    free(r->stage_v);
    r->first = NULL;
    r->turn = r->side = r->path = r->stage_x = r->stage_v = NULL;
}

/* Stages of the two-stage implicit step (series_valve.c, spencer.c) on the Hermite interpolant. */
static void record_stages(mrd_record *r)
{
    const double gamma = 1.0 - sqrt(0.5);
    const size_t per = r->substeps;
    for (size_t i = 1; i < r->n; i++) {
        const double x0 = r->x[i - 1], x1 = r->x[i], d0 = r->v[i - 1] * r->step, d1 = r->v[i] * r->step;
        const double c2 = 3.0 * (x1 - x0) - 2.0 * d0 - d1, c3 = d0 + d1 - 2.0 * (x1 - x0);
        for (size_t j = 0; j < per; j++) {
            for (size_t s = 0; s < 2; s++) {
                const double l = ((double)j + (s ? 1.0 : gamma)) / (double)per;
                const size_t k = 2 * (i * per + j) + s;
                r->stage_x[k] = x0 + l * (d0 + l * (c2 + l * c3));
                r->stage_v[k] = (d0 + l * (2.0 * c2 + l * 3.0 * c3)) / r->step;
            }
        }
    }
}

static mrd_status record_open(mrd_record *r, size_t n, double step, const double *x, const double *v, const double *a,
                              double dead_band, double longest_step)
{
    memset(r, 0, sizeof *r);
    r->n = n;
    r->step = step;
    r->x = x;
    r->v = v;
    r->a = a;
    r->substeps = (size_t)ceil(step / longest_step - 1e-9);
    if (r->substeps < 1) r->substeps = 1;
    r->first = malloc((n + 2) * sizeof *r->first);
    r->turn = malloc((n + 2) * sizeof *r->turn);
    r->side = malloc((n + 2) * sizeof *r->side);
    r->path = malloc((n + 1) * sizeof *r->path);
    r->stage_x = calloc(2 * (n + 1) * r->substeps, sizeof *r->stage_x);
    r->stage_v = calloc(2 * (n + 1) * r->substeps, sizeof *r->stage_v);
    if (!r->first || !r->turn || !r->side || !r->path || !r->stage_x || !r->stage_v) {
        record_close(r);
        return MRD_NO_MEMORY;
    }

    /* First direction: the way the motion leaves its start by more than the dead band. */
    double side = 1.0;
    for (size_t i = 1; i < n; i++) {
        if (fabs(x[i] - x[0]) > dead_band) { side = x[i] > x[0] ? 1.0 : -1.0; break; }
    }
    r->pieces = 1;
    r->first[0] = 0;
    r->turn[0] = x[0];
    r->side[0] = side;
    size_t extreme = 0;
    for (size_t i = 1; i < n; i++) {
        if (side * x[i] >= side * x[extreme]) {
            extreme = i;
        } else if (side * (x[extreme] - x[i]) > dead_band) {
            const double at = turning_point(r, extreme, side);
            /* The extreme sample itself lies after the turn when it is already moving back. */
            const size_t begin = side * v[extreme] < 0.0 && extreme > r->first[r->pieces - 1] ? extreme : extreme + 1;
            side = -side;
            r->first[r->pieces] = begin;
            r->turn[r->pieces] = at;
            r->side[r->pieces] = side;
            r->pieces++;
            extreme = i;
        }
    }
    r->first[r->pieces] = n;
    r->turn[r->pieces] = n ? x[n - 1] : 0.0;
    for (size_t p = 0; p < r->pieces; p++) {
        double reached = 0.0;
        const double longest = p + 1 < r->pieces ? fabs(r->turn[p + 1] - r->turn[p]) : HUGE_VAL;
        for (size_t i = r->first[p]; i < r->first[p + 1]; i++) {
            const double travel = r->side[p] * (x[i] - r->turn[p]);
            if (travel > reached) reached = travel < longest ? travel : longest;
            r->path[i] = reached;
        }
    }
    record_stages(r);
    return MRD_OK;
}
